"""The handlers of gradys: readings that a caller posts, and POST /mission/fly-track, a job as every verb's."""

from __future__ import annotations

import asyncio
import ipaddress
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_gradys.http import LONGEST_LIST, LONGEST_TEXT, MOST_READINGS, GradysHandlers, Readings
from mavproxy_gradys.service import Gradys
from mavproxy_gradys.settings import GradysSettings
from mavproxy_gradys.tracks.request import TrackRequest
from mavproxy_uavapi.core.errors import Invalid, TooManyRequests
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.oversight.endings import Policy
from mavproxy_uavapi.http.callers.call import Call, Service
from mavproxy_uavapi.http.callers.caller import CALLER, Caller
from mavproxy_uavapi.http.contract.parsing import parse
from mavproxy_uavapi.http.contract.requests import Empty, JobOptions
from mavproxy_uavapi.http.contract.router import Match
from mavproxy_uavapi.http.door.auditing import audited
from mavproxy_uavapi.http.handlers.jobs import list_jobs
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.gradys.conftest import AtOnce, TelemetrySource
from tests.support.virtual_time import FastLoop

LINE = "(1, -158400810, -479266420, 584090, 0, 65535, 0, 0, 3, 10)\n"
LONG = LINE + "# a comment\n" * 10_000


def readings(body: Any) -> list[Any]:
    request = parse(Readings, "body", body)
    assert isinstance(request, Readings)
    return request.readings


@pytest.mark.parametrize("value", [1, 0, 2**63 - 1, 2.5, True, False, "yes", "12", [1, 2.5], ""])
def test_a_value_stays_what_it_was(value: Any) -> None:
    (reading,) = readings({"quantity": "a", "value": value})
    assert reading.value == value and type(reading.value) is type(value)


@pytest.mark.parametrize(
    "value",
    [
        None,
        float("nan"),
        float("inf"),
        {},
        [1, "a"],
        2**63,
        -(2**63) - 1,
        [10**400],
        [float("nan")],
        "x" * (LONGEST_TEXT + 1),
        [0] * (LONGEST_LIST + 1),
    ],
)
def test_a_value_that_cannot_be_stored_is_refused_once(value: Any) -> None:
    with pytest.raises(Invalid) as raised:
        readings({"readings": [{"quantity": "a", "value": value}]})
    assert len(raised.value.problems) == 1


@pytest.mark.parametrize(
    "body",
    [
        {"quantity": "a/b", "value": 1},
        {"quantity": "", "value": 1},
        {"quantity": "a" * 65, "value": 1},
        {"quantity": "a", "value": 1, "time": float("nan")},
        {"quantity": "a", "value": 1, "sysid": 256},
        {"quantity": "a", "value": 1, "representation": "m\0"},
        {"quantity": "a", "value": 1, "representation": "\ud800"},
        {"quantity": "a", "value": 1, "device": "#"},
        {"readings": []},
        {"readings": [{"quantity": "a", "value": 1}] * (MOST_READINGS + 1)},
        {},
    ],
)
def test_what_is_no_reading_is_refused(body: Any) -> None:
    with pytest.raises(Invalid):
        readings(body)


def post_reading(loop: FastLoop, host: Host, gradys: Gradys, **body: Any) -> Any:
    service: Any = SimpleNamespace(host=host, settings=SimpleNamespace(sysid=0))
    call = Call(service, {CALLER: Caller(None)}, parse(Readings, "body", {"value": 1, **body}))  # type: ignore[arg-type]
    return loop.run(GradysHandlers(gradys).readings(call))


@pytest.fixture
def posting(
    loop: FastLoop,
    host: Host,
    telemetry: TelemetrySource,
    settings: Callable[..., GradysSettings],
    at_once: type[AtOnce],
) -> Iterator[Callable[..., Callable[..., Any]]]:
    """`posting(**settings)`: starts the module with a vehicle in the air; gives what posts a reading."""
    gradys = Gradys(host)

    def start(**values: Any) -> Callable[..., Any]:
        loop.run(gradys.start(settings(**values)))
        return partial(post_reading, loop, host, gradys)

    yield start
    loop.run(gradys.stop())


def test_nobody_poses_as_a_vehicle(posting: Callable[..., Callable[..., Any]]) -> None:
    post = posting(quantities="position@1,alt=VFR_HUD.alt")
    for body in ({"quantity": "position"}, {"quantity": "alt", "device": "uav-1"}):
        with pytest.raises(Invalid, match="from the vehicle itself only"):
            post(**body)
    for body in ({"quantity": "status"}, {"quantity": "status", "device": "buoy"}):
        with pytest.raises(Invalid, match="take another name"):
            post(**body)
    assert post(quantity="position", device="buoy")["result"] == "Kept 1 reading"
    assert post(quantity="temperature")["result"] == "Kept 1 reading"


def test_nobody_poses_as_a_vehicle_of_the_devices_name(posting: Callable[..., Callable[..., Any]]) -> None:
    post = posting(device="north", sink="http://a/r")
    for device in (None, "north-1", "uav-1"):
        with pytest.raises(Invalid, match="from the vehicle itself only"):
            post(quantity="position", device=device)
    assert post(quantity="position", device="north")["result"] == "Kept 1 reading"


def test_a_track_has_limits() -> None:
    for body in (
        {},
        {"track": ""},
        {"track": "x", "reach": 0},
        {"track": "x", "ground": 1e6},
        {"track": "x", "transit": 501},
    ):
        with pytest.raises(Invalid):
            parse(TrackRequest, "body", body)


# -- POST /mission/fly-track ------------------------------------------------------------------------------


@pytest.fixture
def service(host: Host, telemetry: TelemetrySource, monkeypatch: pytest.MonkeyPatch) -> Service:
    """Before vehicle 10, which flies in GUIDED."""

    async def at_once(call: Callable[..., Any], *args: Any) -> Any:
        return call(*args)

    monkeypatch.setattr(asyncio, "to_thread", at_once)
    telemetry.send("heartbeat", armed=True, mode="GUIDED", system_status=4)
    telemetry.send("extended_sys_state", landed_state=2)
    return Service(host, ApiModuleSettings(environ={}).snapshot())


class PassedRequest(dict[Any, Any]):
    """A request that has passed the door, as far as these tests ask it."""


def track_call(service: Service, text: str = LONG, *, wait: bool = True) -> Call:
    request: Any = PassedRequest({CALLER: Caller(ipaddress.ip_address("10.0.0.9"))})
    request.path, request.remote = "/mission/fly-track", "10.0.0.9"
    request.headers, request.transport = {}, None
    return Call(service, request, TrackRequest(track=text), Match("/mission/fly-track"), JobOptions(wait=wait))


def fly_track(service: Service, call: Call) -> Any:
    return audited(call, GradysHandlers(Gradys(service.host)).fly_track)


def sizes(service: Service, loop: FastLoop) -> list[int]:
    """Bytes of what the trail and the list of jobs tell."""
    jobs = loop.run(list_jobs(Call(service, SimpleNamespace(path="/jobs"), Empty())))  # type: ignore[arg-type]
    return [len(json.dumps(jobs)), *(len(json.dumps(entry.request)) for entry in service.host.audit.entries)]


def test_neither_job_nor_audit_trail_keeps_the_tracks_text(loop: FastLoop, service: Service) -> None:
    assert loop.run(fly_track(service, track_call(service, wait=False))).status == 202
    with pytest.raises(Invalid):
        loop.run(fly_track(service, track_call(service, LONG + "nonsense")))
    service.host.jobs.on_ended.clear()
    service.host.jobs.abort_remote("enough")
    loop.settle()
    kept = sizes(service, loop)
    assert len(kept) == 3 and max(kept) < 1000


def test_the_same_track_joins_the_flight_and_another_does_not(loop: FastLoop, service: Service) -> None:
    answers = [loop.run(fly_track(service, track_call(service, text, wait=False))) for text in (LONG, LONG, LINE)]
    assert [answer.headers["Location"] for answer in answers] == ["/jobs/1", "/jobs/1", "/jobs/2"]


def test_the_limit_of_jobs_holds_for_tracks_too(loop: FastLoop, service: Service) -> None:
    service.settings = replace(service.settings, max_jobs=0)
    with pytest.raises(TooManyRequests):
        loop.run(fly_track(service, track_call(service)))


def test_hanging_up_holds_where_that_is_set(loop: FastLoop, service: Service) -> None:
    service.host.endings.on_disconnect = Policy.HOLD
    waiting = loop.create_task(fly_track(service, track_call(service)))
    loop.settle()
    waiting.cancel()
    loop.settle()
    assert [job.verb for job in service.host.jobs.all()] == ["/mission/fly-track", "hold after /mission/fly-track"]
    assert service.host.audit.entries[-1].outcome == "client_gone"
