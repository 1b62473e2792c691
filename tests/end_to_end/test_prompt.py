"""A pilot's own commands at MAVProxy's prompt, beside ours."""

from __future__ import annotations

import json

from tests.end_to_end.test_waypoints import JSON, WPL, commands
from tests.support.processes import SPEEDUP

RIG_LOGS = True


def test_mode_that_the_pilot_types_ends_the_movement(rig):
    rig.in_the_air(10)
    x, y, z = rig.ned()
    waiting = rig.begin("POST", "/movement/go_to_ned_wait", {"x": x + 4000, "y": y, "z": z})
    rig.until(lambda: abs(rig.ned()[0] - x) > 2, what="its moving")
    rig.mavproxy.type("mode LOITER")
    answer = waiting.answer(60)
    assert (answer.status_code, answer.json()["code"]) == (409, "mode_changed")
    assert rig.status()["mode"] == "LOITER"
    rig.ok(rig.get("/command/rtl"))


def test_stream_that_somebody_turned_off_is_requested_again(rig):
    rig.mavproxy.ask("long SET_MESSAGE_INTERVAL 33 -1", "ACCEPTED")  # GLOBAL_POSITION_INT
    before = rig.ok(rig.get("/telemetry/message/GLOBAL_POSITION_INT", max_age=60))["info"]["count"]
    rig.until(
        lambda: rig.ok(rig.get("/telemetry/message/GLOBAL_POSITION_INT", max_age=60))["info"]["count"] > before + 10,
        20,
        "its coming again",
    )
    assert rig.ok(rig.get("/telemetry/gps"))["age_s"] < 2


def test_raw_message_is_the_vehicles_command_once_it_is_allowed(rig):
    mode = {"command": "MAV_CMD_DO_SET_MODE", "confirmation": 0, "param1": 1, "param2": 2}
    body = {"name": "COMMAND_LONG", "fields": mode | {f"param{number}": 0 for number in range(3, 8)}}
    assert rig.post("/message", **body).json()["code"] == "forbidden"
    rig.set("allow_raw", "True")
    accepted = rig.until(lambda: (answer := rig.post("/message", **body)).ok and answer, what="an ack in time")
    assert accepted.json()["result"] == "COMMAND_LONG accepted"
    rig.until(lambda: rig.status()["mode"] == "ALT_HOLD", 5, "mode ALT_HOLD")
    rig.ok(rig.get("/command/guided"))


def test_mavproxys_own_wp_module_still_works_beside_ours(rig, tmp_path):
    file = tmp_path / "own.txt"
    file.write_text(WPL)
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=1))  # it gives an upload up after 8 s of its clock
    rig.mavproxy.ask(f"wp load {file}", "Sent all 6 waypoints")
    assert commands(rig)[0] == "NAV_TAKEOFF"
    rig.ok(rig.post("/mission/waypoints", **JSON))
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=SPEEDUP))
    rig.mavproxy.ask("wp list", "Saved 5 waypoints")


def sent_by(entry):
    """The names of the messages, however often each was sent: on a busy machine an ack comes late."""
    return {name.partition(" x")[0] for name in entry["sent"]}


def test_the_audit_trail_reports_who_requested_what_and_what_was_sent(rig):
    rig.on_the_ground()
    rig.ok(rig.get("/command/set_home"))
    rig.get("/command/takeoff?alt=3")
    location = rig.get("/command/guided?wait=false").headers["Location"]
    rig.until(lambda: rig.get(location).json()["state"] == "succeeded", 10, "GUIDED")
    output = rig.mavproxy.ask("uavapi log 5", "all of them:")
    assert "127.0.0.1 /command/set_home()" in output
    file = rig.directory / "uavapi-audit.jsonl"
    entries = {entry.get("verb"): entry for entry in map(json.loads, file.read_text(encoding="utf-8").splitlines())}
    home, takeoff, guided = (entries[f"/command/{verb}"] for verb in ("set_home", "takeoff", "guided"))
    assert (home["outcome"], sent_by(home)) == ("ok", {"COMMAND_LONG"})
    assert (takeoff["outcome"], takeoff["sent"], takeoff["request"]["alt"]) == ("not_armed", [], 3)
    assert (guided["outcome"], guided["client"], sent_by(guided)) == ("ok", "127.0.0.1", {"COMMAND_LONG"})
