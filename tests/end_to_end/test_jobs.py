"""Jobs: verbs that are not waited for, and clients that go away."""

from __future__ import annotations

import json
import math
import threading
import time

import pytest
import requests


def far(rig, by=400):
    x, y, z = rig.ned()
    return {"x": x + (by if x < 0 else -by), "y": y, "z": z}


def job_of(rig, location):
    return requests.get(rig.url + location, timeout=10).json()


@pytest.mark.parametrize("headers,query", [({}, "?wait=false"), ({"Prefer": "respond-async"}, "")])
def test_verb_that_is_not_waited_for_is_a_job_with_progress(faulty_rig, harness, headers, query):
    rig = faulty_rig
    rig.in_the_air(10)
    x, y, z = rig.ned()
    body = {"x": x + (40 if x < 0 else -40), "y": y, "z": z}
    answer = requests.post(f"{rig.url}/movement/go_to_ned_wait{query}", json=body, headers=headers, timeout=10)
    assert answer.status_code == 202
    location = answer.headers["Location"]
    job = harness.eventually(lambda: (j := job_of(rig, location))["progress"] and j, 5, "progress")
    assert job["verb"] == "/movement/go_to_ned_wait"
    assert 0 <= job["progress"]["distance_to_go"] <= 45
    job = harness.eventually(lambda: (j := job_of(rig, location))["state"] != "running" and j, 30, "its end")
    assert job["state"] == "succeeded"
    assert job["result"].startswith("Arrived at NED coord")
    assert location.rpartition("/")[2] in [j["job"] for j in rig.ok(rig.get("/jobs"))["jobs"]]


def test_aborted_movement_stops_and_holds(faulty_rig, harness):
    rig = faulty_rig
    rig.in_the_air(10)
    answer = requests.post(f"{rig.url}/movement/go_to_ned_wait?wait=false", json=far(rig), timeout=10)
    time.sleep(0.8)
    aborted = requests.delete(rig.url + answer.headers["Location"], timeout=10)
    assert aborted.status_code == 200
    assert aborted.json()["state"] == "failed"
    assert aborted.json()["error"]["code"] == "aborted"
    harness.eventually(lambda: speed(rig) < 0.3, 10, "standing still")
    assert requests.delete(rig.url + answer.headers["Location"], timeout=10).status_code == 409
    assert requests.delete(rig.url + "/jobs/999999", timeout=10).status_code == 404


def speed(rig):
    velocity = rig.ok(rig.get("/telemetry/ned"))["info"]["velocity"]
    return math.hypot(velocity["vx"], velocity["vy"], velocity["vz"])


def test_aborted_landing_brakes(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(30)
    answer = rig.get("/command/land?wait=false")
    time.sleep(0.5)
    assert requests.delete(rig.url + answer.headers["Location"], timeout=10).status_code == 200
    assert rig.status()["mode"] == "BRAKE"
    rig.ok(rig.get("/command/guided"))


def hang_up(rig, path, body=None, after=0.5):
    """Ask, and hang up without waiting for the answer."""
    session = requests.Session()
    try:
        session.request("POST" if body else "GET", rig.url + path, json=body, timeout=(5, after))
    except requests.ReadTimeout:
        session.close()
    else:
        raise AssertionError("it answered too soon")


def test_client_that_hangs_up_leaves_the_vehicle_to_its_setpoint(faulty_rig, harness):
    rig = faulty_rig
    rig.in_the_air(10)
    target = far(rig, 60)
    hang_up(rig, "/movement/go_to_ned_wait", target)
    harness.eventually(lambda: running(rig) == [], 5, "the end of its verb")
    harness.eventually(lambda: abs(rig.ned()[0] - target["x"]) < 1, 30, "the arrival all the same")


def running(rig):
    return [job["verb"] for job in rig.ok(rig.get("/jobs"))["jobs"] if job["state"] == "running"]


def set_on_disconnect(rig, value):
    rig.mavproxy.type(f"uavapi set on_disconnect {value}")
    rig.mavproxy.ask("uavapi set on_disconnect", f" {value} ")


def test_client_that_hangs_up_stops_the_vehicle_where_that_is_wanted(faulty_rig, harness):
    rig = faulty_rig
    rig.in_the_air(10)
    set_on_disconnect(rig, "hold")
    try:
        target = far(rig)
        hang_up(rig, "/movement/go_to_ned_wait", target, after=0.8)
        harness.eventually(lambda: speed(rig) < 0.3, 10, "standing still")
        assert abs(rig.ned()[0] - target["x"]) > 100
    finally:
        set_on_disconnect(rig, "continue")


def test_hanging_up_on_a_command_that_steers_nothing_stops_no_flight(faulty_rig, harness):
    rig = faulty_rig
    rig.in_the_air(10)
    set_on_disconnect(rig, "hold")
    rig.control.fault("lose_acks", command=178)
    try:
        rig.post("/movement/go_to_ned_wait?wait=false", **far(rig))
        hang_up(rig, "/command/set_ground_speed?new_v=6")
        harness.eventually(lambda: running(rig) == ["/movement/go_to_ned_wait"], 5, "the end of the speed's job")
        before = rig.ned()
        time.sleep(0.5)
        assert math.dist(before, rig.ned()) > 5
    finally:
        rig.control.ask("clear")
        set_on_disconnect(rig, "continue")
        rig.ok(rig.get("/command/brake"))
        rig.ok(rig.get("/command/guided"))


@pytest.mark.parametrize("verb", ["rtl", "land"])
def test_going_home_is_not_undone_by_hanging_up(faulty_rig, harness, verb):
    rig = faulty_rig
    rig.in_the_air(10)
    set_on_disconnect(rig, "hold")
    try:
        hang_up(rig, f"/command/{verb}")
        harness.eventually(lambda: rig.status()["armed"] is False, 60, "its landing")
    finally:
        set_on_disconnect(rig, "continue")


def test_identical_request_joins_the_job_in_flight(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(15)
    answers = []
    clients = [threading.Thread(target=lambda: answers.append(rig.get("/command/land"))) for _ in range(5)]
    for client in clients:
        client.start()
    for client in clients:
        client.join(60)
    assert [answer.status_code for answer in answers] == [200] * 5


def test_two_clients_hammering_are_all_answered_and_the_last_one_wins(faulty_rig, harness):
    rig = faulty_rig
    rig.in_the_air(10)
    x, y, z = rig.ned()
    lasts = 60 if rig.is_ardupilot else 8  # s; tests/rules has the minute for the embedded vehicle, in virtual time
    statuses, ends = [], time.monotonic() + lasts

    def hammer(sign):
        number = 0
        while time.monotonic() < ends:
            number += 1
            before = time.monotonic()
            answer = rig.post("/movement/go_to_ned_wait", x=x + sign * (20 + number % 7), y=y, z=z)
            statuses.append((answer.status_code, answer.json().get("code"), time.monotonic() - before))

    clients = [threading.Thread(target=hammer, args=(sign,)) for sign in (1, -1)]
    for client in clients:
        client.start()
    for client in clients:
        client.join(60)
    assert {status[:2] for status in statuses} <= {(409, "superseded"), (200, None)}
    assert max(status[2] for status in statuses) < 30
    assert len(statuses) > 20
    rig.ok(rig.post("/movement/go_to_ned_wait", x=x, y=y, z=z))
    assert math.dist(rig.ned(), (x, y, z)) < 1.5


def test_timeout_of_the_client_is_kept(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    before = time.monotonic()
    answer = requests.post(rig.url + "/movement/go_to_ned_wait", json={**far(rig, 4000), "timeout": 1}, timeout=30)
    assert answer.status_code == 504
    assert answer.json()["code"] == "timeout"
    assert time.monotonic() - before < 4
    rig.ok(rig.get("/command/brake"))
    rig.ok(rig.get("/command/guided"))


def test_reboot_in_flight_ends_the_verb_and_resets_what_is_known(faulty_rig, harness):
    rig = faulty_rig
    rig.in_the_air(10)
    answers = []
    target = far(rig)
    waiting = threading.Thread(target=lambda: answers.append(rig.post("/movement/go_to_ned_wait", **target)))
    waiting.start()
    time.sleep(0.5)
    rig.control.fault("reboot")
    waiting.join(20)
    assert answers and answers[0].status_code in (409, 503)
    # The first attempts may come before its estimator is ready again: they are refused, and none hangs.
    harness.eventually(lambda: rig.get("/command/arm").status_code == 200, 30, "arming after the reboot")
    rig.ok(rig.get("/command/disarm"))


def test_the_trail_tells_who_asked_for_what_and_what_was_sent(faulty_rig, harness):
    rig = faulty_rig
    rig.on_the_ground()
    rig.ok(rig.get("/command/set_home"))
    rig.get("/command/takeoff?alt=3")
    location = rig.get("/command/guided?wait=false").headers["Location"]
    harness.eventually(lambda: job_of(rig, location)["state"] == "succeeded", 10, "GUIDED")
    said = rig.mavproxy.ask("uavapi log 5", "all of them:")
    assert "127.0.0.1 /command/set_home()" in said
    file = rig.directory / "uavapi-audit.jsonl"
    entries = {entry["verb"]: entry for entry in map(json.loads, file.read_text(encoding="utf-8").splitlines())}
    home, takeoff, guided = (entries[f"/command/{verb}"] for verb in ("set_home", "takeoff", "guided"))
    assert (home["outcome"], set(home["sent"])) == ("ok", {"COMMAND_LONG"})
    assert (takeoff["outcome"], takeoff["sent"], takeoff["request"]["alt"]) == ("not_armed", [], 3)
    assert (guided["outcome"], guided["client"], set(guided["sent"])) == ("ok", "127.0.0.1", {"COMMAND_LONG"})
