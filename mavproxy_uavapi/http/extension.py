"""The interface for other modules that add paths to the API; they import nothing else of `mavproxy_uavapi.http`.

A module gives its routes to `SharedModule.finish_loading`; the API serves them while the module is loaded:

    self.finish_loading([Route("/vision/land", land, LandRequest, FLY, EITHER, job=True)])
"""

from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.contract.answers import Aged, Success, means
from mavproxy_uavapi.http.contract.requests import NED_REACH, Blocking, Empty, Number, Request, Written
from mavproxy_uavapi.http.contract.responses import Done, envelope
from mavproxy_uavapi.http.contract.route import ADMIN, ANY_FILE, EITHER, FLY, POST, WATCH, Answer, Route
from mavproxy_uavapi.http.wire.bodies import in_time

__all__ = [
    "ADMIN",
    "ANY_FILE",
    "EITHER",
    "FLY",
    "NED_REACH",
    "POST",
    "WATCH",
    "Answer",
    "Blocking",
    "Aged",
    "Call",
    "Done",
    "Empty",
    "Number",
    "Request",
    "Route",
    "Success",
    "Written",
    "envelope",
    "in_time",
    "means",
]
