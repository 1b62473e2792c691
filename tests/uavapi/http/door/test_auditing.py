from __future__ import annotations

import asyncio
import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.audit import COUNTED_FOR
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.text import LONGEST
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.contract.requests import Empty
from mavproxy_uavapi.http.contract.route import FLY, POST, Route
from mavproxy_uavapi.scripts.on_exit import after_death
from mavproxy_uavapi.scripts.runs import Run
from tests.support.drone import Drone
from tests.support.envelopes import FIELD
from tests.support.fake_link import FakeLink
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


def run_of(script: str) -> Run:
    return Run(Path("r"), script, [], "UAV_API_1_a", 1, 8000, 0.0, Path("o"), Path("e"), 1.0)


FAR = {"x": 500, "y": 0, "z": -20}


def test_trace_reports_what_was_requested_what_was_sent_and_how_it_ended(
    flying: Drone, service: Service, api: Api
) -> None:
    api.get("/command/set_ground_speed?new_v=5")
    (entry,) = service.host.audit.entries
    assert (entry.verb, entry.request, entry.system) == ("/command/set_ground_speed", {"new_v": 5}, 1)
    assert (entry.outcome, entry.detail) == ("ok", "Ground speed set to 5m/s")


def test_refusal_leaves_a_trace_too(drone: Drone, service: Service, api: Api) -> None:
    api.get("/command/takeoff")
    (entry,) = service.host.audit.entries
    assert (entry.outcome, entry.sent) == ("not_armed", ())


def test_job_that_is_not_waited_for_leaves_its_trace_when_it_has_ended(
    flying: Drone, service: Service, api: Api, loop: FastLoop
) -> None:
    accepted = api.post("/movement/go_to_ned_wait?wait=false", FAR)
    loop.pass_time(1.0)
    assert not service.host.audit.entries
    loop.run(api.ask("DELETE", accepted.headers["Location"]))
    of_delete, of_job = sorted(service.host.audit.entries, key=lambda entry: entry.verb)
    assert of_delete.verb.startswith("/jobs/")
    assert (of_job.verb, of_job.outcome) == ("/movement/go_to_ned_wait", "aborted")
    assert of_job.seconds >= 1.0


def test_closing_command_is_sent_before_the_trace_of_its_job_is_left(
    flying: Drone, service: Service, api: Api, loop: FastLoop, link: FakeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    accepted = api.post("/movement/go_to_ned_wait?wait=false", FAR)
    loop.pass_time(1.0)
    sent, sent_before_trace = len(link.sent), []
    monkeypatch.setattr(service.host.audit, "add", lambda _: sent_before_trace.append(len(link.sent) - sent))
    loop.run(api.ask("DELETE", accepted.headers["Location"]))
    assert sent_before_trace[0] > 0


def test_job_that_succeeds_without_its_client_is_traced_with_its_result(
    flying: Drone, service: Service, api: Api, loop: FastLoop
) -> None:
    api.get("/command/brake?wait=false")
    api.until(lambda: service.host.audit.entries)
    (entry,) = service.host.audit.entries
    assert entry.outcome == "ok"
    assert "Copter braking" in entry.detail


def test_envelope_is_in_it_by_its_hash(service: Service, api: Api, loop: FastLoop) -> None:
    body = json.dumps(FIELD).encode()
    assert loop.run(api.ask("PUT", "/envelope", data=body)).status == 200
    (entry,) = service.host.audit.entries
    assert entry.request == {"sha256": hashlib.sha256(body).hexdigest()}


def test_route_that_is_not_audited_leaves_no_trace(service: Service, api: Api, host: Host) -> None:
    async def take(_call: Any) -> dict[str, Any]:
        return {}

    for is_audited in (True, False):
        host.extensions["/take"] = Route("/take", take, Empty, FLY, POST, audited=is_audited)
        for _ in range(3):
            assert api.post("/take").status == 200
        assert len(service.host.audit.entries) == 3


# -- what a client may put into it ------------------------------------------------------------------------


def test_control_characters_of_a_client_are_spelled_out(flying: Drone, service: Service, api: Api) -> None:
    api.get("/command/set_mode?mode=%1b[2J%0aforged%e2%80%ae")
    (entry,) = service.host.audit.entries
    assert entry.request["mode"].startswith("\x1b[2J\nforged")
    assert "(mode=\\x1b[2J\\nforged\\u202e" in str(entry)
    assert str(entry).isprintable()


def test_long_values_are_cut(service: Service, api: Api) -> None:
    body = {"script_name": "a", "args": ["x" * 4096] * 100}
    for _ in range(3):
        assert api.post("/mission/execute-script", body).status == 404
    entry = service.host.audit.entries[-1]
    assert entry.request["args"][0] == "x" * LONGEST + "… (4096 characters)"
    assert entry.request["args"][-1] == "… (100 items)"
    assert len(json.dumps(asdict(entry))) < 4000


def test_what_is_done_after_a_scripts_death_leaves_a_trace(
    flying: Drone, api: Api, host: Host, loop: FastLoop
) -> None:
    api.post("/movement/go_to_ned", json={"x": 30, "y": 0, "z": -20})
    loop.run(after_death(host, 1, run_of("a.py"), []))
    entry = host.audit.entries[-1]
    assert (entry.client, entry.verb, entry.system) == ("script a.py", "hold after the death of a.py", 1)
    assert (entry.outcome, entry.detail) == ("ok", "hold is done")
    assert "SET_POSITION_TARGET_LOCAL_NED" in " ".join(entry.sent)


def test_job_of_a_task_that_a_finished_call_began_has_an_entry_of_its_own(
    flying: Drone, service: Service, api: Api, host: Host, loop: FastLoop
) -> None:
    dead: list[asyncio.Task[Any]] = []

    async def watch() -> None:
        await asyncio.sleep(5.0)
        await after_death(host, 1, run_of("a.py"), [])

    async def execute(_call: Any) -> dict[str, Any]:
        dead.append(asyncio.create_task(watch()))
        return {"result": "runs"}

    host.extensions["/execute"] = Route("/execute", execute, Empty, FLY, POST)
    api.post("/movement/go_to_ned", json={"x": 30, "y": 0, "z": -20})
    api.post("/execute")
    loop.pass_time(10.0)
    _, of_call, of_death = service.host.audit.entries
    assert (of_call.verb, of_call.sent) == ("/execute", ())
    assert of_death.sent


def test_call_that_joins_a_flight_of_the_prompt_leaves_a_trace_of_each(
    flying: Drone, service: Service, api: Api, host: Host, copter: Vehicle, loop: FastLoop
) -> None:
    async def forever(_job: Any) -> str:
        await asyncio.sleep(3.0)
        return "there"

    async def begin() -> Any:
        request = {
            "x": 500,
            "y": 0,
            "z": -20,
            "look_at_target": False,
            "heading": None,
            "tolerance": 1.0,
            "timeout": None,
        }
        return host.jobs.begin(copter, "/movement/go_to_ned_wait", request, forever)

    loop.run(begin())
    assert api.post("/movement/go_to_ned_wait", FAR).status == 200
    assert sorted(entry.client for entry in host.audit.entries) == ["127.0.0.1", "console"]


# -- who is turned away -----------------------------------------------------------------------------------


def test_callers_that_are_turned_away_are_counted_by_address_and_minute(
    service: Service, api: Api, loop: FastLoop
) -> None:
    service.settings = replace(service.settings, token="secret")
    for _ in range(50):
        assert api.get("/telemetry/gps", headers={"Authorization": "Bearer wrong"}).status == 401
        loop.pass_time(0.2)  # no more than the door answers at once
    for _ in range(3):
        assert api.get("/telemetry/gps", headers={"Origin": "http://evil.example"}).status == 403
    assert not service.host.audit.entries
    loop.pass_time(COUNTED_FOR + 1.0)
    (entry,) = service.host.audit.entries
    assert (entry.client, entry.verb, entry.outcome) == ("127.0.0.1", "refused", "refused")
    assert entry.request == {"unauthorized": 50, "forbidden": 3}
    assert entry.detail == "53 requests were refused"
    api.get("/telemetry/gps", headers={"Authorization": "Bearer wrong"})
    loop.pass_time(COUNTED_FOR + 1.0)
    assert service.host.audit.entries[-1].request == {"unauthorized": 1}


def test_command_that_is_refused_is_not_counted_as_well(
    flying: Drone, service: Service, api: Api, loop: FastLoop
) -> None:
    service.settings = replace(service.settings, max_jobs=0)
    assert api.post("/movement/go_to_ned_wait", FAR).status == 429
    loop.pass_time(COUNTED_FOR + 1.0)
    (entry,) = service.host.audit.entries
    assert (entry.verb, entry.outcome) == ("/movement/go_to_ned_wait", "too_many_requests")
