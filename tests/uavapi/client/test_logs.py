"""The client's logs, at the real application, from a vehicle that holds two."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.client import Drone, Log, Unreachable, connect
from mavproxy_uavapi.core.errors import Busy, NotFound
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.support.fake_link import FakeLink
from tests.support.log_vehicle import LogVehicle
from tests.support.virtual_time import FastLoop


@pytest.fixture
def vehicle(loop: FastLoop, drone: Any, link: FakeLink, service: Service, tmp_path: Path) -> LogVehicle:
    """A disarmed vehicle with two logs."""
    loop.set_default_executor(AtOnce())
    service.settings = replace(service.settings, vehicle_logs=str(tmp_path / "api"))
    return LogVehicle(loop, drone, link)


@pytest.fixture
def standing(loop: FastLoop, url: str, vehicle: LogVehicle) -> Iterator[Drone]:
    """The client's side of that vehicle."""
    stack = contextlib.AsyncExitStack()
    yield loop.run(stack.enter_async_context(connect(url, "")))
    loop.run(stack.aclose())


def test_logs_are_listed(standing: Drone, loop: FastLoop) -> None:
    began = datetime(2026, 9, 21, 14, 13, 20, tzinfo=timezone.utc)
    assert loop.run(standing.logs()) == [Log(1, 1024, None, False), Log(2, 250_001, began, False)]


def test_log_is_saved_in_place_of_an_older_file(
    standing: Drone, vehicle: LogVehicle, loop: FastLoop, tmp_path: Path
) -> None:
    file = tmp_path / "flight.bin"
    file.write_bytes(b"an older one")
    log = loop.run(standing.logs())[1]
    assert loop.run(standing.download_log(log, str(file))) == file
    assert file.read_bytes() == vehicle.logs[2]
    assert loop.run(standing.logs())[1] == replace(log, downloaded=True)


def test_log_that_the_apis_machine_has_is_not_requested_again(
    standing: Drone, vehicle: LogVehicle, loop: FastLoop, tmp_path: Path
) -> None:
    loop.run(standing.download_log(loop.run(standing.logs())[0], tmp_path / "one.bin"))
    log = loop.run(standing.logs())[0]
    vehicle.received.clear()
    loop.run(standing.download_log(log, tmp_path / "two.bin"))
    assert vehicle.received == []
    assert (tmp_path / "two.bin").read_bytes() == vehicle.logs[1]


def test_log_that_is_gone_leaves_no_file(standing: Drone, loop: FastLoop, tmp_path: Path) -> None:
    file = tmp_path / "flight.bin"
    for downloaded in (False, True):
        with pytest.raises(NotFound, match="9"):
            loop.run(standing.download_log(Log(9, 1, None, downloaded), file))
    assert list(tmp_path.iterdir()) == []


def test_armed_vehicle_sends_no_logs(standing: Drone, drone: Any, loop: FastLoop) -> None:
    drone.fly()
    with pytest.raises(Busy, match="armed"):
        loop.run(standing.logs())


def test_cancelled_download_ends_the_transfer(
    standing: Drone, vehicle: LogVehicle, loop: FastLoop, tmp_path: Path
) -> None:
    log = loop.run(standing.logs())[1]
    saving = loop.create_task(standing.download_log(log, tmp_path / "flight.bin"))
    loop.pass_time(0.5)
    assert "LOG_REQUEST_DATA" in vehicle.names()
    saving.cancel()
    loop.pass_time(1.0)
    assert vehicle.names()[-1] == "LOG_REQUEST_END"
    assert not (tmp_path / "flight.bin").exists()


def test_folder_that_does_not_exist_is_an_os_error(standing: Drone, loop: FastLoop, tmp_path: Path) -> None:
    log = loop.run(standing.logs())[0]
    with pytest.raises(FileNotFoundError):
        loop.run(standing.download_log(log, tmp_path / "nowhere" / "flight.bin"))


def test_api_that_has_ended_is_unreachable(loop: FastLoop, tmp_path: Path) -> None:
    from mavproxy_uavapi.client.http import Http

    async def saving() -> None:
        async with Http("http://127.0.0.1:9") as http:
            await http.save("/logs/1", tmp_path / "flight.bin")

    loop.set_default_executor(AtOnce())
    with pytest.raises(Unreachable, match="127.0.0.1:9"):
        loop.run(saving())
    assert list(tmp_path.iterdir()) == []
