"""One path of the API: its access, its parameters, and its action."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.http.requests import CallOptions, JobOptions, Request
from mavproxy_uavapi.http.responses import Answer

Action = Callable[[Any], Awaitable[Answer]]  # takes a Call
EITHER = ("GET", "POST")
POST = ("POST",)
WITH_BODY = ("POST", "PUT")
JSON, FORM = "application/json", "application/x-www-form-urlencoded"
# What programs call a file when they do not say what it is; `curl --data-binary` says FORM.
ANY_FILE = ("application/octet-stream", FORM)
WATCH, FLY, ADMIN = Role.WATCH, Role.FLY, Role.ADMIN  # what a route can need


@dataclass(frozen=True)
class Route:
    """A path: its access, its parameters, and its action. The action's docstring is its summary."""

    path: str
    action: Action
    model: type[Request]
    needs: Role  # which role a caller needs; `Call.vehicle` looks at the vehicle
    methods: tuple[str, ...] = ("GET",)
    raw: tuple[str, ...] = ()  # the types of a body that the action itself reads, which holds no parameters
    job: bool = False  # whether the action runs as a job; a client need not wait for it
    fleet: bool = False  # whether the action runs as a job of each of several vehicles
    stops: bool = False  # whether it stops a vehicle; no limit refuses it then
    holds: bool = False  # whether it does no more than that; a fleet's vehicles need not be named then
    verb: str = ""  # the vehicle's method that it calls, if not every type of vehicle has it
    audited: bool = True  # whether a command is audited; not for one that comes many times a second
    message: str = ""  # the MAVLink message that the answer shows, if it shows one and nothing else

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
        return (self.raw or (JSON, FORM)) if method in WITH_BODY else ()

    @property
    def obeys_holder(self) -> bool:
        """Whether it is refused while somebody else holds the vehicle."""
        return self.commands and not self.stops

    @property
    def pattern(self) -> re.Pattern[str]:
        """Matches the paths of this route, with any value for each `{name}`."""
        return re.compile(re.sub(r"\\{(\w+)\\}", r"(?P<\1>[^/]+)", re.escape(self.path)))
