"""The pilot's hand: whoever changes the mode, at MAVProxy's prompt or by the RC switch, has the vehicle."""

from __future__ import annotations

import pytest

OURS = {"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "COMMAND_LONG", "COMMAND_INT", "SET_MODE"}


def far(rig):
    x, y, z = rig.ned()
    return {"x": x + (400 if x < 0 else -400), "y": y, "z": z}


WAITING = {
    "go_to_ned_wait": lambda rig: rig.begin("POST", "/movement/go_to_ned_wait", far(rig)),
    "drive_wait": lambda rig: rig.begin("POST", "/movement/drive_wait", {"x": 400, "y": 0, "z": 0}),
    "travel": lambda rig: rig.begin("POST", "/movement/travel_at_ned", {"vx": 1, "vy": 0, "vz": 0, "duration": 300}),
    "rtl": lambda rig: rig.begin("GET", "/command/rtl"),
    "land": lambda rig: rig.begin("GET", "/command/land"),
}


@pytest.mark.parametrize("verb", WAITING)
def test_pilot_mode_change_ends_the_verb_and_nothing_more_is_sent(faulty_rig, verb):
    rig = faulty_rig
    rig.in_the_air(30)
    waiting = WAITING[verb](rig)
    rig.pass_time(0.4)
    rig.switch_mode("LOITER")
    answer = waiting.answer(10)
    assert answer.status_code == 409
    assert answer.json()["code"] == "mode_changed"
    assert "LOITER" in answer.json()["detail"]
    assert_nothing_is_sent(rig, 1.5)
    assert rig.status()["mode"] == "LOITER"


def assert_nothing_is_sent(rig, seconds):
    since = rig.control.ask("received", since=0)["last"]
    rig.pass_time(seconds)
    received = rig.control.ask("received", since=since)["messages"]
    assert [m for m in received if m["name"] in OURS] == []


def test_pilot_rc_switch_ends_a_takeoff(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(5)
    rig.on_the_ground()
    rig.ok(rig.get("/command/arm"))
    waiting = rig.begin("GET", "/command/takeoff?alt=200")
    rig.pass_time(1)
    rig.control.fault("pilot_mode", mode="BRAKE")
    answer = waiting.answer(5)
    assert answer.status_code == 409
    assert answer.json()["code"] == "mode_changed"
    assert "BRAKE" in answer.json()["detail"]
    rig.ok(rig.get("/command/guided"))


def test_arm_does_not_take_a_flying_vehicle_from_its_pilot(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    rig.switch_mode("LOITER")
    rig.until(lambda: rig.status()["mode"] == "LOITER", 5, "mode LOITER")
    answer = rig.get("/command/arm")
    assert answer.status_code == 409
    assert answer.json()["code"] == "mode_changed"
    assert rig.status()["mode"] == "LOITER"


def test_a_newer_command_supersedes_the_one_in_flight(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    waiting = rig.begin("POST", "/movement/go_to_ned_wait", far(rig))
    rig.pass_time(0.3)
    x, y, z = rig.ned()
    newer = rig.begin("POST", "/movement/go_to_ned_wait", {"x": x, "y": y, "z": z})
    answer = waiting.answer(3)
    assert answer.status_code == 409
    assert answer.json()["code"] == "superseded"
    assert "/movement/go_to_ned_wait" in answer.json()["detail"]
    assert newer.answer(60).status_code == 200


def test_link_loss_ends_the_verb_and_all_recovers(faulty_rig):
    rig = faulty_rig
    rig.in_the_air(10)
    waiting = rig.begin("POST", "/movement/go_to_ned_wait", far(rig))
    rig.pass_time(0.3)
    rig.control.fault("silence")
    answer = waiting.answer(15)
    assert answer.status_code == 503
    assert answer.json()["code"] == "link_lost"
    assert rig.get("/command/guided").json()["code"] == "link_lost"
    rig.until(lambda: rig.get("/telemetry/gps").json().get("code") == "stale", 10, "going stale")
    rig.control.ask("clear")
    rig.until(lambda: rig.get("/telemetry/gps").status_code == 200, 10, "the link's return")
    rig.until(lambda: rig.ok(rig.get("/telemetry/status"))["age_s"] < 2, 10, "the next heartbeat")
    rig.ok(rig.post("/movement/drive_wait", x=1, y=0, z=0))


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
