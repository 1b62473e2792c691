"""A host on the time-travelling loop, a vehicle that tells where it is, and a station that answers."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

import pytest
from pymavlink import mavutil

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.settings import GradysModuleSettings, GradysSettings
from mavproxy_uavapi.core.host import Host
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink


MEMORY = Path("/dev/shm")
ROOM = 500_000_000  # bytes that must be free there


@pytest.fixture
def tmp_path(tmp_path: Path) -> Iterator[Path]:
    """A folder in memory, where that has room: each transaction is synced, for which a busy disk takes 0.1 s."""
    if not os.access(MEMORY, os.W_OK) or shutil.disk_usage(MEMORY).free < ROOM:
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(prefix="uavapi-", dir=MEMORY) as folder:
        yield Path(folder)


class AtOnce(Executor):
    """Instead of a thread: does the work where it is asked for, so that no real time goes by."""

    def __init__(self, *_: Any, **__: Any) -> None:
        """Take what a pool of threads takes."""

    def submit(self, call: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(call(*args, **kwargs))
        except Exception as error:  # noqa: BLE001  it belongs to whoever awaits
            future.set_exception(error)
        return future


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> type[AtOnce]:
    """The spool and sensors work without a thread; for others, what to put in place of their pool."""
    monkeypatch.setattr("mavproxy_gradys.forwarding.spool_thread.ThreadPoolExecutor", AtOnce)
    monkeypatch.setattr("mavproxy_gradys.forwarding.sensor_file.DaemonThreads", AtOnce)
    return AtOnce


class TelemetrySource:
    """A vehicle that sends telemetry on request; `loop.pass_time` does not make it send again."""

    MESSAGES: dict[str, dict[str, Any]] = {
        "heartbeat": {},
        "gps_raw_int": {"fix_type": 3},
        "sys_status": {
            "onboard_control_sensors_present": mavlink.MAV_SYS_STATUS_PREARM_CHECK,
            "onboard_control_sensors_health": mavlink.MAV_SYS_STATUS_PREARM_CHECK,
            "battery_remaining": 97,
            "voltage_battery": 12600,
        },
        "vfr_hud": {"groundspeed": 1.25, "airspeed": 1.5, "heading": 270},
        "global_position_int": {"lat": -158400810, "lon": -479266420, "relative_alt": 20123, "alt": 604123},
    }

    def __init__(self, host: Host, system: int = 10) -> None:
        self._host, self.system = host, system

    def send(self, name: str, **fields: Any) -> None:
        """Send one message now."""

        async def arrive() -> None:
            self._host._receive(message_of(name, self.system, **{**self.MESSAGES.get(name, {}), **fields}))

        self._host.bridge.loop.run(arrive())

    def send_all(self) -> None:
        """Send all messages now."""
        for name in self.MESSAGES:
            self.send(name)

    @property
    def state(self) -> Any:
        return self._host.fleet.vehicles[self.system]


@pytest.fixture
def telemetry(host: Host, loop: FastLoop) -> TelemetrySource:
    """Vehicle 10, which has sent each message once; its link watch must not start on the bench loop."""
    host.link_watch.watch = lambda state: None  # type: ignore[method-assign]
    vehicle = TelemetrySource(host)
    vehicle.send_all()
    return vehicle


class FakePoster:
    """A station or a receiver: remembers what came, and answers what a test wants.

    Attributes:
        posts: (time, url, body) of each.
        answer: what it answers; an exception is raised, a callable asked with the body.
        takes: s until it answers.
    """

    def __init__(self, loop: FastLoop) -> None:
        self._loop = loop
        self.posts: list[tuple[float, str, bytes]] = []
        self.answer: Any = {"type": 103}
        self.takes = 0.0
        self.closed = False

    async def post(self, url: str, body: bytes, content_type: str) -> Any:
        self.posts.append((self._loop.time(), url, body))
        await asyncio.sleep(self.takes)
        answer = self.answer(body) if callable(self.answer) else self.answer
        if isinstance(answer, Exception):
            raise answer
        return answer

    @staticmethod
    def acknowledging(body: bytes) -> dict[str, list[int]]:
        """An `answer`: a receiver that keeps all readings."""
        return {"acknowledged": [reading["seq"] for reading in json.loads(body)["readings"]]}

    async def close(self) -> None:
        self.closed = True

    @property
    def times(self) -> list[float]:
        return [at for at, _, _ in self.posts]

    @property
    def forms(self) -> list[dict[str, str]]:
        return [dict(parse_qsl(body.decode())) for _, _, body in self.posts]

    @property
    def batches(self) -> list[list[int]]:
        return [[reading["seq"] for reading in json.loads(body)["readings"]] for _, _, body in self.posts]


@pytest.fixture
def poster(loop: FastLoop) -> FakePoster:
    """A station that answers at once."""
    return FakePoster(loop)


@pytest.fixture
def down() -> NotDelivered:
    """Nobody answers."""
    return NotDelivered("cannot connect")


@pytest.fixture
def settings(tmp_path: Path) -> Callable[..., GradysSettings]:
    """A snapshot: `settings(gs="127.0.0.1:1")`."""

    def make(**values: Any) -> GradysSettings:
        return GradysModuleSettings({"spool": str(tmp_path / "spool.db"), **values}).snapshot()

    return make
