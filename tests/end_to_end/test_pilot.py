"""The pilot's hand: whoever changes the mode at MAVProxy's prompt, or by the RC switch, has the vehicle."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest
import requests

OURS = {"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "COMMAND_LONG", "COMMAND_INT", "SET_MODE"}


class Background:
    """A request that waits, in a thread of its own."""

    def __init__(self, request: Callable[[], requests.Response]) -> None:
        self.answer: requests.Response | None = None
        self.took = 0.0
        self._thread = threading.Thread(target=self._run, args=(request,))
        self._thread.start()

    def _run(self, request: Callable[[], requests.Response]) -> None:
        before = time.monotonic()
        self.answer = request()
        self.took = time.monotonic() - before

    def join(self, timeout: float) -> requests.Response:
        self._thread.join(timeout)
        assert self.answer is not None, f"no answer within {timeout} s"
        return self.answer


def far(rig):
    x, y, z = rig.ned()
    return {"x": x + (400 if x < 0 else -400), "y": y, "z": z}


WAITING = {
    "go_to_ned_wait": lambda rig: rig.post("/movement/go_to_ned_wait", **far(rig)),
    "drive_wait": lambda rig: rig.post("/movement/drive_wait", x=400, y=0, z=0),
    "travel": lambda rig: rig.post("/movement/travel_at_ned", vx=1, vy=0, vz=0, duration=300),
    "rtl": lambda rig: rig.get("/command/rtl"),
    "land": lambda rig: rig.get("/command/land"),
}


@pytest.mark.parametrize("verb", WAITING)
def test_pilot_mode_change_ends_the_verb_and_nothing_more_is_sent(faulty_rig, verb):
    rig = faulty_rig
    rig.in_the_air(30)
    waiting = Background(lambda: WAITING[verb](rig))
    time.sleep(0.4)
    rig.mavproxy.type("mode LOITER")
    answer = waiting.join(10)
    assert answer.status_code == 409
    assert answer.json()["code"] == "mode_changed"
    assert "LOITER" in answer.json()["detail"]
    assert_nothing_is_sent(rig, 1.5)
    assert rig.status()["mode"] == "LOITER"


def assert_nothing_is_sent(rig, seconds):
    since = rig.control.ask("received", since=0)["last"]
    time.sleep(seconds)
    received = rig.control.ask("received", since=since)["messages"]
    assert [m for m in received if m["name"] in OURS] == []


def test_pilot_rc_switch_ends_a_takeoff(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(5)
    rig.on_the_ground()
    rig.ok(rig.get("/command/arm"))
    waiting = Background(lambda: rig.get("/command/takeoff", alt=200))
    time.sleep(1)
    rig.control.fault("pilot_mode", mode="BRAKE")
    answer = waiting.join(5)
    assert answer.status_code == 409
    assert answer.json()["code"] == "mode_changed"
    assert "BRAKE" in answer.json()["detail"]
    rig.ok(rig.get("/command/guided"))


def test_arm_does_not_take_a_flying_vehicle_from_its_pilot(faulty_rig, harness):
    rig = faulty_rig
    rig.in_the_air(10)
    rig.mavproxy.type("mode LOITER")
    harness.eventually(lambda: rig.status()["mode"] == "LOITER", 5, "mode LOITER")
    answer = rig.get("/command/arm")
    assert answer.status_code == 409
    assert answer.json()["code"] == "mode_changed"
    assert rig.status()["mode"] == "LOITER"


def test_a_newer_command_supersedes_the_one_in_flight(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    waiting = Background(lambda: rig.post("/movement/go_to_ned_wait", **far(rig)))
    time.sleep(0.3)
    x, y, z = rig.ned()
    newer = Background(lambda: rig.post("/movement/go_to_ned_wait", x=x, y=y, z=z))
    answer = waiting.join(3)
    assert answer.status_code == 409
    assert answer.json()["code"] == "superseded"
    assert "/movement/go_to_ned_wait" in answer.json()["detail"]
    assert newer.join(60).status_code == 200


def test_link_loss_ends_the_verb_and_all_recovers(faulty_rig, harness):
    rig = faulty_rig
    rig.in_the_air(10)
    waiting = Background(lambda: rig.post("/movement/go_to_ned_wait", **far(rig)))
    time.sleep(0.3)
    rig.control.fault("silence")
    answer = waiting.join(15)
    assert answer.status_code == 503
    assert answer.json()["code"] == "link_lost"
    assert rig.get("/command/guided").json()["code"] == "link_lost"
    harness.eventually(lambda: rig.get("/telemetry/gps").json().get("code") == "stale", 10, "going stale")
    rig.control.ask("clear")
    harness.eventually(lambda: rig.get("/telemetry/gps").status_code == 200, 10, "the link's return")
    harness.eventually(lambda: rig.ok(rig.get("/telemetry/status"))["age_s"] < 2, 10, "the next heartbeat")
    rig.ok(rig.post("/movement/drive_wait", x=1, y=0, z=0))


def test_stream_that_somebody_turned_off_is_asked_for_again(faulty_rig, harness):
    rig = faulty_rig
    rig.mavproxy.ask("long SET_MESSAGE_INTERVAL 33 -1", "ACCEPTED")  # GLOBAL_POSITION_INT
    before = rig.ok(rig.get("/telemetry/message/GLOBAL_POSITION_INT", max_age=60))["info"]["count"]
    harness.eventually(
        lambda: rig.ok(rig.get("/telemetry/message/GLOBAL_POSITION_INT", max_age=60))["info"]["count"] > before + 10,
        20,
        "its coming again",
    )
    assert rig.ok(rig.get("/telemetry/gps"))["age_s"] < 2


def test_lost_and_foreign_acks(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    rig.control.fault("lose_acks", command=178, count=2)
    rig.ok(rig.get("/command/set_ground_speed", new_v=5))
    rig.control.ask("clear")
    rig.control.fault("foreign_ack", command=178)
    rig.control.fault("refuse", command=178, result=4, text="No.", count=1)
    refused = rig.get("/command/set_ground_speed", new_v=5)
    assert refused.status_code == 500
    assert refused.json()["code"] == "rejected"
    assert refused.json()["ack"] == "MAV_RESULT_FAILED"
    assert "No." in refused.json()["statustext"]
    rig.control.ask("clear")


@pytest.mark.long
def test_arm_says_why_it_cannot(harness, tmp_path):
    rig = harness.embedded(tmp_path, "--ready-after=100000")
    try:
        answer = rig.get("/command/arm?timeout=4")
        assert answer.status_code == 500
        assert answer.json()["code"] == "rejected"
        assert any("PreArm" in text or "Arm:" in text for text in answer.json()["statustext"])
        assert rig.status()["ready_to_arm"] is False
        assert rig.status()["why_not"]
    finally:
        rig.stop()
