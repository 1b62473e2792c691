"""A rig without processes: a virtual world, with the vocabulary of the rigs with real ones.

Its tests are those of the rigs with real processes; what is waited for there costs nothing here.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import requests
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from requests.structures import CaseInsensitiveDict

from mavproxy_uavapi.api import apply
from tests.support.calls import PendingCall
from tests.support.processes import SPEEDUP, Rig
from tests.support.wire import Wire
from tests.support.world import MODES, World

OURS = ("Content-Length", "Content-Type")  # which `World.request` states itself


class _WiredCall:
    """A request in flight, in memory."""

    def __init__(self, world: World, wire: Wire) -> None:
        self._world, self.wire = world, wire

    def is_answered(self) -> bool:
        return self.wire.reply.done()

    def answer(self, timeout: float) -> Any:
        reply = self._world.answer(self.wire, timeout * SPEEDUP)
        headers = CaseInsensitiveDict(reply.headers)
        body = reply.body
        return SimpleNamespace(status_code=reply.status, text=json.dumps(body), headers=headers, json=lambda: body)


class WiredRig(Rig):
    """A vehicle and our side of a MAVProxy; `vehicle` is copter, plane, quadplane or rover."""

    def __init__(self, directory: Path, vehicle: str = "copter") -> None:
        super().__init__(directory, port=8000)
        self.world = World({}, vehicle)
        self.world.directory = directory
        self.control = self.world.control
        self.world.boot()
        self.world.go_live()

    def call(self, method: str, path: str, *, timeout: float = 120, **content: Any) -> Any:
        return self._begin(method, path, **content).answer(timeout)

    def begin(self, method: str, path: str, body: dict[str, Any] | None = None) -> PendingCall:
        return self._begin(method, path, json=body)

    def hang_up(self, method: str, path: str, body: dict[str, Any] | None = None, after: float = 0.5) -> None:
        call = self._begin(method, path, json=body)
        self.pass_time(after)
        assert not call.is_answered(), "it answered too soon"
        call.wire.hang_up()

    def _begin(self, method: str, path: str, **content: Any) -> _WiredCall:
        request = requests.Request(method, self.url + path, **content).prepare()
        headers = {name: value for name, value in request.headers.items() if name not in OURS}
        path, kind = request.url.removeprefix(self.url), request.headers.get("Content-Type", "")
        body = request.body.encode() if isinstance(request.body, str) else request.body
        return _WiredCall(self.world, self.world.begin(method, path, body, kind=kind, headers=headers))

    def switch_mode(self, name: str) -> None:
        self.world.pilot_command(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, MODES[name])

    def set(self, name: str, value: str) -> None:
        service = self.world.service
        service.settings = replace(service.settings, **{name: value})
        apply(service.settings, service.host)

    def pass_time(self, seconds: float) -> None:
        """Let as much of the vehicle's time pass as a rig with processes does in `seconds`."""
        self.world.pass_time(seconds * SPEEDUP)

    @property
    def now(self) -> float:
        """Seconds of such a rig's clock."""
        return self.world.now / SPEEDUP

    def stop(self) -> None:
        self.world.close()
        assert self.world.loop.defects == []
