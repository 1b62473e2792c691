from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.handlers.telemetry import FIRST_TIMEOUT, HOME_AGE
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

mavlink = mavutil.mavlink
POSITION = {"lat": -35.0, "lon": 149.0, "alt": 604.0}

# path, the member that holds the payload, result, and what the payload says of the drone of conftest
ROWS = [
    (
        "general",
        "info",
        "success",
        {"airspeed": 1.5, "groundspeed": 2.5, "heading": 90, "throttle": 40, "alt": 604.0},
    ),
    (
        "gps",
        "info",
        "success",
        {"position": {**POSITION, "relative_alt": 20.0}, "velocity": {"vx": 0, "vy": 0, "vz": 0}, "heading": None},
    ),
    (
        "gps_raw",
        "info",
        "success",
        {
            "position": {**POSITION, "alt": 600.0},
            "velocity": {"ground_speed": None, "speed_direction": 90.0},
            "satelites": None,
            "fix_type": 6,
        },
    ),
    (
        "ned",
        "info",
        "success",
        {"position": {"x": 0.0, "y": 0.0, "z": -20.0}, "velocity": {"vx": 0.0, "vy": 0.0, "vz": 0.0}},
    ),
    ("battery_info", "info", "success", {"voltage": 12600, "current": None, "battery_remaining": 87}),
    (
        "error_info",
        "info",
        "success",
        {"communication_drop_rate": 0, "communication_errors": 0, "autopilot_errors": []},
    ),
]
SENSORS = {
    "gyro", "accelerometer", "gps", "altitude_control", "position_control", "radio_receiver", "motor_output",
    "battery", "pre_arm_check",
}  # fmt: skip
ALL = ["general", "gps", "gps_raw", "ned", "attitude", "sys_status", "sensor_status", "battery_info", "error_info"]
MESSAGE_OF = {
    "general": "VFR_HUD",
    "gps": "GLOBAL_POSITION_INT",
    "gps_raw": "GPS_RAW_INT",
    "ned": "LOCAL_POSITION_NED",
}


@pytest.mark.parametrize("slash", ["", "/"])
@pytest.mark.parametrize(("path", "member", "result", "payload"), ROWS, ids=[row[0] for row in ROWS])
def test_every_row_of_the_contract(
    flying: Drone, api: Api, path: str, member: str, result: str, payload: dict[str, Any], slash: str
) -> None:
    answer = api.get(f"/telemetry/{path}{slash}")
    age = answer.body.pop("age_s")
    assert answer.status == 200
    assert answer.body == {"device": "uav", "id": "1", "result": result, member: payload}
    assert 0 <= age < 0.3


def test_sys_status_is_the_message(flying: Drone, api: Api) -> None:
    body = api.get("/telemetry/sys_status").body
    assert body["result"] == "success"
    assert body["status"]["mavpackettype"] == "SYS_STATUS"
    assert body["status"]["voltage_battery"] == 12600
    assert body["status"]["current_battery"] is None


def test_sensor_status_reports_each_sensors_bits(flying: Drone, api: Api, loop: FastLoop) -> None:
    flying.ready = False
    loop.pass_time(1.0)
    body = api.get("/telemetry/sensor_status/").body
    assert body["result"] == "success"
    assert set(body["status"]) == SENSORS
    assert body["status"]["gps"] == {"present": True, "enabled": True, "health": True}
    assert body["status"]["pre_arm_check"] == {"present": True, "enabled": True, "health": False}


def test_attitude_is_in_degrees(flying: Drone, api: Api, loop: FastLoop) -> None:
    flying.yaw = -1.5707963
    loop.pass_time(0.3)
    info = api.get("/telemetry/attitude").body["info"]
    assert info["roll"] == pytest.approx(10)
    assert info["yaw"] == pytest.approx(270)
    assert set(info) == {"roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"}


def test_status_reports_whether_it_can_be_flown(flying: Drone, api: Api) -> None:
    body = api.get("/telemetry/status").body
    assert (body["result"], body["id"]) == ("success", "1")
    info = body["info"]
    assert (info["vehicle_type"], info["mode"], info["armed"], info["landed_state"]) == (
        "copter", "GUIDED", True, "in_air",
    )  # fmt: skip
    assert info["link"]["alive"] is True
    assert info["ekf_ok"] is True
    assert info["why_not"] == []


def test_status_of_a_lost_link_is_reported_with_its_age(flying: Drone, api: Api, loop: FastLoop) -> None:
    flying.power_off()
    loop.pass_time(30.0)
    body = api.get("/telemetry/status").body
    assert body["info"]["link"]["alive"] is False
    assert body["age_s"] == pytest.approx(30.0, abs=0.3)


# -- ages -------------------------------------------------------------------------------------------------


def test_age_is_the_time_since_the_message_came_to_three_decimals(flying: Drone, api: Api, loop: FastLoop) -> None:
    flying.mute.add("GLOBAL_POSITION_INT")
    arrived = loop.time()
    loop.pass_time(2.0)
    answer = api.get("/telemetry/gps")
    assert answer.body["age_s"] == pytest.approx(loop.time() - arrived, abs=0.1)
    assert answer.body["age_s"] == round(answer.body["age_s"], 3) >= 2.0


@pytest.mark.parametrize("path", [path for path in ALL if path in MESSAGE_OF])
def test_old_data_is_503_stale(flying: Drone, api: Api, loop: FastLoop, path: str) -> None:
    flying.mute.add(MESSAGE_OF[path])
    loop.pass_time(5.2)
    answer = api.get(f"/telemetry/{path}")
    assert (answer.status, answer.body["code"]) == (503, "stale")
    assert f"last reported {MESSAGE_OF[path]} 5." in answer.body["detail"]


def test_client_may_ask_for_younger_or_older_data(flying: Drone, api: Api, loop: FastLoop) -> None:
    flying.mute.add("GLOBAL_POSITION_INT")
    loop.pass_time(2.0)
    assert api.get("/telemetry/gps?max_age=1").status == 503
    loop.pass_time(10.0)
    assert api.get("/telemetry/gps").status == 503
    assert api.get("/telemetry/gps?max_age=60").status == 200
    assert api.get("/telemetry/gps?max_age=nan").status == 422


def test_data_of_a_lost_link_is_stale_and_recovers(flying: Drone, api: Api, loop: FastLoop) -> None:
    flying.power_off()
    loop.pass_time(10.0)
    assert api.get("/telemetry/gps").body["code"] == "stale"
    flying.power_on()
    loop.settle()
    assert api.get("/telemetry/gps").status == 200


@pytest.mark.parametrize("path", [*ALL, "home_info", "status", "compass", "message/ATTITUDE"])
def test_before_the_first_vehicle_is_503_no_vehicle(api: Api, path: str) -> None:
    answer = api.get(f"/telemetry/{path}")
    assert (answer.status, answer.body["code"]) == (503, "no_vehicle")


def test_message_that_was_never_reported_is_requested(api: Api, loop: FastLoop, host: Host, drone: Drone) -> None:
    del host.fleet.vehicles[1].messages["VFR_HUD"]
    drone.mute.add("VFR_HUD")
    request = api.begin("GET", "/telemetry/general")
    loop.pass_time(0.5)
    (command,) = drone.commands(mavlink.MAV_CMD_REQUEST_MESSAGE)
    assert command.param1 == mavlink.MAVLINK_MSG_ID_VFR_HUD
    drone.send("vfr_hud", heading=12)
    assert loop.run(request).body["info"]["heading"] == 12


def test_readers_of_the_unreported_share_one_request_and_do_not_wait(
    api: Api, loop: FastLoop, host: Host, drone: Drone
) -> None:
    for name in ("VFR_HUD", "GPS_RAW_INT"):
        del host.fleet.vehicles[1].messages[name]
        drone.mute.add(name)
    drone.answers[mavlink.MAV_CMD_REQUEST_MESSAGE] = [None]
    began = loop.time()
    requested = [api.begin("GET", f"/telemetry/{path}") for path in ("general", "gps_raw") * 3]
    assert [loop.run(request).body["code"] for request in requested] == ["stale"] * 6
    assert loop.time() - began == pytest.approx(FIRST_TIMEOUT, abs=0.2)
    assert {command.param1 for command in drone.commands(mavlink.MAV_CMD_REQUEST_MESSAGE)} == {74}
    assert len(drone.commands(mavlink.MAV_CMD_REQUEST_MESSAGE)) == 2


@pytest.mark.parametrize("result", [mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED])
def test_message_that_does_not_come_when_requested_is_stale(
    api: Api, loop: FastLoop, host: Host, drone: Drone, result: int
) -> None:
    del host.fleet.vehicles[1].messages["VFR_HUD"]
    drone.mute.add("VFR_HUD")
    drone.answers[mavlink.MAV_CMD_REQUEST_MESSAGE] = [result]
    answer = api.get("/telemetry/general")
    assert (answer.status, answer.body["code"]) == (503, "stale")
    assert "has not reported VFR_HUD yet" in answer.body["detail"]


# -- home, compass, any message ---------------------------------------------------------------------------


def test_home_is_requested_and_flat(flying: Drone, api: Api) -> None:
    answer = api.get("/telemetry/home_info")
    age = answer.body.pop("age_s")
    assert answer.body == {
        "device": "uav", "id": "1", "result": "success",
        "lat": -35.0, "lon": 149.0, "altitude": 584.0, "x": 0.0, "y": 0.0, "z": 0.0,
    }  # fmt: skip
    assert age < 0.1


def test_home_serves_further_readers_for_a_moment_only(flying: Drone, api: Api, loop: FastLoop) -> None:
    for _ in range(3):
        assert api.get("/telemetry/home_info").status == 200
    assert len(flying.commands(mavlink.MAV_CMD_REQUEST_MESSAGE)) == 1
    loop.pass_time(HOME_AGE + 0.2)
    api.get("/telemetry/home_info")
    assert len(flying.commands(mavlink.MAV_CMD_REQUEST_MESSAGE)) == 2


def test_home_that_is_not_set_is_404(drone: Drone, api: Api) -> None:
    drone.answers[mavlink.MAV_CMD_REQUEST_MESSAGE] = [mavlink.MAV_RESULT_FAILED]
    answer = api.get("/telemetry/home_info")
    assert (answer.status, answer.body["code"]) == (404, "not_found")
    assert "home" in answer.body["detail"]


def test_home_of_a_lost_link_is_503(drone: Drone, api: Api, loop: FastLoop) -> None:
    drone.power_off()
    loop.pass_time(10.0)
    assert api.get("/telemetry/home_info").body["code"] == "link_lost"


def test_compass_without_a_calibration_is_404_that_says_so(drone: Drone, api: Api) -> None:
    answer = api.get("/telemetry/compass")
    assert (answer.status, answer.body["code"]) == (404, "not_found")
    assert "calibration" in answer.body["detail"]


def test_compass_reports_each_fitness(drone: Drone, api: Api, loop: FastLoop) -> None:
    drone.send("mag_cal_report", compass_id=0, cal_status=4, autosaved=1, fitness=5.5)
    drone.send("mag_cal_report", compass_id=2, cal_status=4, autosaved=1, fitness=7.5)
    loop.pass_time(20.0)
    body = api.get("/telemetry/compass").body
    assert body["info"] == {
        "calibration_status": 4, "autosaved": True, "fitness": {"x": 5.5, "y": None, "z": 7.5},
    }  # fmt: skip
    assert body["age_s"] == pytest.approx(20.0, abs=0.2)


@pytest.mark.parametrize("name", ["EXTENDED_SYS_STATE", "extended_sys_state/"])
def test_any_message_is_reported_with_count_and_rate(flying: Drone, api: Api, loop: FastLoop, name: str) -> None:
    loop.pass_time(10.0)
    info = api.get(f"/telemetry/message/{name}").body["info"]
    assert info["landed_state"] == 2
    assert info["count"] >= 40
    assert info["rate"] == pytest.approx(4.0, abs=0.3)


def test_message_of_one_device_of_several(flying: Drone, api: Api, loop: FastLoop) -> None:
    for number in (0, 1):
        flying.send("battery_status", id=number, voltages=[3700] * 3 + [65535] * 7, battery_remaining=50 + number)
    loop.settle()
    info = api.get("/telemetry/message/BATTERY_STATUS[0]").body["info"]
    assert info["battery_remaining"] == 50
    assert info["voltages"] == [3700] * 3 + [None] * 7


def test_messages_that_come_with_the_unit_of_each_number_that_is_known(
    flying: Drone, api: Api, loop: FastLoop
) -> None:
    for number in (0, 1):
        flying.send("battery_status", id=number, voltages=[3700] * 2 + [65535] * 8, current_battery=-1)
    loop.pass_time(10.0)
    body = api.get("/telemetry/messages").body
    hud, battery = body["messages"]["VFR_HUD"], body["messages"]["BATTERY_STATUS[1]"]
    assert hud["units"]["groundspeed"] == "m/s"
    assert (hud["component"], hud["instance"]) == (1, None)
    assert body["messages"]["EXTENDED_SYS_STATE"]["rate"] == pytest.approx(4.0, abs=0.3)
    assert {**battery["units"], "voltages[1]": "mV"} == battery["units"]
    assert battery["instance"] == "id"
    assert not {"voltages[2]", "current_battery", "mavpackettype"} & set(battery["units"])  # not known, no number


@pytest.mark.parametrize("name", ["NO_SUCH_MESSAGE", "RAW_PRESSURE"])
def test_message_that_there_is_not_is_404(flying: Drone, api: Api, name: str) -> None:
    answer = api.get(f"/telemetry/message/{name}")
    assert (answer.status, answer.body["code"]) == (404, "not_found")


def test_message_of_another_component_is_found(flying: Drone, api: Api, loop: FastLoop) -> None:
    flying.send("gimbal_device_attitude_status", component=154, q=[1.0, 0.0, 0.0, float("nan")])
    loop.settle()
    answer = api.get("/telemetry/message/GIMBAL_DEVICE_ATTITUDE_STATUS")
    assert answer.body["info"]["q"] == [1.0, 0.0, 0.0, None]


@pytest.mark.parametrize("path", ["general", "ned", "attitude", "sys_status", "message/VFR_HUD"])
def test_nan_and_infinities_become_null(flying: Drone, api: Api, loop: FastLoop, path: str) -> None:
    nan, inf = float("nan"), float("inf")
    flying.mute |= {"VFR_HUD", "LOCAL_POSITION_NED", "ATTITUDE"}
    flying.send("vfr_hud", airspeed=nan, groundspeed=inf, alt=-inf)
    flying.send("local_position_ned", x=nan, vz=inf)
    flying.send("attitude", roll=nan, yaw=nan, yawspeed=inf)
    loop.settle()
    answer = api.get(f"/telemetry/{path}")  # its parser refuses NaN
    assert answer.status == 200
    if path == "general":
        assert (answer.body["info"]["airspeed"], answer.body["info"]["alt"]) == (None, None)
    elif path == "attitude":
        assert None not in (answer.body["info"]["roll"], answer.body["info"]["yaw"])  # the last that was a number


def test_telemetry_is_read_only(flying: Drone, api: Api) -> None:
    answer = api.post("/telemetry/gps")
    assert answer.status == 405
