from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.callers.call import Call, Service
from mavproxy_uavapi.http.callers.caller import CALLER, Caller
from mavproxy_uavapi.http.contract.requests import Blocking, Empty, Servo
from mavproxy_uavapi.http.contract.route import FLY, POST, Route
from mavproxy_uavapi.http.wire.bodies import BODY_TIMEOUT, in_time
from mavproxy_uavapi.scripts.on_exit import after_death
from mavproxy_uavapi.scripts.runs import Run
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


def test_parameters_are_those_of_the_routes_model(service: Service) -> None:
    call = Call(service, None, Blocking(timeout=3.0))  # type: ignore[arg-type]
    assert call.params(Blocking).timeout == 3.0
    with pytest.raises(AssertionError):
        call.params(Servo)


def test_vehicle_is_the_one_of_the_settings(make_drone: Callable[..., Drone], service: Service) -> None:
    make_drone(1)
    make_drone(2)
    service.settings = ApiModuleSettings({"sysid": 2}).snapshot()
    call = Call(service, {CALLER: Caller(None)}, Empty())  # type: ignore[arg-type]
    assert call.vehicle.state.system == call.known_vehicle.state.system == 2
    assert call.answer("done")["id"] == "2"


def test_command_and_telemetry_follow_mavproxys_current_vehicle(
    make_drone: Callable[..., Drone], host: Host, api: Api, loop: FastLoop
) -> None:
    first, second = make_drone(1), make_drone(2)
    host.registry.current = 2
    assert api.get("/command/guided").body["id"] == "2"
    assert api.get("/telemetry/gps").body["id"] == "2"
    assert first.orders() == []
    assert second.mode == "GUIDED"


@pytest.mark.parametrize("raw", [("application/octet-stream",), ()])
def test_body_that_does_not_arrive_is_400(api: Api, loop: FastLoop, host: Host, raw: tuple[str, ...]) -> None:
    async def take(call: Any) -> dict[str, Any]:
        return {"body": str(await in_time(call.request.read()))}

    async def body() -> Any:
        yield b"{"
        await asyncio.sleep(2 * BODY_TIMEOUT)

    host.extensions["/take"] = Route("/take", take, Empty, FLY, POST, raw=raw)
    began = loop.time()
    answer = api.post("/take", data=body())
    assert (answer.status, answer.body["detail"]) == (400, "the body did not arrive within 10 s")
    assert loop.time() - began < BODY_TIMEOUT + 1


URGENT = ["/command/land", "/command/rtl", "/command/brake", "/command/disarm?force=true", "/movement/stop"]


@pytest.mark.parametrize("path", URGENT)
def test_no_limit_of_jobs_keeps_a_vehicle_from_being_stopped(
    flying: Drone, service: Service, api: Api, loop: FastLoop, path: str
) -> None:
    service.settings = ApiModuleSettings({"max_jobs": 1}, environ={}).snapshot()
    waiting = api.begin("POST", "/movement/go_to_ned_wait", json={"x": 500, "y": 0, "z": -20})
    api.until(service.host.jobs.running)
    assert api.get("/command/set_ground_speed?new_v=5").body["code"] == "too_many_requests"
    assert loop.run(api.ask("GET", path, headers={"Prefer": "respond-async"})).status == 202
    waiting.cancel()


GO = {"x": 500, "y": 0, "z": -20}
SESSION = "UAV_API_1_a"


@pytest.mark.parametrize("waits", [True, False], ids=["waits", "does not wait"])
@pytest.mark.parametrize("script_first", [True, False], ids=["script first", "human first"])
def test_dead_script_does_not_end_what_a_human_requested_too(
    flying: Drone, service: Service, api: Api, loop: FastLoop, waits: bool, script_first: bool
) -> None:
    asking = [None]

    async def session_of(_peer: Any) -> str | None:
        return asking[0]

    def ask(asker: str | None, path: str) -> asyncio.Task[Any]:
        asking[0] = asker
        task = api.begin("POST", f"/movement/go_to_ned_wait{path}", json=GO)
        loop.pass_time(0.3)
        return task

    service.scripts.session_of = session_of
    human = "" if waits else "?wait=false"
    askers = [(SESSION, "?wait=false"), (None, human)]
    tasks = [ask(*asker) for asker in (askers if script_first else askers[::-1])]
    [job] = service.host.jobs.running()
    run = Run(Path("r"), "a.py", [], SESSION, 1, 8000, 0.0, Path("o"), Path("e"), 1.0)
    done = loop.run(after_death(service.host, 1, run, []))
    assert done == "left alone: /movement/go_to_ned_wait flies the vehicle"
    assert job.running
    for task in tasks:
        task.cancel()
    loop.pass_time(0.3)
    assert job.running is not waits  # whoever waits ends it by hanging up


def test_client_that_does_not_wait_keeps_the_job_of_one_that_does(
    flying: Drone, service: Service, api: Api, loop: FastLoop
) -> None:
    waiting = api.begin("POST", "/movement/go_to_ned_wait", json=GO)
    api.until(service.host.jobs.running)
    assert api.post("/movement/go_to_ned_wait?wait=false", GO).status == 202
    waiting.cancel()
    loop.pass_time(0.3)
    [job] = service.host.jobs.running()
    assert job.running
