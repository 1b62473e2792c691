from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.http.callers.call import Service
from tests.support.drone import Drone
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

mavlink = mavutil.mavlink
ENVELOPE = {"device": "uav", "id": "1"}

# path, parameters, result text; each from the ground and again armed in the air, as `where` says
ROWS = [
    ("arm", {}, "Armed vehicle", "ground"),
    ("disarm", {}, "Disarmed vehicle", "armed"),
    ("disarm", {"force": "true"}, "Disarmed vehicle", "air"),
    ("takeoff", {"alt": "10"}, "Takeoff successful! Vehicle at 10 meters", "armed"),
    ("takeoff", {"alt": "2.5"}, "Takeoff successful! Vehicle at 2.5 meters", "armed"),
    ("takeoff", {}, "Takeoff successful! Vehicle at 15 meters", "armed"),
    ("land", {}, "Landed at home successfully", "air"),
    ("rtl", {}, "Landed at home successfully", "air"),
    ("brake", {}, "Copter braking. Use /command/guided to enable movement commands again", "air"),
    ("guided", {}, "Copter in GUIDED mode", "ground"),
    ("set_mode", {"mode": "LOITER"}, "Mode LOITER", "air"),
    ("set_air_speed", {"new_v": "3.5"}, "Air speed set to 3.5m/s", "air"),
    ("set_ground_speed", {"new_v": "5"}, "Ground speed set to 5m/s", "air"),
    ("set_climb_speed", {"new_v": "2"}, "Climb speed set to 2m/s", "air"),
    ("set_descent_speed", {"new_v": "1"}, "Descent speed set to 1m/s", "air"),
    ("set_sim_speedup", {"sim_factor": "4"}, "Simulation speedup set to 4x", "ground"),
    ("set_sim_speedup", {"sim_factor": "2.5"}, "Simulation speedup set to 2.5x", "ground"),
    ("set_home", {}, "Home location set successfully!", "ground"),
]


@pytest.fixture(params=ROWS, ids=lambda row: f"{row[0]}{row[1] or ''}")
def row(request: pytest.FixtureRequest, loop: FastLoop, drone: Drone) -> Any:
    path, parameters, result, where = request.param
    if where == "air":
        drone.fly()
    elif where == "armed":
        drone.mode, drone.armed = "GUIDED", True
    loop.pass_time(0.3)
    return f"/command/{path}", parameters, {**ENVELOPE, "result": result}


@pytest.mark.parametrize("slash", ["", "/"])
def test_get_with_and_without_a_trailing_slash(row: Any, api: Api, slash: str) -> None:
    path, parameters, body = row
    answer = api.get(path + slash, params=parameters)
    assert (answer.status, answer.body) == (200, body)
    assert answer.headers["Content-Type"].startswith("application/json")


def post_query(api: Api, path: str, parameters: dict[str, str]) -> Any:
    return api.post(path, params=parameters)


def post_json(api: Api, path: str, parameters: dict[str, str]) -> Any:
    import json

    values = {}
    for name, value in parameters.items():
        try:
            values[name] = json.loads(value)
        except ValueError:
            values[name] = value
    return api.post(path, values)


def post_form(api: Api, path: str, parameters: dict[str, str]) -> Any:
    return api.post(path + "/", data=parameters)


@pytest.mark.matrix
@pytest.mark.parametrize("ask", [post_query, post_json, post_form])
def test_post_takes_the_same_parameters(row: Any, api: Api, ask: Any) -> None:
    path, parameters, body = row
    answer = ask(api, path, parameters)
    assert (answer.status, answer.body) == (200, body)


@pytest.mark.parametrize(
    ("path", "parameters"),
    [
        ("takeoff", {"alt": "0"}),
        ("takeoff", {"alt": "-5"}),
        ("takeoff", {"alt": "1000.1"}),
        ("takeoff", {"alt": "nan"}),
        ("takeoff", {"alt": "inf"}),
        ("takeoff", {"alt": "1e400"}),
        ("takeoff", {"alt": "high"}),
        ("takeoff", {"alt": "10", "timeout": "0"}),
        ("takeoff", {"alt": "10", "timeout": "nan"}),
        ("set_ground_speed", {"new_v": "-40"}),
        ("set_ground_speed", {"new_v": "51"}),
        ("set_ground_speed", {}),
        ("set_air_speed", {"new_v": "NaN"}),
        ("set_climb_speed", {"new_v": "Infinity"}),
        ("set_descent_speed", {"new_v": ""}),
        ("set_sim_speedup", {"sim_factor": "0"}),
        ("set_sim_speedup", {"sim_factor": "0.2"}),
        ("set_sim_speedup", {}),
        ("set_mode", {"mode": "HOVERING"}),
        ("set_mode", {"mode": ""}),
        ("set_mode", {}),
        ("disarm", {"force": "perhaps"}),
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_value_that_is_out_of_range_is_422_and_nothing_is_sent(
    api: Api, loop: FastLoop, drone: Drone, method: str, path: str, parameters: dict[str, str]
) -> None:
    drone.mode, drone.armed = "GUIDED", True
    loop.pass_time(0.3)
    answer = loop.run(api.ask(method, f"/command/{path}", params=parameters))
    assert answer.status == 422
    assert answer.body["code"] == "invalid"
    assert isinstance(answer.body["detail"], list)
    assert set(answer.body["detail"][0]) == {"loc", "msg", "type"}
    assert drone.received == []


def test_speed_of_zero_is_the_autopilots_to_refuse_and_is_not_remembered(
    api: Api, loop: FastLoop, flying: Drone
) -> None:
    flying.answers[mavlink.MAV_CMD_DO_CHANGE_SPEED] = [mavlink.MAV_RESULT_DENIED]
    answer = api.get("/command/set_ground_speed", params={"new_v": "0"})
    assert (answer.status, answer.body["code"]) == (500, "rejected")


def test_disarmed_vehicle_remembers_a_speed_but_not_zero(
    api: Api, loop: FastLoop, drone: Drone, copter: Vehicle
) -> None:
    drone.answers[mavlink.MAV_CMD_DO_CHANGE_SPEED] = [mavlink.MAV_RESULT_DENIED]
    assert "takes effect" in api.get("/command/set_ground_speed", params={"new_v": "5"}).body["result"]
    assert api.get("/command/set_ground_speed", params={"new_v": "0"}).status == 500
    assert copter.speeds.to_send(new_kind=False) == {"ground": 5}


def test_slow_simulation_needs_a_link_that_waits(api: Api, loop: FastLoop, drone: Drone, host: Host) -> None:
    answer = api.get("/command/set_sim_speedup", params={"sim_factor": "0.1"})
    assert answer.status == 422
    assert "set link_timeout to 12.5 s" in answer.body["detail"][0]["msg"]
    host.link_watch.timeout = 12.5
    assert api.get("/command/set_sim_speedup", params={"sim_factor": "0.1"}).status == 200


def test_empty_post_means_the_defaults(api: Api, loop: FastLoop, drone: Drone) -> None:
    drone.mode, drone.armed = "GUIDED", True
    loop.pass_time(0.3)
    assert api.post("/command/takeoff").body["result"] == "Takeoff successful! Vehicle at 15 meters"


def test_refusal_is_500_with_the_ack_and_the_texts(api: Api, drone: Drone) -> None:
    number = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    drone.answers[number], drone.says[number] = [mavlink.MAV_RESULT_FAILED], ["Arm: no", "Arm: really"]
    answer = api.get("/command/arm")
    assert answer.status == 500
    assert answer.body == {
        "detail": "the vehicle refused COMPONENT_ARM_DISARM (MAV_RESULT_FAILED): Arm: no; Arm: really",
        "code": "rejected",
        "ack": "MAV_RESULT_FAILED",
        "statustext": ["Arm: no", "Arm: really"],
    }


def test_pilots_mode_change_is_409(api: Api, loop: FastLoop, flying: Drone) -> None:
    request = api.begin("GET", "/command/land")
    loop.pass_time(2.0)
    flying.pilot("LOITER")
    answer = loop.run(request)
    assert (answer.status, answer.body["code"]) == (409, "mode_changed")
    assert "LOITER" in answer.body["detail"]


def test_disarm_in_flight_is_409_busy(api: Api, flying: Drone) -> None:
    answer = api.get("/command/disarm")
    assert (answer.status, answer.body["code"]) == (409, "busy")


def test_takeoff_disarmed_is_409_not_armed(api: Api, loop: FastLoop, drone: Drone) -> None:
    drone.pilot("GUIDED")
    answer = api.get("/command/takeoff")
    assert (answer.status, answer.body["code"]) == (409, "not_armed")


def test_no_ack_is_504(api: Api, flying: Drone) -> None:
    flying.answers[mavlink.MAV_CMD_DO_CHANGE_SPEED] = [None]
    answer = api.get("/command/set_ground_speed", params={"new_v": "3"})
    assert (answer.status, answer.body["code"]) == (504, "timeout")


def test_before_the_first_vehicle_is_503_no_vehicle(api: Api) -> None:
    answer = api.get("/command/arm")
    assert (answer.status, answer.body) == (503, {"detail": "no vehicle on the link yet", "code": "no_vehicle"})


def test_lost_link_is_503_link_lost(api: Api, loop: FastLoop, drone: Drone) -> None:
    drone.power_off()
    loop.pass_time(6.0)
    answer = api.get("/command/arm")
    assert (answer.status, answer.body["code"]) == (503, "link_lost")
    assert drone.received == []


@pytest.mark.parametrize("path", ["takeoff", "land", "rtl", "brake"])
def test_verb_that_the_type_does_not_have_is_404_not_supported(
    api: Api, loop: FastLoop, host: Host, path: str
) -> None:
    host.bridge.feed(message_of("heartbeat", type=mavlink.MAV_TYPE_ANTENNA_TRACKER))
    host.bridge.turn()
    answer = api.get(f"/command/{path}/")
    assert (answer.status, answer.body["code"]) == (404, "not_supported")
    assert answer.body["detail"].endswith(f"does not have /command/{path}")


def test_newer_command_notifies_the_older_client_at_once(api: Api, loop: FastLoop, flying: Drone) -> None:
    older = api.begin("GET", "/command/land")
    loop.pass_time(2.0)
    newer = api.get("/command/brake")
    answer = loop.run(older)
    assert newer.status == 200
    assert (answer.status, answer.body) == (
        409,
        {"detail": "/command/land was superseded by /command/brake", "code": "superseded"},
    )


def test_identical_calls_share_one_landing(api: Api, loop: FastLoop, flying: Drone) -> None:
    requests = [api.begin("GET", "/command/land"), api.begin("GET", "/command/land/")]
    assert [loop.run(request).status for request in requests] == [200, 200]
    assert len(flying.commands(mavlink.MAV_CMD_DO_SET_MODE)) == 1


@pytest.mark.parametrize(("path", "goes_on"), [("/command/land", True), ("/command/takeoff?alt=100", False)])
def test_client_that_hangs_up_ends_its_takeoff_but_not_its_landing(
    api: Api, loop: FastLoop, drone: Drone, service: Service, path: str, goes_on: bool
) -> None:
    if goes_on:
        drone.fly()
    else:
        drone.mode, drone.armed = "GUIDED", True
    loop.pass_time(0.3)
    request = api.begin("GET", path)
    api.until(service.host.jobs.running)
    loop.pass_time(2.0)
    request.cancel()
    if goes_on:
        loop.pass_time(2.0)
        assert service.host.jobs.running()
    else:
        api.until(lambda: not service.host.jobs.running())
