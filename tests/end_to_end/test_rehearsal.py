"""`mavproxy-uavapi run`: scripts with a mistake that no good flight shows, and a mission, on real processes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import requests

from tests.support.ports import free_port

pytestmark = pytest.mark.long

CALLS = """
import os, sys, requests
url = os.environ["UAVAPI_URL"]
def call(path, **values):
    answer = requests.post(url + path, json=values, timeout=600)
    print(path, answer.status_code, answer.text)
    return answer.ok
def need(done):
    if not done:
        sys.exit("it failed")
"""
# It holds its place where the others do not: what it asks for after a failure is nothing.
CAREFUL = (
    CALLS
    + """
need(call("/command/arm"))
need(call("/command/takeoff", alt=10))
need(call("/movement/drive_wait", x=25, y=0, z=0))
need(call("/movement/drive_wait", x=0, y=25, z=0))
need(call("/command/rtl"))
"""
)
CARELESS = CAREFUL.replace("need(call", "(call")
EXAMPLES = Path(__file__).parents[2] / "examples"
MISTAKES = EXAMPLES / "mistakes"
MISSION = {
    "items": [
        {"command": "NAV_TAKEOFF", "alt": 10},
        {"command": "NAV_WAYPOINT", "lat": -35.363, "long": 149.16523, "alt": 10},
        {"command": "NAV_RETURN_TO_LAUNCH"},
    ]
}
WELL, FAILED, BROKEN = 0, 1, 2


def rehearsed(folder: Path, name: str, text: str, *options: str) -> tuple[int, dict[str, Any], str]:
    """The exit status, the first flight of the report, and what was printed."""
    (folder / name).write_text(text)
    command = [sys.executable, "-c", "from mavproxy_uavapi.commands import main; raise SystemExit(main())", "run"]
    where = [] if any(option.startswith("--like") for option in options) else ["--location=CMAC"]
    command += [str(folder / name), *where, f"--report={folder / 'report.json'}", *options]
    done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True)
    assert (folder / "report.json").exists(), done.stdout + done.stderr
    report = json.loads((folder / "report.json").read_text())
    return done.returncode, report["flights"][0], done.stdout


def rules(flight: dict[str, Any]) -> list[str]:
    return [one["rule"] for one in flight["broken"]]


def test_script_that_flies_well_is_told_so_with_its_way(tmp_path: Path) -> None:
    status, flight, said = rehearsed(tmp_path, "careful.py", CAREFUL, f"--report={tmp_path / 'report.html'}")
    assert (status, flight["broken"], flight["failure"]) == (WELL, [], ""), said
    assert [one["verb"] for one in flight["commands"]][:2] == ["/command/arm", "/command/takeoff"]
    vehicle = flight["vehicles"]["1"]
    assert vehicle["distance_m"] > 80 and 9 < vehicle["highest_m"] < 16  # it returns at RTL_ALT
    assert "From above" in (tmp_path / "report.html").read_text()


def test_script_that_goes_on_after_the_pilots_switch_is_told(tmp_path: Path) -> None:
    fault = "--fault=pilot_mode=LOITER@leg1"
    status, flight, said = rehearsed(tmp_path, "careless.py", CARELESS, fault)
    assert (status, rules(flight)[0]) == (BROKEN, "pilot"), said
    status, flight, said = rehearsed(tmp_path, "careful.py", CAREFUL, fault)
    assert "pilot" not in rules(flight), said  # it ends; its pilot has the vehicle


def test_script_whose_end_leaves_the_vehicle_in_the_air_is_told(tmp_path: Path) -> None:
    status, flight, said = rehearsed(tmp_path, "careful.py", CAREFUL, "--fault=script_killed@leg2")
    assert (status, rules(flight)) == (BROKEN, ["ended"]), said


def test_vehicle_whose_companion_is_killed_is_watched_to_its_end(tmp_path: Path) -> None:
    status, flight, said = rehearsed(tmp_path, "mission.json", json.dumps(MISSION), "--fault=companion_killed@item2")
    assert (status, flight["broken"]) == (WELL, []), said  # the autopilot flies its mission without us
    assert flight["vehicles"]["1"]["samples"][-1][7] is False  # it is disarmed


def test_fault_that_cannot_begin_is_one_line_and_status_3(tmp_path: Path) -> None:
    (tmp_path / "careful.py").write_text(CAREFUL)
    command = [sys.executable, "-c", "from mavproxy_uavapi.commands import main; raise SystemExit(main())", "run"]
    command += ["careful.py", "--fault=pilot_mode=NOWHERE@leg1"]
    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr.count("\n")) == (3, 1), done.stderr
    assert "no mode is called NOWHERE" in done.stderr


@pytest.mark.parametrize(
    ("name", "shown_by", "rule"),
    [
        ("after_the_pilot.py", "--fault=pilot_mode=LOITER@leg2", "pilot"),
        ("no_end.py", "--fault=link_loss@leg2:8s", "ended"),
        ("through_the_mast.py", f"--envelope={MISTAKES / 'field.geojson'}", "envelope"),
    ],
)
def test_mistake_of_the_examples_flies_well_until_it_is_shown(
    tmp_path: Path, name: str, shown_by: str, rule: str
) -> None:
    text = (MISTAKES / name).read_text(encoding="utf-8")
    status, flight, said = rehearsed(tmp_path, name, text)
    assert (status, flight["broken"]) == (WELL, []), said
    status, flight, said = rehearsed(tmp_path, name, text, shown_by)
    assert (status, rules(flight)) == (BROKEN, [rule]), said


BY_MAVLINK = """
import os
from pymavlink import mavutil
try:
    os.open("/dev/ttyS0", os.O_RDWR)
except PermissionError as error:
    print(error)
assert mavutil.mavlink_connection("tcp:localhost:5760").wait_heartbeat(timeout=5)
link = mavutil.mavlink_connection("udp:127.0.0.1:12345")
link.wait_heartbeat(timeout=5)
link.set_mode("GUIDED")
link.arducopter_arm()
link.motors_armed_wait()
link.mav.command_long_send(1, 1, mavutil.mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0, 5)
while link.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=5).relative_alt < 4500:
    pass
link.set_mode_rtl()
link.motors_disarmed_wait()
print("landed")
"""


def test_program_that_speaks_mavlink_finds_the_rehearsed_vehicle_where_it_expects_one(tmp_path: Path) -> None:
    options = ("--mavlink-port=12345", "--fault=pilot_mode=LOITER@4m")  # after which it sends RTL
    status, flight, said = rehearsed(tmp_path, "a.py", BY_MAVLINK, *options)
    assert (status, rules(flight)) == (BROKEN, ["pilot"]), said
    assert flight["output"].splitlines()[0].startswith("a rehearsal opens no /dev/ttyS0")
    assert flight["output"].endswith("landed\n") and flight["commands"][-1]["verb"] == "MAVLink COMMAND_LONG"


def test_landing_by_camera_of_the_examples_is_flown(tmp_path: Path) -> None:
    pytest.importorskip("cv2")
    (tmp_path / "client.py").write_text((EXAMPLES / "client.py").read_text(encoding="utf-8"))
    text = (EXAMPLES / "tag_landing.py").read_text(encoding="utf-8")
    status, flight, said = rehearsed(tmp_path, "tag_landing.py", text)
    assert (status, flight["broken"]) == (WELL, []), said
    assert "Landed on tag 0" in flight["output"]


def test_mission_is_flown_to_its_end(tmp_path: Path) -> None:
    status, flight, said = rehearsed(tmp_path, "mission.json", json.dumps(MISSION), "--wind=4,90", "--seed=7")
    assert (status, flight["broken"]) == (WELL, []), said
    assert flight["vehicles"]["1"]["distance_m"] > 50


def test_what_cannot_be_flown_is_one_line_and_status_3(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from mavproxy_uavapi.commands import main; raise SystemExit(main())", "run"]
    done = subprocess.run([*command, "no.py"], cwd=tmp_path, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (3, "mavproxy-uavapi run: there is no file no.py\n")


LIKE = (
    CALLS
    + """
print("items", len(requests.get(url + "/mission/waypoints").json()["items"]))
print("returns at", requests.get(url + "/parameters/RTL_ALT_M").json()["value"])
need(call("/command/arm"))
need(call("/command/takeoff", alt=10))
call("/movement/drive_wait", x=25, y=0, z=0)
need(call("/command/rtl"))
"""
)


def test_likeness_of_a_vehicle_has_its_home_parameters_mission_and_envelope(
    tmp_path: Path, harness: ModuleType
) -> None:
    rig = harness.embedded(tmp_path, speedup=4)
    try:
        rig.until(lambda: rig.status()["ready_to_arm"], 90, "its being ready")
        aside = [{**item, **({"long": 149.167} if "long" in item else {})} for item in MISSION["items"]]
        rig.ok(rig.post("/mission/waypoints", items=aside))
        rig.ok(requests.put(f"{rig.url}/parameters/RTL_ALT_M", json={"value": 23}, timeout=60))
        body = (MISTAKES / "field.geojson").read_text(encoding="utf-8")
        rig.ok(requests.put(f"{rig.url}/envelope", data=body, timeout=60))
        status, flight, said = rehearsed(tmp_path, "like.py", LIKE, f"--like={rig.url}")
    finally:
        rig.stop()
    assert status == BROKEN and "envelope" in rules(flight), said
    assert "items 3\nreturns at 23.0" in flight["output"]
    first = flight["vehicles"]["1"]["samples"][0]
    assert first[1:3] == pytest.approx([-35.363261, 149.165230], abs=1e-4)


def test_mission_is_flown_once_it_was_rehearsed_on_its_own_machine(
    tmp_path: Path, harness: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))  # nobody has rehearsed it there
    rig = harness.embedded(tmp_path, speedup=4, rehearse="require")
    try:
        rig.until(lambda: rig.status()["ready_to_arm"], 90, "its being ready")
        rig.ok(rig.post("/mission/waypoints", **MISSION))
        rig.ok(rig.get("/command/arm"))
        assert rig.post("/mission/start").json()["code"] == "not_rehearsed"
        rig.ok(rig.get("/command/disarm"))
        rig.ok(rig.post("/rehearsals"))
        newest = rig.get("/rehearsals", until_ended="true", timeout=600).json()["newest"]
        assert newest["verdict"] == "well", newest
        assert newest["highest_m"] > 9 and newest["way"]
        rig.ok(rig.get("/command/arm"))
        rig.ok(rig.post("/mission/start", until_complete=True))
    finally:
        rig.stop()


def test_vehicle_that_does_not_answer_has_no_likeness(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("")
    command = [sys.executable, "-c", "from mavproxy_uavapi.commands import main; raise SystemExit(main())", "run"]
    command += [str(tmp_path / "a.py"), f"--like=http://127.0.0.1:{free_port()}"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (3, 1) and "--like" in done.stderr


@pytest.mark.parametrize("program", ["hard.py", "hard.sh"])
def test_script_that_names_the_vehicles_own_api_commands_nothing_in_its_rehearsal(
    tmp_path: Path, harness: ModuleType, program: str
) -> None:
    """As scripts for uav_api do: http://localhost:8000 is written in them."""
    rig = harness.embedded(tmp_path, speedup=4)
    try:
        rig.until(lambda: rig.status()["ready_to_arm"], 90, "its being ready")
        text = CALLS.replace('os.environ["UAVAPI_URL"]', f'"{rig.url}"') + 'need(call("/command/arm"))\n'
        if program.endswith(".sh"):
            text = f"#!/bin/sh\nexec curl --fail-with-body {rig.url}/command/arm\n"
        rig.ok(requests.post(f"{rig.url}/mission/upload-script", files={"file": (program, text)}, timeout=60))
        rig.ok(rig.post("/rehearsals", script_name=program))
        newest = rig.get("/rehearsals", until_ended="true", timeout=600).json()["newest"]
        if program.endswith(".py"):  # it is led to the rehearsed vehicle
            assert newest["verdict"] == "well", newest
        else:
            assert newest["verdict"] != "well" and "rehearsal" in newest["output"], newest
        assert rig.status()["armed"] is False
        rig.ok(rig.get("/command/arm"))  # everybody else still may
    finally:
        rig.stop()
