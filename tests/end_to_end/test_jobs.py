"""Jobs: verbs that are not waited for, and clients that go away."""

from __future__ import annotations

import math

import pytest


def far(rig, by=400):
    x, y, z = rig.ned()
    return {"x": x + (by if x < 0 else -by), "y": y, "z": z}


def job_of(rig, location):
    return rig.get(location).json()


@pytest.mark.parametrize("headers,query", [({}, "?wait=false"), ({"Prefer": "respond-async"}, "")])
def test_verb_that_is_not_waited_for_is_a_job_with_progress(faulty_rig, headers, query):
    rig = faulty_rig
    rig.in_the_air(10)
    x, y, z = rig.ned()
    body = {"x": x + (40 if x < 0 else -40), "y": y, "z": z}
    answer = rig.call("POST", f"/movement/go_to_ned_wait{query}", json=body, headers=headers)
    assert answer.status_code == 202
    location = answer.headers["Location"]
    job = rig.until(lambda: (j := job_of(rig, location))["progress"] and j, 5, "progress")
    assert job["verb"] == "/movement/go_to_ned_wait"
    assert 0 <= job["progress"]["distance_to_go"] <= 45
    job = rig.until(lambda: (j := job_of(rig, location))["state"] != "running" and j, 30, "its end")
    assert job["state"] == "succeeded"
    assert job["result"].startswith("Arrived at NED coord")
    assert location.rpartition("/")[2] in [j["job"] for j in rig.ok(rig.get("/jobs"))["jobs"]]


def test_aborted_movement_stops_and_holds(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    answer = rig.post("/movement/go_to_ned_wait?wait=false", **far(rig))
    rig.pass_time(0.8)
    aborted = rig.delete(answer.headers["Location"])
    assert aborted.status_code == 200
    assert aborted.json()["state"] == "failed"
    assert aborted.json()["error"]["code"] == "aborted"
    rig.until(lambda: speed(rig) < 0.3, 10, "standing still")
    assert rig.delete(answer.headers["Location"]).status_code == 409
    assert rig.delete("/jobs/999999").status_code == 404


def speed(rig):
    velocity = rig.ok(rig.get("/telemetry/ned"))["info"]["velocity"]
    return math.hypot(velocity["vx"], velocity["vy"], velocity["vz"])


def test_aborted_landing_brakes(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(30)
    answer = rig.get("/command/land?wait=false")
    rig.pass_time(0.5)
    assert rig.delete(answer.headers["Location"]).status_code == 200
    assert rig.status()["mode"] == "BRAKE"
    rig.ok(rig.get("/command/guided"))


def test_client_that_hangs_up_leaves_the_vehicle_to_its_setpoint(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    target = far(rig, 60)
    rig.hang_up("POST", "/movement/go_to_ned_wait", target)
    rig.until(lambda: running(rig) == [], 5, "the end of its verb")
    rig.until(lambda: abs(rig.ned()[0] - target["x"]) < 1, 30, "the arrival all the same")


def running(rig):
    return [job["verb"] for job in rig.ok(rig.get("/jobs"))["jobs"] if job["state"] == "running"]


def test_client_that_hangs_up_stops_the_vehicle_where_that_is_wanted(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    rig.set("on_disconnect", "hold")
    try:
        target = far(rig)
        rig.hang_up("POST", "/movement/go_to_ned_wait", target, after=0.8)
        rig.until(lambda: speed(rig) < 0.3, 10, "standing still")
        assert abs(rig.ned()[0] - target["x"]) > 100
    finally:
        rig.set("on_disconnect", "continue")


def test_hanging_up_on_a_command_that_steers_nothing_stops_no_flight(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    rig.set("on_disconnect", "hold")
    rig.control.fault("lose_acks", command=178)
    try:
        rig.post("/movement/go_to_ned_wait?wait=false", **far(rig))
        rig.hang_up("GET", "/command/set_ground_speed?new_v=6")
        rig.until(lambda: running(rig) == ["/movement/go_to_ned_wait"], 5, "the end of the speed's job")
        before = rig.ned()
        rig.pass_time(0.5)
        assert math.dist(before, rig.ned()) > 5
    finally:
        rig.control.ask("clear")
        rig.set("on_disconnect", "continue")
        rig.ok(rig.get("/command/brake"))
        rig.ok(rig.get("/command/guided"))


@pytest.mark.parametrize("verb", ["rtl", "land"])
def test_going_home_is_not_undone_by_hanging_up(faulty_rig, verb):
    rig = faulty_rig
    rig.in_the_air(10)
    rig.set("on_disconnect", "hold")
    try:
        rig.hang_up("GET", f"/command/{verb}")
        rig.until(lambda: rig.status()["armed"] is False, 60, "its landing")
    finally:
        rig.set("on_disconnect", "continue")


def test_identical_request_joins_the_job_in_flight(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(15)
    calls = [rig.begin("GET", "/command/land") for _ in range(5)]
    answers = [call.answer(60) for call in calls]
    assert [answer.status_code for answer in answers] == [200] * 5


class Hammer:
    """A client that asks for another place as soon as it is answered."""

    def __init__(self, rig, sign, place):
        self._rig, self._sign, self._place = rig, sign, place
        self.outcomes, self.longest = [], 0.0
        self._ask()

    def _ask(self):
        x, y, z = self._place
        target = {"x": x + self._sign * (20 + len(self.outcomes) % 7), "y": y, "z": z}
        self._call, self._began = self._rig.begin("POST", "/movement/go_to_ned_wait", target), self._rig.now

    def go_on(self):
        if self._call.is_answered():
            self.end()
            self._ask()

    def end(self):
        answer = self._call.answer(60)
        self.outcomes.append((answer.status_code, answer.json().get("code")))
        self.longest = max(self.longest, self._rig.now - self._began)


def test_two_clients_hammering_are_all_answered_and_the_last_one_wins(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    place = x, y, z = rig.ned()
    clients = [Hammer(rig, sign, place) for sign in (1, -1)]
    ends = rig.now + 8
    while rig.now < ends:
        for client in clients:
            client.go_on()
        rig.pass_time(0.02)
    newest = rig.begin("POST", "/movement/go_to_ned_wait", {"x": x, "y": y, "z": z})
    for client in clients:
        client.end()
    assert rig.ok(newest.answer(60))
    assert math.dist(rig.ned(), place) < 1.5
    for client in clients:
        assert set(client.outcomes) <= {(409, "superseded"), (200, None)}
        assert client.longest < 30
        assert len(client.outcomes) > 10


def test_timeout_of_the_client_is_kept(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    before = rig.now
    answer = rig.call("POST", "/movement/go_to_ned_wait", json={**far(rig, 4000), "timeout": 1}, timeout=30)
    assert answer.status_code == 504
    assert answer.json()["code"] == "timeout"
    assert rig.now - before < 4
    rig.ok(rig.get("/command/brake"))
    rig.ok(rig.get("/command/guided"))


def test_reboot_in_flight_ends_the_verb_and_resets_what_is_known(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    waiting = rig.begin("POST", "/movement/go_to_ned_wait", far(rig))
    rig.pass_time(0.5)
    rig.control.fault("reboot")
    assert waiting.answer(20).status_code in (409, 503)
    # The first attempts may come before its estimator is ready again: they are refused, and none hangs.
    rig.until(lambda: rig.get("/command/arm").status_code == 200, 30, "arming after the reboot")
    rig.ok(rig.get("/command/disarm"))
