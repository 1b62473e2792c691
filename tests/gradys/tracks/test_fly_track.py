"""POST /mission/fly-track is a job as all verbs: limit, hang-up, and trail are shared."""

from __future__ import annotations

import asyncio
import ipaddress
import json
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_gradys.http import GradysHandlers
from mavproxy_gradys.service import Gradys
from mavproxy_gradys.tracks.request import TrackRequest
from mavproxy_uavapi.core.errors import Invalid, TooManyRequests
from mavproxy_uavapi.core.vehicle.endings import Policy
from mavproxy_uavapi.http.auditing import audited
from mavproxy_uavapi.http.call import Call, Service
from mavproxy_uavapi.http.caller import CALLER, Caller
from mavproxy_uavapi.http.jobs import list_jobs
from mavproxy_uavapi.http.requests import Empty
from mavproxy_uavapi.http.router import Match
from mavproxy_uavapi.settings import ApiModuleSettings

LINE = "(1, -158400810, -479266420, 584090, 0, 65535, 0, 0, 3, 10)\n"
LONG = LINE + "# a comment\n" * 10_000


@pytest.fixture
def service(host: Any, telemetry: Any, monkeypatch: pytest.MonkeyPatch) -> Service:
    """Before vehicle 10, which flies in GUIDED."""

    async def at_once(call: Callable[..., Any], *args: Any) -> Any:
        return call(*args)

    monkeypatch.setattr(asyncio, "to_thread", at_once)
    telemetry.send("heartbeat", armed=True, mode="GUIDED", system_status=4)
    telemetry.send("extended_sys_state", landed_state=2)
    return Service(host, ApiModuleSettings(environ={}).snapshot())


class PassedRequest(dict[Any, Any]):
    """A request that has passed the door, as far as these tests ask it."""


def call_of(service: Service, text: str = LONG, **query: str) -> Call:
    request: Any = PassedRequest({CALLER: Caller(ipaddress.ip_address("10.0.0.9"))})
    request.path, request.remote = "/mission/fly-track", "10.0.0.9"
    request.headers, request.query, request.transport = {}, query, None
    return Call(service, request, TrackRequest(track=text), Match("/mission/fly-track"))


def requested(service: Service, call: Call) -> Any:
    return audited(call, GradysHandlers(Gradys(service.host)).fly_track)


def sizes(service: Service, loop: Any) -> list[int]:
    """Bytes of what the trail and the list of jobs tell."""
    jobs = loop.run(list_jobs(Call(service, SimpleNamespace(path="/jobs"), Empty())))  # type: ignore[arg-type]
    return [len(json.dumps(jobs)), *(len(json.dumps(entry.request)) for entry in service.host.audit.entries)]


def test_neither_job_nor_trail_keeps_the_tracks_text(loop: Any, service: Service) -> None:
    assert loop.run(requested(service, call_of(service, wait="false"))).status == 202
    with pytest.raises(Invalid):
        loop.run(requested(service, call_of(service, LONG + "nonsense")))
    service.host.jobs.on_ended.clear()
    service.host.jobs.abort_remote("enough")
    loop.settle()
    found = sizes(service, loop)
    assert len(found) == 3 and max(found) < 1000


def test_the_same_track_joins_the_flight_and_another_does_not(loop: Any, service: Service) -> None:
    answers = [loop.run(requested(service, call_of(service, text, wait="false"))) for text in (LONG, LONG, LINE)]
    assert [answer.headers["Location"] for answer in answers] == ["/jobs/1", "/jobs/1", "/jobs/2"]


def test_the_limit_of_jobs_holds_for_tracks_too(loop: Any, service: Service) -> None:
    service.settings = replace(service.settings, max_jobs=0)
    with pytest.raises(TooManyRequests):
        loop.run(requested(service, call_of(service)))


def test_hanging_up_holds_where_that_is_set(loop: Any, service: Service) -> None:
    service.host.endings.on_disconnect = Policy.HOLD
    waiting = loop.create_task(requested(service, call_of(service)))
    loop.settle()
    waiting.cancel()
    loop.settle()
    assert [job.verb for job in service.host.jobs.all()] == ["/mission/fly-track", "hold after /mission/fly-track"]
    assert service.host.audit.entries[-1].outcome == "client_gone"
