"""The run of one script: which version it is for, and what ends it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from typing import Any

import pytest

from mavproxy_uavapi.aerpaw import geometry, host, options
from mavproxy_uavapi.aerpaw.decorators import entrypoint
from mavproxy_uavapi.aerpaw.dummy_vehicle import DummyVehicle
from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.runner import BasicRunner
from mavproxy_uavapi.aerpaw.v2 import runner as runners_v2
from mavproxy_uavapi.aerpaw.v2 import vehicle as vehicles_v2
from mavproxy_uavapi.aerpaw.v2.safety import SafetyCheckerClient
from tests.support.ports import free_port
from tests.uavapi.aerpaw.conftest import FakeApi

seen: list[Any] = []


class Mission(BasicRunner):
    @entrypoint
    async def fly(self, vehicle: Any) -> None:
        seen.append(vehicle)


class MissionV2(runners_v2.BasicRunner):
    @runners_v2.entrypoint
    async def fly(self, vehicle: Any) -> None:
        seen.append(vehicle)


@pytest.fixture(autouse=True)
def around() -> Iterator[None]:
    seen.clear()
    log = logging.getLogger("aerpawlib")
    before = log.handlers, log.level, log.propagate
    yield
    log.handlers, log.level, log.propagate = before
    geometry.pickle_as_of("aerpawlib.v1.util.geometry")


def run(kind: type[Any], *more: str) -> int:
    chosen, rest = options.parse(["--script", "mission.py", *more])
    return host.run(chosen, rest, lambda _: kind)


@pytest.mark.parametrize(
    ("kind", "vehicle", "module"),
    [
        (Mission, DummyVehicle, "aerpawlib.v1.util.geometry"),
        (MissionV2, vehicles_v2.DummyVehicle, "aerpawlib.v2.types"),
    ],
)
def test_script_gets_a_vehicle_of_the_version_that_it_imports(kind: type[Any], vehicle: Any, module: str) -> None:
    assert run(kind, "--vehicle", "none") == 0
    assert type(seen[0]) is vehicle and seen[0].closed
    assert Coordinate.__module__ == module


def test_script_of_another_version_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(Mission, "--vehicle", "none", "--api-version", "v2") == 1
    assert "aerpawlib.v1, not of v2" in capsys.readouterr().err and seen == []


def test_safety_checker_that_does_not_answer_ends_the_script(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("zmq")
    monkeypatch.setattr("mavproxy_uavapi.aerpaw.host.SafetyCheckerClient", impatient)
    assert run(MissionV2, "--vehicle", "none", "--safety-checker-port", str(free_port())) == 1
    assert seen == []


def impatient(ip: str, port: int) -> Any:
    return SafetyCheckerClient(ip, port, 0.1)


def test_script_ends_when_its_vehicle_disarms(api: FakeApi, capsys: pytest.CaptureFixture[str]) -> None:
    class Waiting(runners_v2.BasicRunner):
        @runners_v2.entrypoint
        async def fly(self, _: Any) -> None:
            await asyncio.sleep(1.0)
            api.armed = False
            await asyncio.sleep(3600)

    api.armed = True
    assert run(Waiting, "--vehicle", "drone", "--conn", api.url) == 1
    assert "disarmed unexpectedly" in capsys.readouterr().err
    assert api.verbs() == []
