"""One path of the API: who may ask how, what is validated, and who answers."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.http.requests import Request
from mavproxy_uavapi.http.responses import Answer

Action = Callable[[Any], Awaitable[Answer]]  # takes a Call
EITHER = ("GET", "POST")
POST = ("POST",)


@dataclass(frozen=True)
class Route:
    """A path: who may ask how, what is validated, and who answers. The action's docstring is its summary."""

    path: str
    action: Action
    model: type[Request]
    methods: tuple[str, ...] = ("GET",)
    raw: bool = False  # whether the action itself reads the body, which holds no parameters
    job: bool = False  # whether the action runs as a job, which a client need not wait for
    stops: bool = False  # whether it stops a vehicle: no limit refuses it
    verb: str = ""  # the method of a vehicle that it calls, where not every type of vehicle has that
    trail: bool = True  # whether a call that commands is audited; one that comes many times a second would flush it

    @property
    def commands(self) -> bool:
        """Whether it does something; what can only be read with GET does not."""
        return self.methods != ("GET",)

    @property
    def pattern(self) -> re.Pattern[str]:
        """What matches a path that is this one, with something in the place of each `{name}`."""
        return re.compile(re.sub(r"\\{(\w+)\\}", r"(?P<\1>[^/]+)", re.escape(self.path)))
