from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink import mavutil

from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

mavlink = mavutil.mavlink
NED = {"x": 3, "y": 4.5, "z": -15}
GPS = {"lat": -35.0001, "long": 149.0, "alt": 12.5}
BODY = {"front": 3, "right": -2, "down": 1}

ROWS = [
    ("POST", "go_to_gps", GPS, "Going to coord (-35.0001, 149.0, 12.5)"),
    ("POST", "go_to_gps_wait", GPS, "Arrived at coord (-35.0001, 149.0, 12.5)"),
    ("POST", "go_to_ned", NED, "Going to NED coord (3, 4.5, -15)"),
    ("POST", "go_to_ned_wait", NED, "Arrived at NED coord (3, 4.5, -15)"),
    ("POST", "drive", {"x": 3, "y": 4, "z": 0}, "Copter is driving"),
    ("POST", "drive_wait", {"x": 3, "y": 4, "z": -1}, "Copter arrived at (13.0, 24.0, -31.0)"),
    ("POST", "drive_body", BODY, "Copter is driving"),
    ("POST", "drive_body_wait", BODY, "Copter arrived at (12.0, 23.0, -29.0)"),
    ("POST", "travel_at_ned", {"vx": 1, "vy": -2.5, "vz": 0}, "Travelling at NED velocity (1, -2.5, 0)"),
    ("POST", "travel_at_ned", {"vx": 1, "vy": 0, "vz": 0, "duration": 4}, "Travelling at NED velocity (1, 0, 0)"),
    ("GET", "set_heading", {"heading": 359}, "Heading set to 359 degrees"),
    ("GET", "set_heading", {"heading": 0.5}, "Heading set to 0.5 degrees"),
    ("GET", "set_yaw_rate", {"yaw_rate": -20}, "Yaw rate set to -20 deg/s"),
    ("GET", "stop", {}, "Copter has stopped"),
    ("GET", "resume", {}, "Copter has resumed"),
]


@pytest.fixture
def airborne(loop: FastLoop, drone: Drone) -> Drone:
    """The drone in the air at (10, 20, -30), heading east."""
    drone.yaw = math.radians(90)
    drone.fly(at=(10.0, 20.0, -30.0))
    loop.settle()
    return drone


@pytest.mark.parametrize("slash", ["", "/"])
@pytest.mark.parametrize(("method", "path", "values", "result"), ROWS, ids=[f"{row[1]}{row[2]}" for row in ROWS])
def test_every_row_of_the_contract(
    airborne: Drone, api: Api, method: str, path: str, values: dict[str, Any], result: str, slash: str
) -> None:
    path = f"/movement/{path}{slash}"
    answer = api.post(path, values) if method == "POST" else api.get(path, params=values)
    assert (answer.status, answer.body) == (200, {"device": "uav", "id": "1", "result": result})


def one_setpoint(drone: Drone) -> Any:
    (setpoint,) = drone.setpoints()
    return setpoint


@pytest.mark.parametrize(
    ("path", "values", "target"),
    [
        ("go_to_ned", NED, (3, 4.5, -15)),
        ("drive", {"x": 3, "y": 4, "z": -1}, (13, 24, -31)),
        ("drive_body", BODY, (12, 23, -29)),
    ],
)
def test_position_is_sent_in_ned(
    airborne: Drone, api: Api, path: str, values: dict[str, Any], target: tuple[float, float, float]
) -> None:
    api.post(f"/movement/{path}", values)
    setpoint = one_setpoint(airborne)
    assert (setpoint.x, setpoint.y, setpoint.z) == pytest.approx(target)
    assert setpoint.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE


def test_gps_target_is_sent_above_home(airborne: Drone, api: Api) -> None:
    api.post("/movement/go_to_gps", GPS)
    setpoint = one_setpoint(airborne)
    assert (setpoint.lat_int, setpoint.lon_int, setpoint.alt) == (-350001000, 1490000000, 12.5)
    assert setpoint.coordinate_frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT


@pytest.mark.parametrize(
    ("path", "values", "yaw"),
    [
        ("go_to_ned", {"x": 10, "y": 50, "z": -30}, 90),
        ("drive", {"x": -5, "y": 0, "z": 0}, 180),
        ("drive_body", {"front": 5, "right": 0}, 90),
        ("travel_at_ned", {"vx": 1, "vy": 1, "vz": 0}, 45),
    ],
)
def test_look_at_target_turns_along_the_way(
    airborne: Drone, api: Api, path: str, values: dict[str, Any], yaw: float
) -> None:
    api.post(f"/movement/{path}", {**values, "look_at_target": True})
    setpoint = one_setpoint(airborne)
    assert not setpoint.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    assert math.degrees(setpoint.yaw) == pytest.approx(yaw, abs=0.1)


@pytest.mark.parametrize(
    ("path", "values"),
    [("go_to_gps", GPS), ("go_to_ned", NED), ("drive_body", BODY), ("travel_at_ned", {"vx": 1, "vy": 1, "vz": 0})],
)
def test_heading_is_where_it_points_all_the_way(airborne: Drone, api: Api, path: str, values: dict[str, Any]) -> None:
    api.post(f"/movement/{path}", {**values, "heading": 350, "look_at_target": True})
    setpoint = one_setpoint(airborne)
    assert not setpoint.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    assert math.degrees(setpoint.yaw) == pytest.approx(350)


def test_body_velocity_is_turned_by_the_heading(airborne: Drone, api: Api) -> None:
    answer = api.post("/movement/travel_at_body", {"front": 2, "right": 1, "down": 0.5})
    setpoint = one_setpoint(airborne)
    assert answer.body["result"] == "Travelling at body velocity (2, 1, 0.5)"
    assert (setpoint.vx, setpoint.vy, setpoint.vz) == pytest.approx((-1, 2, 0.5), abs=0.01)  # it points east


def test_duration_keeps_travelling_then_stops(airborne: Drone, api: Api) -> None:
    api.post("/movement/travel_at_ned", {"vx": 1, "vy": 0, "vz": 0, "duration": 4})
    assert [setpoint.vx for setpoint in airborne.setpoints()] == [1, 1, 1, 1, 0]


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("go_to_gps", {**GPS, "lat": 90.1}),
        ("go_to_gps", {**GPS, "lat": 999}),
        ("go_to_gps", {**GPS, "long": -180.5}),
        ("go_to_gps", {**GPS, "alt": -1001}),
        ("go_to_gps", {**GPS, "alt": 10001}),
        ("go_to_gps", {"lat": 1, "long": 2}),
        ("go_to_gps", {**GPS, "lat": None}),
        ("go_to_gps", {**GPS, "lat": True}),
        ("go_to_gps", {**GPS, "lat": [1]}),
        ("go_to_ned", {**NED, "x": float("nan")}),
        ("go_to_ned", {**NED, "y": float("inf")}),
        ("go_to_ned", {**NED, "z": 20}),
        ("go_to_ned", {**NED, "tolerance": 0}),
        ("go_to_ned", {**NED, "look_at_target": "perhaps"}),
        ("go_to_ned_wait", {**NED, "x": 10**400}),
        ("drive", {**NED, "x": "far"}),
        ("drive", {"x": 0, "y": 0, "z": 35}),
        ("drive_body", {**BODY, "front": float("-inf")}),
        ("drive_body", {"front": 3}),
        ("travel_at_ned", {"vx": 51, "vy": 0, "vz": 0}),
        ("go_to_ned", {**NED, "heading": 360.5}),
        ("go_to_ned", {**NED, "heading": float("nan")}),
        ("travel_at_body", {"front": 1}),
        ("travel_at_body", {"front": 1, "right": -50.5}),
        ("travel_at_ned", {"vx": 1, "vy": 0, "vz": 0, "duration": 0}),
        ("travel_at_ned", {"vx": 1, "vy": 0, "vz": 0, "duration": float("inf")}),
    ],
)
def test_body_that_is_out_of_range_is_422_and_nothing_is_sent(
    airborne: Drone, api: Api, path: str, values: dict[str, Any]
) -> None:
    answer = api.post(f"/movement/{path}", values)
    assert (answer.status, answer.body["code"]) == (422, "invalid")
    assert all(set(problem) == {"loc", "msg", "type"} for problem in answer.body["detail"])
    assert answer.body["detail"][0]["loc"][0] == "body"
    assert airborne.orders() == []


@pytest.mark.parametrize(
    "query",
    ["set_heading?heading=360.5", "set_heading?heading=-1", "set_heading", "set_yaw_rate?yaw_rate=nan"],
)
def test_query_that_is_out_of_range_is_422(airborne: Drone, api: Api, query: str) -> None:
    answer = api.get(f"/movement/{query}")
    assert (answer.status, answer.body["detail"][0]["loc"][0]) == (422, "query")
    assert airborne.orders() == []


def test_every_problem_is_listed(airborne: Drone, api: Api) -> None:
    answer = api.post("/movement/go_to_gps", {"lat": 999, "long": "x"})
    assert sorted(problem["loc"][1] for problem in answer.body["detail"]) == ["alt", "lat", "long"]


def test_stale_position_is_503_and_nothing_is_sent(airborne: Drone, loop: FastLoop, api: Api) -> None:
    airborne.mute.add("LOCAL_POSITION_NED")
    loop.pass_time(4.0)
    for path, body in (("go_to_ned", NED), ("drive", NED), ("drive_body", BODY)):
        answer = api.post(f"/movement/{path}", body)
        assert (answer.status, answer.body["code"]) == (503, "stale")
    assert airborne.orders() == []


def test_movement_on_the_ground_is_409(drone: Drone, loop: FastLoop, api: Api) -> None:
    answer = api.post("/movement/drive", {"x": 1, "y": 0, "z": 0})
    assert (answer.status, answer.body["code"]) == (409, "not_armed")
    drone.mode, drone.armed = "GUIDED", True
    loop.pass_time(0.5)
    answer = api.post("/movement/drive", {"x": 1, "y": 0, "z": 0})
    assert (answer.status, answer.body["code"]) == (409, "busy")


def test_drive_that_is_requested_twice_aims_at_one_place(airborne: Drone, loop: FastLoop, api: Api) -> None:
    values = {"x": 40, "y": 0, "z": 0}
    first = api.begin("POST", "/movement/drive_wait", json=values)
    loop.pass_time(2.0)
    second = api.begin("POST", "/movement/drive_wait", json=values)
    results = [loop.run(request).body["result"] for request in (first, second)]
    assert results == ["Copter arrived at (50.0, 20.0, -30.0)"] * 2
    assert len(airborne.setpoints()) == 1


def test_pilots_mode_change_ends_a_wait_with_409_and_nothing_more_is_sent(
    airborne: Drone, loop: FastLoop, api: Api
) -> None:
    request = api.begin("POST", "/movement/go_to_ned_wait", json={"x": 300, "y": 0, "z": -20})
    loop.pass_time(3.0)
    airborne.pilot("LOITER")
    answer = loop.run(request)
    assert (answer.status, answer.body["code"]) == (409, "mode_changed")
    before = len(airborne.orders())
    loop.pass_time(10.0)
    assert len(airborne.orders()) == before


def test_telemetry_is_read_at_once_while_two_hundred_calls_wait(airborne: Drone, loop: FastLoop, api: Api) -> None:
    airborne.stuck = True
    body = {"x": 300, "y": 0, "z": -20}
    waiting = []
    for _ in range(4):  # no more at once than the listening queue holds
        waiting += [api.begin("POST", "/movement/go_to_ned_wait", json=body) for _ in range(50)]
        loop.pass_time(0.5)
    started = loop.time()
    answer = api.get("/telemetry/gps")
    assert answer.status == 200
    assert loop.time() - started < 0.3
    assert not any(request.done() for request in waiting)
    airborne.pilot("LOITER")

    async def all_of_them() -> list[int]:
        return [(await request).status for request in waiting]

    assert loop.run(all_of_them()) == [409] * 200


@pytest.mark.parametrize("wish", ["", "?on_disconnect=continue"])
def test_client_that_hangs_up_leaves_the_vehicle_flying(airborne: Drone, loop: FastLoop, api: Api, wish: str) -> None:
    going = api.begin("POST", f"/movement/go_to_ned_wait{wish}", json={"x": 500, "y": 0, "z": -30})
    loop.pass_time(1.0)
    going.cancel()
    loop.pass_time(5.0)
    one_setpoint(airborne)


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("go_to_ned_wait", {"x": 500, "y": 0, "z": -30}),
        ("travel_at_ned", {"vx": 5, "vy": 0, "vz": 0, "duration": 600}),
    ],
)
def test_client_that_wants_it_so_stops_the_vehicle_by_hanging_up(
    airborne: Drone, loop: FastLoop, api: Api, path: str, values: dict[str, Any]
) -> None:
    going = api.begin("POST", f"/movement/{path}?on_disconnect=hold", json=values)
    loop.pass_time(1.5)
    assert not going.done()
    going.cancel()
    loop.pass_time(5.0)
    last = airborne.setpoints()[-1]
    assert (last.vx, last.vy, last.vz) == (0, 0, 0)
    assert last.type_mask & mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE


def test_on_disconnect_is_continue_or_hold(airborne: Drone, api: Api) -> None:
    answer = api.post("/movement/go_to_ned?on_disconnect=land", NED)
    assert (answer.status, answer.body["detail"][0]["loc"]) == (422, ["query", "on_disconnect"])
    assert airborne.setpoints() == []
