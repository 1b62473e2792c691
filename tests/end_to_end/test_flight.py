"""The copter's endpoints, flown: in lock step, and by real processes on ArduPilot where there is one."""

from __future__ import annotations

import math

import pytest

from tests.support.processes import ardupilot
from tests.support.wired_rig import WiredRig


@pytest.fixture(scope="module", params=["lockstep", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rig(request, tmp_path_factory):
    """A rig that the tests share; each leaves it fit to fly."""
    directory = tmp_path_factory.mktemp(request.param)
    made = WiredRig(directory) if request.param == "lockstep" else ardupilot(directory)
    yield made
    made.stop()


def near(a, b, within):
    return math.dist(a, b) <= within


def test_takeoff_and_movement_before_arming_say_what_to_do_first(rig):
    for answer in (rig.get("/command/takeoff", alt=5), rig.post("/movement/go_to_ned", x=5, y=0, z=-5)):
        assert answer.status_code == 409
        assert answer.json()["code"] == "not_armed"
        assert "`arm`" in answer.json()["detail"]


def test_arm_takeoff_square_and_land(rig):
    assert rig.ok(rig.get("/command/arm"))["result"] == "Armed vehicle"
    assert rig.status()["armed"] is True
    body = rig.ok(rig.get("/command/takeoff", alt=10))
    assert body == {"device": "uav", "id": "1", "result": "Takeoff successful! Vehicle at 10 meters"}
    assert rig.ok(rig.get("/telemetry/gps"))["info"]["position"]["relative_alt"] == pytest.approx(10, abs=1)
    for corner in ((15, 0, -10), (15, 15, -12), (0, 15, -12), (0, 0, -10)):
        x, y, z = corner
        body = rig.ok(rig.post("/movement/go_to_ned_wait", x=x, y=y, z=z))
        assert body["result"] == f"Arrived at NED coord ({x}, {y}, {z})"
        assert near(rig.ned(), corner, 1.5)
    assert rig.ok(rig.get("/command/land"))["result"] == "Landed at home successfully"
    status = rig.status()
    assert status["armed"] is False
    assert status["landed_state"] == "on_ground"


def test_rtl_returns_to_the_place_it_took_off_from(rig):
    rig.in_the_air(8)
    home = rig.ok(rig.get("/telemetry/home_info"))
    rig.ok(rig.post("/movement/drive_wait/", x=20, y=-10, z=0))
    assert rig.ok(rig.get("/command/rtl"))["result"] == "Landed at home successfully"
    position = rig.ok(rig.get("/telemetry/gps"))["info"]["position"]
    assert abs(position["lat"] - home["lat"]) * 111_319 < 2
    assert abs(position["lon"] - home["lon"]) * 111_319 * math.cos(math.radians(home["lat"])) < 2
    assert rig.status()["armed"] is False


def test_go_to_gps_goes_to_the_altitude_above_home(rig):
    rig.in_the_air(10)
    here = rig.ok(rig.get("/telemetry/gps"))["info"]["position"]
    lat = here["lat"] + 0.0002
    body = rig.ok(rig.post("/movement/go_to_gps_wait", lat=lat, long=here["lon"], alt=14.5))
    assert body["result"] == f"Arrived at coord ({lat}, {here['lon']}, 14.5)"
    there = rig.ok(rig.get("/telemetry/gps"))["info"]["position"]
    assert abs(there["lat"] - lat) * 111_319 < 1.5
    assert there["relative_alt"] == pytest.approx(14.5, abs=1.5)


def test_drive_body_goes_where_the_nose_points(rig):
    rig.in_the_air(10)
    rig.ok(rig.get("/movement/set_heading", heading=90))
    wait_for_heading(rig, 90)
    x, y, z = rig.ned()
    rig.ok(rig.post("/movement/drive_body_wait", front=8, right=0, down=0))
    assert near(rig.ned(), (x, y + 8, z), 1.8)


def wait_for_heading(rig, heading, within=6.0):
    deadline = rig.now + 20
    while abs((rig.ok(rig.get("/telemetry/attitude"))["info"]["yaw"] - heading + 180) % 360 - 180) > within:
        assert rig.now < deadline, "never turned there"
        rig.pass_time(0.1)


def test_heading_turns_the_shorter_way_round(rig):
    rig.in_the_air(10)
    rig.ok(rig.get("/movement/set_heading", heading=350))
    wait_for_heading(rig, 350)
    rig.ok(rig.get("/movement/set_heading", heading=10))
    seen = []
    deadline = rig.now + 20
    while not seen or abs((seen[-1] - 10 + 180) % 360 - 180) > 6:
        seen.append(rig.ok(rig.get("/telemetry/attitude"))["info"]["yaw"])
        assert rig.now < deadline
    assert all(yaw > 340 or yaw < 20 for yaw in seen), seen


@pytest.mark.parametrize("verb", ["set_heading?heading=200", "set_yaw_rate?yaw_rate=30"])
def test_yaw_does_not_end_a_movement_in_flight(rig, verb):
    rig.in_the_air(10)
    x, y, z = rig.ned()
    target = (x + (25 if x < 0 else -25), y, z)
    rig.ok(rig.post("/movement/go_to_ned", x=target[0], y=target[1], z=target[2]))
    rig.pass_time(0.15)
    rig.ok(rig.get("/movement/" + verb))
    rig.ok(rig.get("/command/set_ground_speed", new_v=8))
    deadline = rig.now + 30
    while not near(rig.ned(), target, 1.0):
        assert rig.now < deadline, f"at {rig.ned()}, never at {target}"
        rig.pass_time(0.1)
    rig.ok(rig.get("/movement/set_yaw_rate", yaw_rate=0))


def test_travel_for_a_duration_goes_that_far_and_stops(rig):
    rig.in_the_air(10)
    x, y, z = rig.ned()
    # Slowly: its clock is ten times ours, and a busy machine's tenth of a second is half a metre.
    rig.ok(rig.post("/movement/travel_at_ned", vx=0.5, vy=0.0, vz=0.0, duration=20))
    rig.pass_time(0.5)
    assert near(rig.ned(), (x + 10, y, z), 3.0)
    velocity = rig.ok(rig.get("/telemetry/ned"))["info"]["velocity"]
    assert math.hypot(velocity["vx"], velocity["vy"]) < 0.3


def test_a_velocity_sent_once_is_dropped_by_the_autopilot(rig):
    rig.in_the_air(10)
    x, y, _ = rig.ned()
    rig.ok(rig.post("/movement/travel_at_ned", vx=0.0, vy=2.0, vz=0.0))
    rig.pass_time(1.5)
    first = rig.ned()
    rig.pass_time(0.3)
    assert near(rig.ned(), first, 0.3)
    assert 2 < first[1] - y < 12


def test_stop_holds_and_resume_goes_on(rig):
    rig.in_the_air(10)
    x, y, z = rig.ned()
    target = (x, y + (60 if y < 0 else -60), z)
    rig.ok(rig.post("/movement/go_to_ned", x=target[0], y=target[1], z=target[2]))
    rig.pass_time(0.3)
    assert rig.ok(rig.get("/movement/stop"))["result"] == "Copter has stopped"
    rig.pass_time(0.6)
    stopped = rig.ned()
    rig.pass_time(0.4)
    assert near(rig.ned(), stopped, 0.5)
    assert not near(stopped, target, 5)
    assert rig.ok(rig.get("/movement/resume"))["result"] == "Copter has resumed"
    deadline = rig.now + 30
    while not near(rig.ned(), target, 1.0):
        assert rig.now < deadline
        rig.pass_time(0.1)


def test_brake_ends_guided_flight_until_guided_is_requested(rig):
    rig.in_the_air(10)
    body = rig.ok(rig.get("/command/brake"))
    assert body["result"] == "Copter braking. Use /command/guided to enable movement commands again"
    refused = rig.post("/movement/go_to_ned", x=0, y=0, z=-10)
    assert refused.status_code == 409
    assert refused.json()["code"] == "mode_changed"
    assert "`guided`" in refused.json()["detail"]
    assert rig.ok(rig.get("/command/guided"))["result"] == "Copter in GUIDED mode"
    rig.ok(rig.post("/movement/drive_wait", x=1, y=0, z=0))


@pytest.mark.parametrize(
    "kind,name", [("air", "Air"), ("ground", "Ground"), ("climb", "Climb"), ("descent", "Descent")]
)
def test_speeds_are_acknowledged(rig, kind, name):
    assert rig.ok(rig.get(f"/command/set_{kind}_speed", new_v=4))["result"] == f"{name} speed set to 4m/s"


def test_the_ground_speed_that_was_set_is_flown(rig):
    rig.in_the_air(10)
    rig.on_the_ground()
    rig.in_the_air(10)  # ArduCopter forgets a speed that was set between takeoff and the first movement
    rig.ok(rig.get("/command/set_ground_speed", new_v=2))
    x, y, z = rig.ned()
    rig.ok(rig.post("/movement/go_to_ned", x=x + (40 if x < 0 else -40), y=y, z=z))
    rig.pass_time(1)
    velocity = rig.ok(rig.get("/telemetry/ned"))["info"]["velocity"]
    assert math.hypot(velocity["vx"], velocity["vy"]) == pytest.approx(2, abs=0.5)
    rig.ok(rig.get("/command/set_ground_speed", new_v=10))


def test_disarm_in_the_air_is_refused(rig):
    rig.in_the_air(10)
    refused = rig.get("/command/disarm")
    assert refused.status_code == 409
    assert rig.status()["armed"] is True


def test_set_home_makes_here_home(rig):
    rig.in_the_air(10)
    rig.on_the_ground()
    assert rig.ok(rig.get("/command/set_home"))["result"] == "Home location set successfully!"
    home, here = rig.ok(rig.get("/telemetry/home_info")), rig.ok(rig.get("/telemetry/gps"))["info"]["position"]
    assert abs(home["lat"] - here["lat"]) * 111_319 < 1
    assert here["relative_alt"] == pytest.approx(0, abs=1)


def test_servo_and_speedup(rig):
    body = rig.ok(rig.post("/peripherical/servo_output", channel=9, pwm=1700))
    assert body["result"] == "Servo 9 set to 1700 PWM"
    assert rig.ok(rig.get("/command/set_sim_speedup", sim_factor=5))["result"] == "Simulation speedup set to 5x"
    assert rig.ok(rig.get("/command/set_sim_speedup", sim_factor=10))["result"] == "Simulation speedup set to 10x"


def test_land_and_rtl_on_the_ground_are_done_at_once(rig):
    rig.in_the_air(6)
    rig.on_the_ground()
    before = rig.now
    rig.ok(rig.get("/command/land"))
    rig.ok(rig.get("/command/disarm"))
    assert rig.now - before < 5


def test_every_telemetry_path_answers_with_an_age(rig):
    for path in ("general", "gps", "gps_raw", "ned", "sys_status", "sensor_status", "battery_info", "error_info"):
        for slash in ("", "/"):
            body = rig.ok(rig.get(f"/telemetry/{path}{slash}"))
            assert body["device"] == "uav" and body["id"] == "1"
            assert body["result"].lower() == "success"
            assert 0 <= body["age_s"] < 5
    home = rig.ok(rig.get("/telemetry/home_info"))
    assert {"lat", "lon", "altitude", "x", "y", "z", "age_s"} <= home.keys()
    compass = rig.get("/telemetry/compass")
    assert compass.status_code == 404 and "calibration" in compass.json()["detail"]
    message = rig.ok(rig.get("/telemetry/message/ATTITUDE"))["info"]
    assert message["count"] > 1 and message["rate"] > 0
