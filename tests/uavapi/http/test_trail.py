from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.audit import counted
from mavproxy_uavapi.http.requests import Empty
from mavproxy_uavapi.http.routes import POST, Route

FAR = {"x": 500, "y": 0, "z": -20}


def test_trace_tells_what_was_asked_what_was_sent_and_how_it_ended(flying: Any, service: Any, api: Any) -> None:
    api.get("/command/set_ground_speed?new_v=5")
    (entry,) = service.audit.entries
    assert (entry.verb, entry.request, entry.system) == ("/command/set_ground_speed", {"new_v": 5}, 1)
    assert (entry.outcome, entry.detail) == ("ok", "Ground speed set to 5m/s")


def test_refusal_leaves_a_trace_too(drone: Any, service: Any, api: Any) -> None:
    api.get("/command/takeoff")
    (entry,) = service.audit.entries
    assert (entry.outcome, entry.sent) == ("not_armed", ())


def test_job_that_is_not_waited_for_leaves_its_trace_when_it_has_ended(
    flying: Any, service: Any, api: Any, loop: Any
) -> None:
    accepted = api.post("/movement/go_to_ned_wait?wait=false", FAR)
    loop.pass_time(1.0)
    assert not service.audit.entries
    loop.run(api.ask("DELETE", accepted.headers["Location"]))
    of_delete, of_job = sorted(service.audit.entries, key=lambda entry: entry.verb)
    assert of_delete.verb.startswith("/jobs/")
    assert (of_job.verb, of_job.outcome) == ("/movement/go_to_ned_wait", "aborted")
    assert of_job.seconds >= 1.0


def test_vehicle_is_told_what_follows_before_the_trace_of_its_job_is_left(
    flying: Any, service: Any, api: Any, loop: Any, link: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    accepted = api.post("/movement/go_to_ned_wait?wait=false", FAR)
    loop.pass_time(1.0)
    sent, sent_before_trace = len(link.sent), []
    monkeypatch.setattr(service.audit, "add", lambda _: sent_before_trace.append(len(link.sent) - sent))
    loop.run(api.ask("DELETE", accepted.headers["Location"]))
    assert sent_before_trace[0] > 0


def test_job_that_succeeds_without_its_client_is_traced_with_its_result(
    flying: Any, service: Any, api: Any, loop: Any
) -> None:
    api.get("/command/brake?wait=false")
    api.until(lambda: service.audit.entries)
    (entry,) = service.audit.entries
    assert entry.outcome == "ok"
    assert "Copter braking" in entry.detail


def test_route_without_a_trail_leaves_no_trace(service: Any, api: Any, host: Any) -> None:
    async def take(_call: Any) -> dict[str, Any]:
        return {}

    for trail in (True, False):
        host.extensions["/take"] = Route("/take", take, Empty, POST, trail=trail)
        for _ in range(3):
            assert api.post("/take").status == 200
        assert len(service.audit.entries) == 3


def test_setpoints_are_counted_rather_than_listed() -> None:
    names = ["COMMAND_LONG", "COMMAND_LONG", *["SET_POSITION_TARGET_LOCAL_NED"] * 240, "COMMAND_LONG"]
    told = ("COMMAND_LONG", "COMMAND_LONG", "SET_POSITION_TARGET_LOCAL_NED x240", "COMMAND_LONG")
    assert counted(names) == told
    assert counted([]) == ()
