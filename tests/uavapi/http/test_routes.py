from __future__ import annotations

from dataclasses import replace

import pytest

from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.http.contract.route import Route
from mavproxy_uavapi.http.openapi import example_of
from mavproxy_uavapi.http.routes import ROUTES
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

CONTRACT = {
    "/command": "arm disarm takeoff land rtl brake guided set_mode set_air_speed set_ground_speed set_climb_speed "
    "set_descent_speed set_sim_speedup set_home",
    "/movement": "go_to_gps go_to_gps_wait go_to_ned go_to_ned_wait drive drive_wait drive_body drive_body_wait "
    "travel_at_ned travel_at_body set_heading set_yaw_rate stop resume",
    "/telemetry": "general gps gps_raw ned compass sys_status sensor_status battery_info error_info home_info "
    "attitude status message/{name} stream",
    "/peripherical": "servo_output",
}
POSTS = {
    "/movement/" + name
    for name in [
        "go_to_gps",
        "go_to_gps_wait",
        "go_to_ned",
        "go_to_ned_wait",
        "drive",
        "drive_wait",
        "drive_body",
        "drive_body_wait",
        "travel_at_ned",
        "travel_at_body",
    ]
} | {"/peripherical/servo_output"}


def test_every_path_of_the_contract_is_there() -> None:
    expected = {f"{group}/{name}" for group, names in CONTRACT.items() for name in names.split()}
    assert expected <= {route.path for route in ROUTES}


def test_no_path_is_there_twice() -> None:
    requested = [(method, route.path) for route in ROUTES for method in route.methods]
    assert len(requested) == len(set(requested))


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.path)
def test_methods_are_those_of_the_contract(route: Route) -> None:
    if route.path in POSTS:
        assert route.methods == ("POST",)
    elif route.path.startswith("/command/"):
        assert set(route.methods) == {"GET", "POST"}
    elif route.path.startswith(("/movement/", "/telemetry/")):
        assert "GET" in route.methods


JOBS = [
    route
    for route in ROUTES
    if route.job and not route.raw and "{" not in route.path and (not route.verb or Copter.has(route.verb))
]


@pytest.mark.parametrize("route", JOBS, ids=lambda route: f"{route.methods[0]} {route.path}")
def test_every_verb_can_be_called_without_waiting(flying: Drone, api: Api, loop: FastLoop, route: Route) -> None:
    api.service.settings = replace(api.service.settings, allow_raw=True)
    body = {"json": example_of(route.model)} if route.body_types(route.methods[-1]) else {}
    answer = loop.run(api.ask(route.methods[-1], f"{route.path}?wait=false", **body))
    assert answer.status == 202, answer.body
    assert answer.headers["Location"] == f"/jobs/{answer.body['job']}"
    assert api.get(answer.headers["Location"]).body["verb"] == route.path


def test_every_command_and_movement_is_a_job() -> None:
    assert {r.path for r in ROUTES if r.job} >= {
        r.path for r in ROUTES if r.path.startswith(("/command/", "/movement/"))
    }


@pytest.mark.parametrize("wait", ["maybe", "", "2"])
def test_wait_that_is_neither_true_nor_false_is_refused(flying: Drone, api: Api, loop: FastLoop, wait: str) -> None:
    answer = api.get(f"/command/brake?wait={wait}")
    assert (answer.status, answer.body["detail"][0]["loc"]) == (422, ["query", "wait"])
    assert flying.orders() == []


def test_every_action_and_model_says_what_it_is() -> None:
    assert [route.path for route in ROUTES if not (route.action.__doc__ and route.model.__doc__)] == []
