from __future__ import annotations

from collections.abc import Callable

import pytest

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


@pytest.fixture
def two(make_drone: Callable[..., Drone]) -> tuple[Drone, Drone]:
    """Two copters: the first stands, the second flies."""
    first, second = make_drone(1), make_drone(2)
    second.fly()
    return first, second


def test_each_vehicle_is_listed_with_its_state(two: tuple[Drone, Drone], api: Api, loop: FastLoop) -> None:
    loop.settle()
    answer = api.get("/vehicles").body
    assert [(row["id"], row["type"], row["armed"], row["current"]) for row in answer["vehicles"]] == [
        (1, "copter", False, True),
        (2, "copter", True, False),
    ]
    second = answer["vehicles"][1]
    assert second["mode"] == "GUIDED"
    assert second["link"]["alive"]
    assert second["position"]["relative_alt"] == pytest.approx(20.0)
    assert second["commanded_by"] is None


def test_the_list_says_who_commands(two: tuple[Drone, Drone], api: Api, loop: FastLoop) -> None:
    loop.settle()
    flight = api.begin("POST", "/vehicles/2/movement/go_to_ned_wait", json={"x": 500, "y": 0, "z": -20})
    api.until(lambda: api.get("/vehicles/2").body["commanded_by"])
    commander = api.get("/vehicles/2").body["commanded_by"]
    assert (commander["verb"], commander["client"]) == ("/movement/go_to_ned_wait", "127.0.0.1")
    assert api.get("/vehicles/1").body["commanded_by"] is None
    flight.cancel()


def test_path_of_a_vehicle_means_that_vehicle(two: tuple[Drone, Drone], api: Api, loop: FastLoop) -> None:
    loop.settle()
    answer = api.get("/vehicles/2/telemetry/gps")
    assert (answer.status, answer.body["id"]) == (200, "2")
    assert api.get("/telemetry/gps").body["id"] == "1"
    first, second = two
    assert api.get("/vehicles/1/command/arm/").status == 200
    assert (first.armed, second.mode) == (True, "GUIDED")
    assert "COMMAND_LONG" not in {message.get_type() for message in second.received}


@pytest.mark.parametrize(
    "path",
    ["/vehicles/2", "/vehicles/2/telemetry/gps", "/vehicles/2/command/arm", "/telemetry/stream?view=gps&vehicles=2"],
)
def test_vehicle_that_a_call_names_is_watched_from_now_on(
    two: tuple[Drone, Drone], api: Api, loop: FastLoop, host: Host, path: str
) -> None:
    api.get("/vehicles")
    assert [host.registry.is_used(system) for system in (1, 2)] == [True, False]
    call = api.begin("GET", path)
    loop.pass_time(0.1)
    assert host.registry.is_used(2)
    call.cancel()


def test_a_vehicle_that_was_not_heard_is_503(two: tuple[Drone, Drone], api: Api) -> None:
    answer = api.get("/vehicles/9/command/arm")
    assert (answer.status, answer.body["code"]) == (503, "no_vehicle")
    assert api.get("/vehicles/9").status == 404


def test_number_too_long_for_python_is_a_vehicle_that_was_not_heard(two: tuple[Drone, Drone], api: Api) -> None:
    answer = api.get(f"/vehicles/{'1' * 5000}")
    assert (answer.status, answer.body["code"]) == (404, "not_found")


@pytest.mark.parametrize("path", ["/vehicles/0/command/arm", "/vehicles/256/telemetry/gps", "/vehicles/x/jobs"])
def test_what_is_no_system_id_is_404(two: tuple[Drone, Drone], api: Api, path: str) -> None:
    assert api.get(path).status == 404


def test_a_page_may_not_command_by_the_path_of_a_vehicle(two: tuple[Drone, Drone], api: Api) -> None:
    answer = api.get("/vehicles/1/command/arm", headers={"User-Agent": "Mozilla/5.0 (X11) Firefox/127.0"})
    assert (answer.status, answer.body["code"]) == (403, "forbidden")
    assert not two[0].armed


def test_jobs_of_a_vehicle_are_its_own(two: tuple[Drone, Drone], api: Api, loop: FastLoop) -> None:
    loop.settle()
    api.get("/vehicles/1/command/arm")
    api.get("/vehicles/2/command/set_mode?mode=BRAKE")
    one, both = api.get("/vehicles/2/jobs").body["jobs"], api.get("/jobs").body["jobs"]
    assert [job["verb"] for job in one] == ["/command/set_mode"]
    assert len(both) == 2
    of_the_other = next(job["job"] for job in both if job["verb"] == "/command/arm")
    assert api.get(f"/vehicles/1/jobs/{of_the_other}").status == 200
    assert api.get(f"/vehicles/2/jobs/{of_the_other}").status == 404
    assert loop.run(api.ask("DELETE", f"/vehicles/2/jobs/{of_the_other}")).status == 404


def test_limit_of_jobs_counts_for_each_vehicle(
    two: tuple[Drone, Drone], api: Api, loop: FastLoop, service: Service
) -> None:
    service.settings = ApiModuleSettings({"max_jobs": 1}, environ={}).snapshot()
    loop.settle()
    first, second = two
    first.fly()
    loop.settle()
    flights = [
        api.begin("POST", f"/vehicles/{system}/movement/go_to_ned_wait", json={"x": 500, "y": 0, "z": -20})
        for system in (1, 2)
    ]
    api.until(lambda: len(service.host.jobs.running()) == 2)
    assert api.get("/vehicles/2/movement/set_heading?heading=90").status == 429
    assert api.get("/vehicles/2/movement/stop").status == 200
    for flight in flights:
        flight.cancel()


def test_rate_counts_for_each_vehicle(two: tuple[Drone, Drone], api: Api, service: Service) -> None:
    service.settings = ApiModuleSettings({"max_rate": 10}, environ={}).snapshot()
    statuses = [api.get("/vehicles/1/telemetry/status").status for _ in range(40)]
    assert 429 in statuses
    assert api.get("/vehicles/2/telemetry/status").status == 200
    # What was never heard is no vehicle: no caller asks more often by making up numbers.
    assert 429 in [api.get(f"/vehicles/{system}/telemetry/status").status for system in range(100, 200)]
