"""A mistake that no good flight shows: where something fails it ends with a traceback, and the vehicle stays up.

    mavproxy-uavapi run no_end.py                                               # well
    mavproxy-uavapi run no_end.py --fault link_loss@leg2:8s                     # broken: ended

A script decides where its vehicle goes if it cannot go on: by `/command/rtl`, again until the link is back.
"""

import os

import requests

API = os.environ.get("UAVAPI_URL", "http://127.0.0.1:8000")


def call(path, **values):
    requests.post(API + path, json=values, timeout=300).raise_for_status()


call("/command/arm")
call("/command/takeoff", alt=10)
for north, east in [(20, 0), (20, 20), (0, 0)]:
    call("/movement/go_to_ned_wait", x=north, y=east, z=-10)
call("/command/land")
