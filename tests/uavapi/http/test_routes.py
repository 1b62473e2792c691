from __future__ import annotations

import pytest

from mavproxy_uavapi.http.routes import ROUTES, Route

CONTRACT = {
    "/command": "arm disarm takeoff land rtl brake guided set_mode set_air_speed set_ground_speed set_climb_speed "
    "set_descent_speed set_sim_speedup set_home",
    "/movement": "go_to_gps go_to_gps_wait go_to_ned go_to_ned_wait drive drive_wait drive_body drive_body_wait "
    "travel_at_ned set_heading set_yaw_rate stop resume",
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
    ]
} | {"/peripherical/servo_output"}


def test_every_path_of_the_contract_is_there() -> None:
    wanted = {f"{group}/{name}" for group, names in CONTRACT.items() for name in names.split()}
    assert wanted <= {route.path for route in ROUTES}


def test_no_path_is_there_twice() -> None:
    asked = [(method, route.path) for route in ROUTES for method in route.methods]
    assert len(asked) == len(set(asked))


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.path)
def test_methods_are_those_of_the_contract(route: Route) -> None:
    if route.path in POSTS:
        assert route.methods == ("POST",)
    elif route.path.startswith("/command/"):
        assert set(route.methods) == {"GET", "POST"}
    elif route.path.startswith(("/movement/", "/telemetry/")):
        assert "GET" in route.methods


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.path)
def test_every_action_and_model_says_what_it_is(route: Route) -> None:
    assert route.action.__doc__
    assert route.model.__doc__
