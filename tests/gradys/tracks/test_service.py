from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.tracks.flight import flight_of
from mavproxy_gradys.tracks.formats import TrackWaypoint
from mavproxy_gradys.tracks.service import Tracking
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Aborted
from mavproxy_uavapi.core.host import Host
from tests.gradys.conftest import AtOnce, TelemetrySource
from tests.support.virtual_time import FastLoop

PLACES = [TrackWaypoint(-15.84, -47.9266, 20.0)]


@pytest.fixture
def fleet(host: Host, telemetry: TelemetrySource) -> list[Any]:
    """Two vehicles in the air, in GUIDED."""
    fleet = [type(telemetry)(host, system) for system in (11, 12)]
    for vehicle in fleet:
        vehicle.send_all()
        vehicle.send("heartbeat", armed=True, mode="GUIDED", system_status=4)
        vehicle.send("extended_sys_state", landed_state=2)
    return fleet


def begin(loop: FastLoop, host: Host, tracks: Tracking, system: int, name: str = "a") -> Job:
    flight = flight_of(host.registry.find(system), PLACES, 1000.0)

    async def begun() -> Any:
        return host.jobs.begin(flight.copter, "fly", {"name": name}, lambda job: tracks.fly(flight, job))

    job: Job = loop.run(begun())
    loop.settle()
    return job


def test_the_flights_of_all_vehicles_are_reported_and_end_with_the_module(
    loop: FastLoop, host: Host, fleet: list[Any]
) -> None:
    tracks = Tracking(host)
    jobs = [begin(loop, host, tracks, vehicle.system) for vehicle in fleet]
    reported = tracks.report()["flights"]
    assert [(flight["vehicle"], flight["state"]) for flight in reported] == [(11, "running"), (12, "running")]
    loop.run(tracks.close())
    assert ["gradys is unloaded" in str(job.error) for job in jobs] == [True, True]


def test_flight_whose_request_was_still_read_does_not_outlive_the_module(
    loop: FastLoop, host: Host, fleet: list[Any]
) -> None:
    tracks = Tracking(host)
    loop.run(tracks.close())
    job = begin(loop, host, tracks, 11)
    assert isinstance(job.error, Aborted) and tracks.report()["flights"] == []


def test_of_a_vehicle_the_newest_flight_is_reported(loop: FastLoop, host: Host, fleet: list[Any]) -> None:
    tracks = Tracking(host)
    jobs = [begin(loop, host, tracks, 11, name) for name in "abc"]
    assert [job.running for job in jobs] == [False, False, True]
    assert [flight["job"] for flight in tracks.report()["flights"]] == [jobs[-1].id]
    loop.call_soon(jobs[-1].abort, Aborted("enough"))
    loop.settle()
    assert [flight["state"] for flight in tracks.report()["flights"]] == ["failed"]


def test_of_two_recordings_that_begin_at_once_one_is_refused(
    loop: FastLoop,
    host: Host,
    fleet: list[Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    at_once: type[AtOnce],
) -> None:
    monkeypatch.setattr("mavproxy_gradys.tracks.recorder.ThreadPoolExecutor", at_once)
    tracks = Tracking(host)

    async def both() -> Any:
        begun = [tracks.record(tmp_path / name, style="text", period=5.0, latest=None, system=11) for name in "ab"]
        return await asyncio.gather(*begun, return_exceptions=True)

    first, second = loop.run(both())
    assert (first.file.name, "is being recorded" in str(second)) == ("a", True)
    assert [file.name for file in tmp_path.iterdir()] == ["a"]
    loop.run(tracks.close())


def test_a_recording_that_could_not_begin_is_none(
    loop: FastLoop,
    host: Host,
    fleet: list[Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    at_once: type[AtOnce],
) -> None:
    monkeypatch.setattr("mavproxy_gradys.tracks.recorder.ThreadPoolExecutor", at_once)
    tracks = Tracking(host)
    with pytest.raises(Exception, match="No such file"):
        loop.run(tracks.record(tmp_path / "no" / "a", style="text", period=5.0, latest=None, system=11))
    assert tracks.report()["recording"] is None
