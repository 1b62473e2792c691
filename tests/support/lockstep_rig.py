"""A rig without processes: vehicle, bridge and API in lock step, on the virtual clock.

Its tests are those of the rigs with real processes; what is waited for there (`Rig.sleep`) costs nothing here.
"""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlencode

from tests.support.at_once import AtOnce
from tests.support.mavproxy import mavproxy_state
from tests.support.processes import SPEEDUP, Rig
from tests.support.virtual_time import TimeTravellingLoop
from tests.support.world import World


class LockstepRig(Rig):
    """A vehicle and our side of a MAVProxy."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory, port=8000)
        self._loop = TimeTravellingLoop()
        asyncio.set_event_loop(self._loop)
        self._loop.set_default_executor(AtOnce())
        self.world = World(self._loop, mavproxy_state(), {})
        self.world.directory = directory
        self.control = SimpleNamespace(fault=self.world.fault, close=lambda: None)  # type: ignore[assignment]
        self.world.boot()
        self.world.go_live()

    def get(self, path: str, timeout: float = 120, **params: Any) -> Any:
        query = urlencode({name: str(value).lower() if value is True else value for name, value in params.items()})
        return self._asked("GET", f"{path}{'&' if '?' in path else '?'}{query}" if query else path, None, timeout)

    def post(self, path: str, timeout: float = 120, **body: Any) -> Any:
        return self._asked("POST", path, body, timeout)

    def _asked(self, method: str, path: str, body: Any, timeout: float) -> Any:
        reply = self.world.answer(self.world.begin(method, path, body), timeout * SPEEDUP)
        text = json.dumps(reply.body)
        return SimpleNamespace(status_code=reply.status, text=text, headers=reply.headers, json=lambda: reply.body)

    def sleep(self, seconds: float) -> None:
        """Let as much of the vehicle's time pass as a rig with processes does in `seconds`."""
        self._loop.pass_time(seconds * SPEEDUP)

    def clock(self) -> float:
        """Seconds of such a rig's clock."""
        return self._loop.time() / SPEEDUP

    def stop(self) -> None:
        self.world.close()
        tasks = asyncio.all_tasks(self._loop)
        for task in tasks:
            task.cancel()
        self._loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
        self.world.host.bridge._calls.close()
        self._loop.close()
        asyncio.set_event_loop(None)
        assert self._loop.defects == []
