"""Mission scripts in real tmux sessions, flying a real vehicle by the API that started them."""

from __future__ import annotations

import json
import math
import subprocess
import time

import pytest
import requests

from tests.support.hostile_flights import ASKING

pytestmark = pytest.mark.needs("tmux")

GRACE = 60.0  # s; a script that lands needs some
SHORT_GRACE = 10.0
FLIES = """
import json, os, sys, time, urllib.request

def ask(path):
    request = urllib.request.Request(os.environ["UAVAPI_URL"] + path)
    with urllib.request.urlopen(request, timeout=100) as answer:
        return json.load(answer)

print("vehicle", os.environ["UAVAPI_SYSID"], *sys.argv[1:])
if sys.argv[1:] != ["early"]:
    ask("/command/arm")
    ask("/command/takeoff?alt=8")
print("flying")
try:
    time.sleep(100)
finally:
    print(ask("/command/land")["result"])
"""
DISTANCE = 120.0  # m: at speed-up 10 it takes a second or two to come so far
FAR = 2000.0  # m: it is on its way for long when the script is seen to have died
LEAVES = """
import json, os, sys, time, urllib.request

x, y = map(float, sys.argv[1:])
body = json.dumps({"x": x, "y": y, "z": -8}).encode()
url = os.environ["UAVAPI_URL"] + "/movement/go_to_ned"
urllib.request.urlopen(urllib.request.Request(url, body, {"Content-Type": "application/json"}), timeout=10)
time.sleep(0.3)
os._exit(5)
"""
STUBBORN = "trap '' INT\necho up\nwhile true; do sleep 0.1; done\n"


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rig(request, harness, tmp_path_factory):
    directory = tmp_path_factory.mktemp("scripts")
    folders = {"scripts_path": str(directory / "scripts"), "script_logs": str(directory / "logs")}
    rig = getattr(harness, request.param)(directory, script_grace=GRACE, **folders)
    for name, text in {"flies.py": FLIES, "leaves.py": LEAVES, "stubborn.sh": STUBBORN}.items():
        upload(rig, name, text)
    yield rig
    for run in rig.ok(rig.get("/mission/running-scripts"))["scripts"]:
        rig.ok(rig.post("/mission/stop-script", script_name=run["script"]))
    rig.stop()


def upload(rig, name, text):
    answer = requests.post(rig.url + "/mission/upload-script", files={"file": (name, text)}, timeout=10)
    rig.ok(answer)


def execute(rig, name, *args):
    return rig.ok(rig.post("/mission/execute-script", script_name=name, args=list(args)))


def show(rig, name):
    return rig.ok(rig.get(f"/mission/scripts/{name}"))["run"]


def test_script_flies_is_seen_in_tmux_and_lands_when_it_is_stopped(rig, harness):
    run = execute(rig, "flies")
    harness.eventually(lambda: "flying" in show(rig, "flies")["out"])
    pane = subprocess.run(["tmux", "capture-pane", "-p", "-t", run["session"]], capture_output=True, check=True)
    assert b"flying" in pane.stdout
    assert rig.post("/mission/execute-script", script_name="flies").status_code == 400
    assert [r["script"] for r in rig.ok(rig.get("/mission/running-scripts"))["scripts"]] == ["flies.py"]
    stopped = rig.ok(rig.post("/mission/stop-script", script_name="flies"))
    assert (stopped["type"], stopped["info"], stopped["killed"]) == (52, "Stopped", False)
    ended = show(rig, "flies")
    assert ended["out"].splitlines() == ["vehicle 1", "flying", "Landed at home successfully"]
    assert "KeyboardInterrupt" in ended["err"]
    assert rig.status()["armed"] is False


def test_stubborn_script_is_killed_after_the_grace_period_and_the_remaining_time_is_reported(rig, harness):
    rig.set("script_grace", str(SHORT_GRACE))
    execute(rig, "stubborn.sh")
    rig.set("script_grace", str(GRACE))
    harness.eventually(lambda: show(rig, "stubborn.sh")["out"])
    with rig.unanswered("POST", "/mission/stop-script", {"script_name": "stubborn.sh"}):
        harness.eventually(lambda: show(rig, "stubborn.sh")["stopping"])
    [stopping] = rig.ok(rig.get("/mission/running-scripts"))["scripts"]  # its client hung up; the stop goes on
    assert stopping["stopping"] is True
    assert 0 < stopping["kill_in_s"] <= SHORT_GRACE
    harness.eventually(lambda: not show(rig, "stubborn.sh")["running"])
    assert show(rig, "stubborn.sh")["killed"] is True


def test_log_is_followed_until_the_script_ends(rig):
    upload(rig, "counts.py", "import time\nfor i in range(3):\n    print(i)\n    time.sleep(0.3)\n")
    execute(rig, "counts")
    with requests.get(f"{rig.url}/mission/scripts/counts/log?follow=1", stream=True, timeout=30) as answer:
        lines = [line for line in answer.iter_lines(decode_unicode=True) if line]
    assert lines[:6] == [word for i in range(3) for word in ("event: out", f'data: {{"line": "{i}"}}')]
    assert lines[6] == "event: end"
    assert json.loads(lines[7].removeprefix("data: "))["exit_status"] == 0


def test_restarted_api_finds_its_scripts_again(rig, harness):
    execute(rig, "flies", "early")
    harness.eventually(lambda: "flying" in show(rig, "flies")["out"])
    rig.mavproxy.ask("module unload uavapi", "Unloaded module uavapi")
    settings = {"port": rig.port, "script_grace": GRACE}
    settings |= {"scripts_path": f"{rig.directory}/scripts", "script_logs": f"{rig.directory}/logs"}
    rig.mavproxy.ask(f"module load uavapi:{json.dumps(settings, separators=(',', ':'))}", "uavapi: listening")
    rig.wait_until_up()

    def running():
        return [run["script"] for run in rig.ok(rig.get("/mission/running-scripts"))["scripts"]]

    harness.eventually(lambda: running() == ["flies.py"])
    assert rig.post("/mission/execute-script", script_name="flies").status_code == 400
    rig.ok(rig.post("/mission/stop-script", script_name="flies"))
    assert running() == []


@pytest.mark.parametrize(
    ("action", "output", "end"),
    [
        ("nothing", "on_script_exit is nothing", (True, "GUIDED")),
        pytest.param("hold", "hold is done", (True, "GUIDED"), marks=pytest.mark.long),
        pytest.param("land", "land is done", (False, "LAND"), marks=pytest.mark.long),
        ("rtl", "rtl is done", (False, "RTL")),
    ],
)
def test_script_that_dies_in_flight_leaves_the_vehicle_to_the_setting(rig, harness, action, output, end):
    rig.mavproxy.type(f"uavapi set on_script_exit {action}")
    rig.in_the_air(8)  # from the ground: home is below
    x, y, _ = rig.ned()
    mark = rig.mavproxy.mark()
    distance = DISTANCE if action == "nothing" else FAR
    execute(rig, "leaves", str(x + (distance if x < 0 else -distance)), str(y))
    rig.mavproxy.says(f"leaves.py died (status 5): {output}", mark, timeout=90)
    assert show(rig, "leaves")["exit_status"] == 5

    def flown():
        return math.dist(rig.ned()[:2], (x, y))

    if action == "nothing":
        harness.eventually(lambda: flown() > distance - 2, what="its target")
    harness.eventually(lambda: slow(rig), what="the end of its flight")
    status = rig.status()
    assert (status["armed"], status["mode"]) == end
    if action == "rtl":
        assert flown() < 2
    elif action != "nothing":
        assert flown() < distance - 10
    if status["armed"]:
        rig.on_the_ground()


def slow(rig):
    velocity = rig.ok(rig.get("/telemetry/ned"))["info"]["velocity"]
    return math.hypot(velocity["vx"], velocity["vy"]) < 0.2


DIES = """
import os, sys, time

while not os.path.exists(sys.argv[1]):
    time.sleep(0.05)
raise SystemExit(1)
"""


def test_pilots_mode_is_left_alone_when_the_script_dies(rig, harness, tmp_path):
    rig.mavproxy.type("uavapi set on_script_exit rtl")
    upload(rig, "dies.py", DIES)
    rig.in_the_air(20)
    pilot_keeps_the_height(rig)
    mark = rig.mavproxy.mark()
    execute(rig, "dies", str(tmp_path / "now"))
    rig.mavproxy.type("mode LOITER")
    harness.eventually(lambda: rig.status()["mode"] == "LOITER")
    since = rig.control.ask("received", since=0)["last"] if rig.control is not None else 0
    (tmp_path / "now").touch()
    rig.mavproxy.says("left alone: the vehicle is in LOITER", mark)
    assert show(rig, "dies")["exit_status"] == 1
    time.sleep(1)  # what is not to come would come at once
    status = rig.status()
    assert (status["armed"], status["mode"]) == (True, "LOITER")
    if rig.control is not None:
        received = rig.control.ask("received", since=since)["messages"]
        ours = {"SET_POSITION_TARGET_LOCAL_NED", "COMMAND_LONG", "SET_MODE"}
        assert [m for m in received if m["name"] in ours and m["fields"].get("command") not in ASKING] == []
    rig.ok(rig.get("/command/guided"))
    rig.on_the_ground()


def pilot_keeps_the_height(rig):
    """Throttle in the middle; of the embedded vehicle's `in_the_air` has seen to it."""
    if rig.control is None:
        rig.mavproxy.type("rc 3 1500")


def test_names_never_reach_a_shell(rig, tmp_path):
    evil = f"x$(touch {tmp_path}%2FPWN).py"
    answer = requests.post(rig.url + "/mission/upload-script", files={"file": (evil, "")}, timeout=10)
    assert answer.status_code == 400
    assert rig.post("/mission/execute-script", script_name=evil).status_code == 400
    upload(rig, "echo.sh", 'printf "%s|" "$@"\n')
    execute(rig, "echo.sh", f"$(touch {tmp_path}/PWN)", ";", "a b")
    assert list(tmp_path.iterdir()) == []


def test_clear_removes_the_scripts(rig):
    assert rig.ok(rig.get("/mission/list-scripts"))["scripts"]
    answer = requests.delete(rig.url + "/mission/clear-scripts", timeout=10)
    assert rig.ok(answer)["removed"]
    assert rig.ok(rig.get("/mission/list-scripts"))["scripts"] == []
