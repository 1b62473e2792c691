"""Flights against an adversary: pilots, other stations, streams and deaths at the worst moment; each was lost once.

On ArduPilot's vehicle; a few on the embedded one too.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import time

import pytest
import requests

from tests.support.envelopes import field, place
from tests.support.hostile_flights import (
    DEADLY,
    WPL,
    Streams,
    armed_on_the_ground,
    height,
    highest,
    job_of,
    mark,
    mode,
    reload,
    run_deadly,
    sent,
    speed,
    until_command,
)

pytestmark = [pytest.mark.needs("tmux"), pytest.mark.long]

TRIES = 20
SLOW = 3  # speed-up, where the first second of a take-off is aimed at
SENT_WITHIN = 0.25  # s from a request to the vehicle's socket, on a machine that does much else
COMMANDS = {"takeoff": 22, "land": 176, "rtl": 176}

ARDUPILOT = pytest.param("ardupilot", marks=pytest.mark.sitl)
# tests/rules and tests/core have these moments in virtual time.
# On the embedded vehicle only what needs real clocks is flown here.
both = pytest.mark.parametrize("vehicle", ["embedded", ARDUPILOT], indirect=True, scope="module")
on_ardupilot = pytest.mark.parametrize("vehicle", [ARDUPILOT], indirect=True, scope="module")


@pytest.fixture(scope="module")
def vehicle(request, harness, tmp_path_factory):
    directory = tmp_path_factory.mktemp("hostile")
    folders = {"scripts_path": str(directory / "scripts"), "script_logs": str(directory / "logs")}
    if request.param == "embedded":
        rig = harness.embedded(directory, **folders)
    else:
        rig = harness.ardupilot_with_faults(directory, link_timeout=5, max_age=5, **folders)
    rig.settings = folders
    answer = requests.post(rig.url + "/mission/upload-script", files={"file": ("deadly.py", DEADLY)}, timeout=10)
    rig.ok(answer)
    rig.mavproxy.type("param set BATT_CAPACITY 1000000")  # mAh: for flights of an hour
    harness.eventually(lambda: rig.status()["ready_to_arm"], 60, "getting ready to arm")
    yield rig
    rig.stop()


@pytest.fixture
def rig(vehicle):
    """The vehicle; whatever a flight ended in, the next one begins on the ground without faults."""
    yield vehicle
    vehicle.control.ask("clear")
    vehicle.get("/command/set_sim_speedup", sim_factor=10)
    vehicle.get("/command/land", timeout=60)
    vehicle.control.fault("pilot_sticks", throttle=1000)
    vehicle.get("/command/disarm", force=True)


# -- F1: a pilot who takes off while arm waits ------------------------------------------------------------


@on_ardupilot
def test_arm_that_waits_does_not_take_the_vehicle_from_the_pilot_who_arms_it(rig, harness):
    rig.ok(rig.get("/command/set_mode", mode="STABILIZE"))
    rig.control.fault("ekf_bad")
    harness.eventually(lambda: not rig.status()["ekf_ok"], what="the loss of its position")
    waiting = rig.begin("GET", "/command/arm")
    time.sleep(0.3)
    harness.eventually(lambda: pilot_arms(rig), what="the pilot's arming")
    time.sleep(0.5)
    rig.control.fault("pilot_sticks", throttle=1500)
    answer = waiting.answer(30)
    assert (answer.status_code, answer.json().get("code")) == (409, "mode_changed")
    rig.control.ask("clear")
    harness.eventually(lambda: rig.status()["ekf_ok"], what="readiness")
    harness.eventually(lambda: rig.get("/telemetry/ned").status_code == 200 and height(rig) > 3, what="his flight")
    since = mark(rig)
    time.sleep(1.0)
    assert sent(rig, since) == []
    assert mode(rig) == "STABILIZE"
    rig.control.fault("pilot_mode", mode="LAND")
    harness.eventually(lambda: rig.status()["armed"] is False, 60, "his landing")


def pilot_arms(rig):
    rig.control.fault("pilot_arm")
    return rig.status()["armed"]


# -- F2: what stops goes before what streams --------------------------------------------------------------


@both
@pytest.mark.parametrize("verb", ["land", pytest.param("rtl", marks=pytest.mark.long)])
def test_going_down_is_not_kept_from_the_vehicle_by_streams(rig, harness, verb):
    rig.in_the_air(150)
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=1))  # it sinks a little in each try
    with Streams(rig) as streams:
        for number in range(TRIES):
            before = len(streams.answers)
            answer = rig.get(f"/command/{verb}?wait=false")
            assert answer.status_code == 202, answer.text
            harness.eventually(lambda: mode(rig) == verb.upper(), 60, f"{verb} number {number}")
            time.sleep(0.2)
            assert streams.refusals(before) <= {"busy", "mode_changed", "superseded"}
            assert job_of(rig, answer.headers["Location"])["state"] == "running"
            rig.ok(rig.get("/command/guided"))
        rig.ok(rig.get("/command/set_sim_speedup", sim_factor=10))
        rig.ok(rig.get(f"/command/{verb}"))
        assert rig.status()["armed"] is False


@on_ardupilot
def test_brake_is_not_kept_from_the_vehicle_by_streams(rig):
    rig.in_the_air(10)
    with Streams(rig) as streams:
        for _ in range(TRIES):
            before = len(streams.answers)
            rig.ok(rig.get("/command/brake"))
            assert mode(rig) == "BRAKE"
            assert streams.refusals(before) <= {"busy", "mode_changed", "superseded"}
            rig.ok(rig.get("/command/guided"))


@on_ardupilot
def test_disarm_is_not_kept_from_the_vehicle_by_streams(rig):
    rig.control.fault("pilot_sticks", throttle=1000)
    with Streams(rig) as streams:
        for _ in range(TRIES):
            rig.ok(rig.get("/command/arm"))
            before = len(streams.answers)
            rig.ok(rig.get("/command/disarm"))
            assert rig.status()["armed"] is False
            assert streams.refusals(before) <= {"busy", "not_armed", "mode_changed"}


# -- F3: stop is stop -------------------------------------------------------------------------------------


@both
def test_stop_holds_a_vehicle_still_against_a_stream_until_resume(rig, harness):
    rig.in_the_air(10)
    with Streams(rig, count=1) as streams:
        harness.eventually(lambda: speed(rig) > 2, what="its flying")
        rig.ok(rig.get("/movement/stop"))
        before = len(streams.answers) + 1  # one may be on its way
        for _ in range(10):
            assert speed(rig) < 0.7
            time.sleep(0.1)
        assert set(streams.answers[before:]) == {(409, "paused")}
        rig.ok(rig.get("/movement/resume"))
        harness.eventually(lambda: speed(rig) > 2, what="its flying again")


# -- F4: the setpoint in force is the autopilot's ---------------------------------------------------------


@on_ardupilot
def test_yaw_rate_leaves_another_stations_target_in_force(rig, harness):
    rig.in_the_air(10)
    x, y, z = rig.ned()
    rig.ok(rig.post("/movement/go_to_ned_wait", x=x + 5, y=y, z=z))
    target = (x + 5, y + (60 if y < 0 else -60), z)
    rig.control.fault("other_station", position=target)
    time.sleep(0.2)
    rig.get("/movement/set_yaw_rate", yaw_rate=30)
    harness.eventually(lambda: math.dist(rig.ned(), target) < 1.5, what="the other station's target")
    rig.get("/movement/set_yaw_rate", yaw_rate=0)


@on_ardupilot
def test_yaw_rate_after_a_takeoff_does_not_fly_to_the_target_before_it(rig):
    rig.in_the_air(10)
    x, y, z = rig.ned()
    rig.ok(rig.post("/movement/go_to_ned_wait", x=x + (40 if x < 0 else -40), y=y, z=z))
    rig.ok(rig.post("/movement/go_to_ned", x=x, y=y, z=z))
    time.sleep(0.3)
    rig.on_the_ground()
    rig.in_the_air(10)
    here = rig.ned()
    rig.get("/movement/set_yaw_rate", yaw_rate=30)
    time.sleep(1.0)
    assert math.dist(rig.ned(), here) < 2
    rig.get("/movement/set_yaw_rate", yaw_rate=0)


@on_ardupilot
@pytest.mark.parametrize("after", [0.05, 0.4])
def test_yaw_rate_in_a_takeoff_is_refused_and_the_climb_goes_on(rig, after):
    armed_on_the_ground(rig)
    waiting = rig.begin("GET", "/command/takeoff?alt=20")
    time.sleep(after)
    answer = rig.get("/movement/set_yaw_rate", yaw_rate=30)
    assert (answer.status_code, answer.json().get("code")) == (409, "busy")
    rig.ok(waiting.answer(60))
    assert height(rig) > 18.5


# -- F5: a hold in the first second of a take-off ---------------------------------------------------------


def assert_stays_low(rig):
    reached = highest(rig)
    print(f"it reached {reached:.2f} m")
    assert reached < 6
    assert speed(rig) < 0.7
    assert "Internal Error" not in rig.mavproxy.output()


@on_ardupilot
@pytest.mark.parametrize("after", [0.02, 0.15, 0.25, 0.35, 0.45, 0.6])
def test_takeoff_that_is_deleted_in_its_first_second_does_not_climb_on(rig, after):
    armed_on_the_ground(rig)
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=SLOW))
    location = rig.get("/command/takeoff?alt=20&wait=false").headers["Location"]
    time.sleep(after)
    assert rig.delete(location).status_code == 200
    assert_stays_low(rig)


@on_ardupilot
def test_takeoff_whose_client_hangs_up_in_its_first_second_does_not_climb_on(rig):
    armed_on_the_ground(rig)
    rig.set("on_disconnect", "hold")
    try:
        rig.ok(rig.get("/command/set_sim_speedup", sim_factor=SLOW))
        with contextlib.suppress(requests.ReadTimeout):
            rig.get("/command/takeoff", alt=20, timeout=0.3)
        assert_stays_low(rig)
    finally:
        rig.set("on_disconnect", "continue")


@on_ardupilot
def test_takeoff_whose_script_dies_in_its_first_second_does_not_climb_on(rig):
    armed_on_the_ground(rig)
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=SLOW))
    run_deadly(rig, "/command/takeoff?alt=20&wait=false", "-", 0.3)
    assert_stays_low(rig)


# -- F6: a dead script's job ------------------------------------------------------------------------------


@both
def test_dead_scripts_job_ends_with_it_and_the_vehicle_holds(rig, harness):
    rig.in_the_air(10)
    body = '{"vx": 8, "vy": 0, "vz": 0, "duration": 3600}'
    run_deadly(rig, "/movement/travel_at_ned?wait=false", body, 600)
    pid = int(harness.eventually(lambda: show(rig)["out"], 60, "the answer to it"))  # by then it is known as a script
    job = travelling(rig)
    os.kill(pid, signal.SIGKILL)
    harness.eventually(lambda: job_of(rig, f"/jobs/{job}")["state"] != "running", 60, "the end of its job")
    assert "its script died" in str(job_of(rig, f"/jobs/{job}")["error"])
    harness.eventually(lambda: speed(rig) < 0.5, 60, "its holding")


def travelling(rig):
    jobs = rig.ok(rig.get("/jobs"))["jobs"]
    return next((j["job"] for j in jobs if j["state"] == "running" and j["verb"].endswith("travel_at_ned")), None)


def show(rig):
    return rig.ok(rig.get("/mission/scripts/deadly"))["run"]


# -- F7: DELETE of a mission ------------------------------------------------------------------------------


@on_ardupilot
def test_mission_that_is_deleted_is_left_by_brake(rig, harness):
    rig.in_the_air(10)
    rig.ok(
        requests.post(rig.url + "/mission/waypoints", data=WPL, headers={"Content-Type": "text/plain"}, timeout=60)
    )
    answer = rig.post("/mission/start?wait=false", until_complete=True)
    assert answer.status_code == 202
    harness.eventually(lambda: mode(rig) == "AUTO" and speed(rig) > 2, what="its mission")
    assert rig.delete(answer.headers["Location"]).status_code == 200
    assert mode(rig) == "BRAKE"
    harness.eventually(lambda: speed(rig) < 0.5, 10, "standing still")
    rig.ok(rig.get("/command/guided"))


# -- F8: what is not a number -----------------------------------------------------------------------------


@on_ardupilot
@pytest.mark.parametrize(
    ("message", "path", "body"),
    [
        ("LOCAL_POSITION_NED", "/movement/drive", {"x": 5, "y": 0, "z": 0}),
        ("ATTITUDE", "/movement/drive_body", {"front": 5, "right": 0, "down": 0}),
    ],
)
def test_telemetry_that_is_not_a_number_is_not_flown_by(rig, harness, message, path, body):
    rig.in_the_air(10)
    rig.control.fault("nan", message=message)
    # What is no number counts as not received: the last good one grows old.
    harness.eventually(lambda: rig.get(f"/telemetry/message/{message}").status_code == 503, what="its age")
    since = mark(rig)
    answer = rig.post(path, **body)
    assert (answer.status_code, answer.json().get("code")) == (503, "stale"), answer.text
    assert [m for m in sent(rig, since) if m["name"].startswith("SET_POSITION")] == []


# -- F9: the first command is on the wire at once ---------------------------------------------------------


@on_ardupilot
@pytest.mark.parametrize("verb", ["takeoff", "land", "rtl"])
def test_first_command_goes_out_before_anything_is_requested(rig, harness, verb):
    if verb == "takeoff":
        armed_on_the_ground(rig)
    else:
        rig.in_the_air(10)
    reload(rig)
    since, asked_at = mark(rig), time.time()
    waiting = rig.begin("GET", f"/command/{verb}")
    expected = COMMANDS[verb]
    received = harness.eventually(lambda: until_command(rig, since, expected), what=f"{verb} on the wire")
    took = received[-1]["wall"] - asked_at
    print(f"{verb} was on the wire after {1000 * took:.1f} ms")
    assert [m["fields"]["param_id"] for m in received if m["name"] == "PARAM_REQUEST_READ"] == []
    assert took < SENT_WITHIN
    rig.ok(waiting.answer(60))


# -- C1 to C8: evidence, stands, stops and protection -------------------------------------------------------


def at_pace(rig, harness, factor=1):
    harness.eventually(
        lambda: rig.get("/command/set_sim_speedup", sim_factor=factor).status_code == 200, 60, "its pace"
    )


@pytest.fixture
def slow(rig, harness):
    """The vehicle at its own pace, on a link of 0.9 s each way that has been measured."""
    at_pace(rig, harness)
    rig.control.fault("way", seconds=0.9)
    time.sleep(8.0)
    return rig


@pytest.fixture
def flying_slowly(rig, request):
    """As `slow`, in the air."""
    rig.in_the_air(20)
    request.getfixturevalue("slow")


def true_mode(rig):
    """The mode that is reported when all that is on its way has arrived."""
    rig.control.fault("way", seconds=0.0)
    time.sleep(2.5)
    return mode(rig)


@on_ardupilot
@pytest.mark.parametrize("path", ["/command/rtl", "/command/brake", "/command/land", "/command/set_mode?mode=LOITER"])
def test_pilots_switch_on_a_slow_link_is_not_undone_by_a_second_sending(rig, flying_slowly, path):
    waiting = rig.begin("GET", path)
    time.sleep(1.3)
    rig.control.fault("pilot_mode", mode="ALT_HOLD")
    time.sleep(6.0)
    assert true_mode(rig) == "ALT_HOLD"
    waiting.answer(60)


@on_ardupilot
def test_arming_that_the_pilot_has_undone_on_a_slow_link_is_not_repeated(rig, slow):
    rig.control.fault("pilot_sticks", throttle=1000)
    waiting = rig.begin("GET", "/command/arm")
    time.sleep(3.0)
    rig.control.fault("pilot_disarm")
    time.sleep(6.0)
    true_mode(rig)
    assert rig.status()["armed"] is False
    waiting.answer(60)


@on_ardupilot
@pytest.mark.parametrize("path", ["/command/guided", "/command/brake", "/command/rtl"])
def test_what_waits_while_the_main_loop_stands_does_not_take_the_vehicle_from_its_pilot(rig, harness, path):
    rig.in_the_air(20)
    at_pace(rig, harness)
    rig.mavproxy.type("shell sleep 2.7")
    time.sleep(0.5)
    waiting = rig.begin("GET", path)
    time.sleep(0.5)
    rig.control.fault("pilot_mode", mode="ALT_HOLD")
    time.sleep(6.0)
    assert mode(rig) == "ALT_HOLD"
    assert waiting.answer(60).status_code == 409


@on_ardupilot
def test_track_that_is_stopped_near_its_last_point_does_not_return(rig, harness):
    rig.mavproxy.ask("module load gradys", "Loaded module gradys")
    rig.in_the_air(10)
    at_pace(rig, harness, SLOW)
    x, y, _ = rig.ned()
    lat, lon = place(x + 30, y)
    track = str((1, round(lat * 1e7), round(lon * 1e7), 594_000, 0, 65535, 0, 0, 3, 10))
    waiting = rig.begin("POST", "/mission/fly-track", {"track": track, "ground": 584})
    harness.eventually(lambda: rig.ned()[0] > x + 25, 60, "its last metres")
    assert rig.get("/movement/stop").status_code == 200
    since = mark(rig)
    time.sleep(4.0)
    assert mode(rig) == "GUIDED" and speed(rig) < 0.7
    assert [m for m in sent(rig, since) if m["fields"].get("command") == 176] == []
    rig.ok(rig.get("/command/brake"))
    waiting.answer(60)


@on_ardupilot
def test_stop_ends_an_arm_that_waits_for_the_position(rig, harness):
    rig.control.fault("pilot_sticks", throttle=1000)
    rig.ok(rig.get("/command/set_mode", mode="STABILIZE"))
    rig.control.fault("ekf_bad")
    harness.eventually(lambda: not rig.status()["ekf_ok"], what="the loss of its position")
    waiting = rig.begin("GET", "/command/arm")
    time.sleep(0.5)
    rig.get("/movement/stop")
    assert waiting.answer(30).status_code == 409
    rig.control.ask("clear")
    harness.eventually(lambda: rig.status()["ekf_ok"], what="readiness")
    time.sleep(2.0)
    assert rig.status()["armed"] is False


@on_ardupilot
def test_brake_at_the_border_is_nobodys_to_delete(rig, harness):
    rig.in_the_air(10)
    rig.ok(rig.post("/movement/go_to_ned_wait", x=0, y=0, z=-10))
    at_pace(rig, harness)
    rig.ok(rig.get("/command/set_ground_speed?new_v=10"))
    rig.ok(rig.post("/movement/go_to_ned", x=0, y=200, z=-10))
    harness.eventually(lambda: rig.ned()[1] > 40, 60, "its way")
    try:
        rig.ok(requests.put(rig.url + "/envelope", json=field(rig.ned()[1] + 30, 400), timeout=10))
        answers = set()
        harness.eventually(lambda: braking(rig), 10, "the stop at the border")
        for job in iter(lambda: braking(rig), None):
            answers.add((rig.delete(f"/jobs/{job}").status_code, rig.get("/command/guided").status_code))
        is_taken = any(guided == 200 for _, guided in answers)  # the last one may come when it stands
        assert speed(rig) < 0.5 and mode(rig) == ("GUIDED" if is_taken else "BRAKE")
    finally:
        requests.delete(rig.url + "/envelope", timeout=10)
    print(f"DELETE and guided: {answers}")
    assert (409, 409) in answers


@on_ardupilot
@pytest.mark.parametrize("hidden", [0.0, 0.9])
@pytest.mark.parametrize("pilots", ["LOITER", "ALT_HOLD", "STABILIZE"])
def test_border_hears_its_pilot_or_says_that_it_did_not(rig, harness, pilots, hidden):
    rig.in_the_air(10)
    rig.ok(rig.post("/movement/go_to_ned_wait", x=0, y=0, z=-10))
    at_pace(rig, harness)
    rig.ok(rig.get("/command/set_ground_speed?new_v=10"))
    rig.control.fault("pilot_sticks", throttle=1500)
    try:
        rig.ok(requests.put(rig.url + "/envelope", json=field(200, 400), timeout=10))
        rig.ok(rig.post("/movement/go_to_ned", x=0, y=150, z=-10))
        harness.eventually(lambda: rig.ned()[1] > 40, 60, "its way")
        since, said = mark(rig), rig.mavproxy.mark()
        rig.control.fault("hide", message="HEARTBEAT", seconds=hidden)
        rig.control.fault("pilot_mode", mode=pilots)
        rig.ok(requests.put(rig.url + "/envelope", json=field(rig.ned()[1] + 15, 400), timeout=10))
        time.sleep(4.0)
        modes = [m for m in sent(rig, since) if m["fields"].get("command") == 176]
        unheard = "is stopped unheard" in rig.mavproxy.output(said)
        print(f"{pilots}, hidden {hidden} s: mode {mode(rig)}, {len(modes)} modes sent, unheard {unheard}")
        if unheard:
            assert hidden and mode(rig) == "BRAKE"
        else:
            assert (mode(rig), modes) == (pilots, [])
    finally:
        requests.delete(rig.url + "/envelope", timeout=10)


def braking(rig):
    """The number of the job that stops it at the border."""
    jobs = rig.ok(rig.get("/jobs"))["jobs"]
    return next((job["job"] for job in jobs if job["state"] == "running" and "brake at" in job["verb"]), None)


@on_ardupilot
def test_mission_that_is_about_to_be_flown_is_not_replaced(rig, harness):
    rig.in_the_air(10)
    plain = {"data": WPL, "headers": {"Content-Type": "text/plain"}, "timeout": 60}
    rig.ok(requests.post(rig.url + "/mission/waypoints", **plain))
    starting = rig.begin("POST", "/mission/start")
    rig.control.fault("hide", message="HEARTBEAT", seconds=1.5)
    time.sleep(0.3)
    other = requests.post(rig.url + "/mission/waypoints", **{**plain, "data": WPL.replace("12\t1", "30\t1")})
    assert (other.status_code, other.json().get("code")) == (409, "busy"), other.text
    rig.ok(starting.answer(60))
    assert mode(rig) == "AUTO"
    rig.ok(rig.get("/command/brake"))
