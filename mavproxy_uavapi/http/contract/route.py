"""One path of the API: its access, its parameters, and its action."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from aiohttp import web

from mavproxy_uavapi.core import errors
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.http.contract.requests import CallOptions, JobOptions, Request

Answer = Mapping[str, object] | web.StreamResponse  # a body, or the whole response
Action = Callable[[Any], Awaitable[Answer]]  # takes a Call
EITHER = ("GET", "POST")
POST, PUT, DELETE = ("POST",), ("PUT",), ("DELETE",)
WITH_BODY = ("POST", "PUT")
JSON, FORM = "application/json", "application/x-www-form-urlencoded"
# What programs call a file when they do not say what it is; `curl --data-binary` says FORM.
BINARY: Mapping[str, Any] = {"schema": {"type": "string", "format": "binary"}}
ANY_FILE: Mapping[str, Mapping[str, Any]] = {
    "application/octet-stream": BINARY,
    FORM: {},
}
EVENTS = "text/event-stream"
TEXT: Mapping[str, Any] = {"schema": {"type": "string"}}
OBJECT: Mapping[str, Any] = {"schema": {"type": "object"}}
AREAS: Mapping[str, Any] = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"kind": "inclusion", "name": "field", "ceiling": 60},
            "geometry": {
                "type": "Polygon",
                "coordinates": [
                    [[149.16, -35.367], [149.17, -35.367], [149.17, -35.359], [149.16, -35.359], [149.16, -35.367]]
                ],
            },
        },
        {
            "type": "Feature",
            "properties": {"kind": "exclusion", "name": "mast", "radius": 25, "ceiling": 40},
            "geometry": {"type": "Point", "coordinates": [149.1665, -35.3625]},
        },
    ],
    "limits": {"height": 60, "distance": 400, "speed": 8},
}
FILE_FORM: Mapping[str, Any] = {
    "schema": {
        "type": "object",
        "required": ["file"],
        "properties": {"file": {"type": "string", "contentMediaType": "application/octet-stream"}},
    }
}
JPEG: Mapping[str, Mapping[str, Any]] = {"image/jpeg": BINARY}
OF_A_VEHICLE = (errors.LinkLost, errors.NoVehicle)
OF_A_COMMAND = (*OF_A_VEHICLE, errors.NotSupported, errors.Rejected, errors.TimedOut, errors.Busy)
OF_A_FLIGHT = (
    *OF_A_COMMAND,
    errors.Superseded,
    errors.ModeChanged,
    errors.Paused,
    errors.NotArmed,
    errors.Aborted,
    errors.OutsideEnvelope,
    errors.TooNear,
    errors.Expired,
    errors.Stale,
    errors.NotFound,
)
WATCH, FLY, ADMIN = Role.WATCH, Role.FLY, Role.ADMIN  # what a route can need


@dataclass(frozen=True, eq=False)
class Route:
    """A path: its access, its parameters, and its action. The action's docstring is its summary."""

    path: str
    action: Action
    model: type[Request]
    needs: Role  # which role a caller needs; `Call.vehicle` looks at the vehicle
    methods: tuple[str, ...] = ("GET",)
    # The types of a body that the action itself reads, which holds no parameters, and how each is described.
    raw: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    job: bool = False  # whether the action runs as a job; a client need not wait for it
    fleet: bool = False  # whether the action runs as a job of each of several vehicles
    stops: bool = False  # whether it stops a vehicle; no limit refuses it then
    holds: bool = False  # whether it does no more than that; a fleet's vehicles need not be named then
    verb: str = ""  # the vehicle's method that it calls, if not every type of vehicle has it
    audited: bool = True  # whether a command is audited; not for one that comes many times a second
    partly: bool = False  # whether it may be done in part, which is answered with 207
    # What else decides how it flies, by name, if the setting `rehearse` wants it rehearsed; None if it does not.
    conditions: Callable[[], Mapping[str, Any]] | None = None
    message: str = ""  # the MAVLink message that the answer shows, if it shows one and nothing else
    # What the description says of it; the answer's shape is the type that the action returns.
    content: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # by type, of an answer that is no JSON
    done: str = "success"  # the `result` of a success, as an example
    names: Mapping[str, str] = field(default_factory=dict)  # an example of each `{name}` in the path
    errors: tuple[type[UavApiError], ...] = OF_A_FLIGHT  # that the action raises
    of_vehicle: bool = True  # whether the prefix /vehicles/{sysid} says which vehicle is meant

    @property
    def commands(self) -> bool:
        """Whether it is a command; it is one unless GET is its only method."""
        return self.methods != ("GET",)

    @property
    def options(self) -> type[CallOptions]:
        """What the query may say besides the parameters."""
        return JobOptions if self.job or self.fleet else CallOptions

    def body_types(self, method: str) -> tuple[str, ...]:
        """The types of a body that a request of that method may have; none if it takes no body."""
        return (tuple(self.raw) or (JSON, FORM)) if method in WITH_BODY else ()

    @property
    def obeys_holder(self) -> bool:
        """Whether it is refused while somebody else holds the vehicle."""
        return self.commands and not self.stops

    @property
    def pattern(self) -> re.Pattern[str]:
        """Matches the paths of this route, with any value for each `{name}`."""
        return re.compile(re.sub(r"\\{(\w+)\\}", r"(?P<\1>[^/]+)", re.escape(self.path)))
