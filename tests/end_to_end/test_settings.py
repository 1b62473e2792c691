"""Settings from each of their sources, and the logs, in a MAVProxy at a terminal: what a pilot sees at the prompt."""

from __future__ import annotations

import json
import re
import shlex
import subprocess

import pytest

from mavproxy_uavapi.launcher import command_lines
from mavproxy_uavapi.launcher.options import parse
from tests.support.ports import free_port

pytestmark = pytest.mark.needs("tmux")

# As the original service's own example has it, but for the folders, and what our own table adds.
INI = """
[api]
port = 1
uav_connection = 127.0.0.1:17171
connection_type = udpin
sysid = 1
scripts_path = {folder}/uav_scripts
max_age = 6
link_timeout = 6
script_grace = 6
max_jobs = 6

[logs]
log_path = {folder}/uav_logs/uav_1.log
script_logs = {folder}/script_logs
"""


class Terminal:
    """A tmux server of our own, with one window."""

    def __init__(self, name):
        self._name = name

    def tmux(self, *arguments):
        command = ["tmux", "-L", self._name, *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout

    def start(self, command, environment):
        options = [word for name, value in environment.items() for word in ("-e", f"{name}={value}")]
        self.tmux("new-session", "-d", "-x", "180", "-y", "60", *options, shlex.join(command))

    def type(self, text):
        self.tmux("send-keys", "-l", text)

    def enter(self, line=""):
        self.type(line)
        self.tmux("send-keys", "Enter")

    @property
    def lines(self):
        """What is on the screen and above it."""
        return [line.rstrip() for line in self.tmux("capture-pane", "-p", "-S", "-2000").splitlines() if line.strip()]


@pytest.fixture(scope="module")
def rig(harness, tmp_path_factory):
    """A MAVProxy with a prompt, on the embedded vehicle; `settings` come in by file, environment and keyword."""
    directory = tmp_path_factory.mktemp("settings")
    rig = harness.Rig(directory, free_port())
    config = directory / "uav.ini"
    config.write_text(INI.format(folder=directory), encoding="utf-8")
    terminal = rig.terminal = Terminal(f"uavapi-test-{rig.port}")
    try:
        instance = harness.start_embedded(rig, speedup=4)
        load = harness.load(rig.port, config=str(config), link_timeout=8, max_age=None, script_grace=8)
        command = [*harness.mavproxy_command(instance, load, logs=True), f"--logfile={directory / 'mav.tlog'}"]
        terminal.start(command, {"UAVAPI_MAX_AGE": "7", "UAVAPI_LINK_TIMEOUT": "7", "UAVAPI_SCRIPT_GRACE": "7"})
        rig.wait_until_up()
        yield rig
    finally:
        subprocess.run(["tmux", "-L", terminal._name, "kill-server"], capture_output=True, check=False)
        rig.stop()


def shown(rig, harness, words, after=0):
    """The screen's lines from number `after` on, once one of them has the words."""

    def look():
        lines = rig.terminal.lines[after:]
        return lines if any(words in line for line in lines) else None

    return harness.eventually(look, what=f"{words!r} on the screen")


def configuration(rig, harness):
    """What `uavapi config` prints: value and origin by setting."""
    before = len(rig.terminal.lines)
    rig.terminal.enter("uavapi config")
    lines = shown(rig, harness, "tokens ", before)  # the last row
    row = re.compile(r"(?:.*> )?(\w+) +(.*?)? +(default|environment|module load|uavapi set|/.*)")
    matches = [row.fullmatch(line) for line in lines]
    return {match[1]: (match[2], match[3]) for match in matches if match}


def test_later_sources_win_and_config_reports_each(rig, harness):
    rig.terminal.enter("uavapi set script_grace 9")
    file = str(rig.directory / "uav.ini")
    reported = configuration(rig, harness)
    assert reported["max_rate"] == ("500.0", "default")
    assert reported["max_jobs"] == ("6", file)
    assert reported["max_age"] == ("7.0", "environment")
    assert reported["link_timeout"] == ("8.0", "module load")
    assert reported["script_grace"] == ("9.0", "uavapi set")
    assert reported["port"] == (str(rig.port), "module load")


def test_what_mavproxy_owns_is_one_line_for_each_key(rig):
    printed = [line.rpartition("> ")[2] for line in rig.terminal.lines]  # the prompt may stand before one
    lines = [line for line in printed if "is ignored here" in line]
    file = rig.directory / "uav.ini"
    why = "is ignored here, MAVProxy has the link (--master)"
    assert lines == [f"uavapi: {file}: {name} {why}" for name in ("uav_connection", "connection_type")]


def test_misspelt_key_is_one_line_and_loads_nothing(rig, harness, tmp_path):
    file = tmp_path / "bad.ini"
    file.write_text("[api]\nscript_gracee = 3\n", encoding="utf-8")
    rig.terminal.enter("module unload uavapi")
    shown(rig, harness, "Unloaded module uavapi")
    rig.terminal.enter("module load uavapi:" + json.dumps({"config": str(file)}, separators=(",", ":")))
    printed = "".join(shown(rig, harness, "Failed to load module"))
    assert "no key 'script_gracee' in [api]; did you mean script_grace?" in printed
    load = harness.load(rig.port, config=str(rig.directory / "uav.ini"), link_timeout=None, max_age=None)
    rig.terminal.enter(load.removeprefix("--cmd="))
    rig.wait_until_up()


def test_setting_takes_effect_at_once_and_a_refused_one_does_not(rig, harness):
    rig.terminal.enter("uavapi set host 0.0.0.0")
    shown(rig, harness, "everybody on that network could fly the vehicle")
    assert configuration(rig, harness)["host"] == ("127.0.0.1", "default")
    rig.terminal.enter("uavapi set max_rate 1")

    def refused():
        return any(rig.get("/telemetry/general").status_code == 429 for _ in range(3))

    harness.eventually(refused)
    rig.terminal.enter("uavapi set max_rate 500")
    harness.eventually(lambda: not refused())


def test_setting_is_set_by_http_as_at_the_prompt_which_says_so(rig, harness):
    before = len(rig.terminal.lines) - 1
    answer = rig.call("PUT", "/settings/max_age", json={"value": 3})
    assert (answer.status_code, answer.json()["value"]) == (200, 3.0), answer.text
    shown(rig, harness, "uavapi: max_age is 3.0, set by 127.0.0.1", before)
    assert configuration(rig, harness)["max_age"] == ("3.0", "uavapi set")
    listed = {one["name"]: one for one in rig.ok(rig.get("/settings"))["settings"]}
    assert listed["max_jobs"]["origin"] == str(rig.directory / "uav.ini")
    assert (listed["max_age"]["value"], listed["max_age"]["settable"]) == (3.0, True)
    for name, value in (("port", 1), ("python_path", "/bin/true"), ("max_age", "NaN")):
        assert rig.call("PUT", f"/settings/{name}", json={"value": value}).status_code == 422
    after = {one["name"]: one for one in rig.ok(rig.get("/settings"))["settings"]}
    assert after == listed


def test_setting_that_changes_in_flight_ends_no_call(rig):
    rig.in_the_air(6)
    answer = rig.post("/movement/travel_at_ned?wait=false", vx=3, vy=0, vz=0, duration=300)
    assert answer.status_code == 202, answer.text
    rig.terminal.enter("uavapi set debug COPTER")
    rig.terminal.enter("uavapi set script_grace 5")
    job = rig.ok(rig.get(f"/jobs/{answer.json()['job']}"))
    assert job["state"] == "running"
    rig.on_the_ground()


def test_verbs_are_a_line_each_above_the_prompt_which_stays_whole(rig, harness):
    rig.terminal.enter("uavapi set log_console [VEHICLE,UVICORN,SCRIPT]")
    assert configuration(rig, harness)["log_console"] == ("[VEHICLE,UVICORN,SCRIPT]", "uavapi set")
    before = len(rig.terminal.lines) - 1
    rig.terminal.type("uavapi sta")
    shown(rig, harness, "uavapi sta", before)
    for path in ("/command/land", "/command/set_mode?mode=LOITER"):
        rig.ok(rig.get(path))
    assert rig.get("/movement/set_heading?heading=90").status_code == 409
    lines = shown(rig, harness, "/movement/set_heading", before)
    # Between them the trail has what happens to the vehicle.
    verbs = [line for line in lines if line.startswith("API: ") and " 127.0.0.1 /" in line]
    outcome = re.compile(r"API: \S+Z?\S* 127\.0\.0\.1 (\S+)\(.*\): (\w+) after \d+\.\d s")
    assert [outcome.fullmatch(line).groups() for line in verbs] == [
        ("/command/land", "ok"),
        ("/command/set_mode", "ok"),
        ("/movement/set_heading", "not_armed"),
    ]
    assert any(line.startswith("COPTER: DO_SET_MODE") for line in lines)  # `debug`, of the test before
    harness.eventually(lambda: rig.terminal.lines[-1].endswith("> uavapi sta"), what="the prompt with what was typed")
    rig.terminal.enter("tus")
    shown(rig, harness, "0 calls in flight", before)


def test_log_file_has_them_all_with_time_component_and_level(rig):
    rig.ok(rig.get("/command/land"))
    lines = (rig.directory / "uav_logs" / "uav_1.log").read_text(encoding="utf-8").splitlines()
    form = re.compile(
        r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} (COPTER|API|SCRIPT|GRADYS_GS) (DEBUG|INFO|WARNING|ERROR) .+"
    )
    assert all(form.fullmatch(line) for line in lines)
    assert any(re.search(r"/command/takeoff\(alt=6\b.*\): ok after", line) for line in lines)


ALL_THREE = """
[api]
port = {port}
sysid = 1
gradys_gs = 127.0.0.1:9

[vision]
source = http
tags = 0:0.4
speed = 2

[gradys]
period = 3
spool = {folder}/spool.db
token = s3cret
"""


def test_one_file_that_the_environment_names_configures_all_three_modules(harness, tmp_path):
    pytest.importorskip("cv2")
    rig = harness.Rig(tmp_path, free_port())
    file = tmp_path / "uav.ini"
    file.write_text(ALL_THREE.format(port=rig.port, folder=tmp_path), encoding="utf-8")
    try:
        command = harness.mavproxy_command(
            harness.start_embedded(rig, speedup=2), "--load-module=uavapi,vision,gradys"
        )
        environment = {"UAVAPI_CONFIG": str(file), "VISION_SPEED": "3", "GRADYS_PERIOD": "4"}
        rig.mavproxy = rig.start("mavproxy", command, environment)
        rig.wait_until_up()
        rig.mavproxy.says("gradys: pushing to http://127.0.0.1:9")
        rig.mavproxy.says("vision: looking for 36h11 through http")
        rows = rig.mavproxy.ask("vision config", "sim_occlusion") + rig.mavproxy.ask("gradys config", "spool_hours")
        words = [line.rpartition("> ")[2].split() for line in rows.splitlines()]  # the prompt may stand before one
        reported = {row[0]: row[1:] for row in words if len(row) > 2}
        assert reported["tags"] == ["0:0.4", str(file)]
        assert reported["speed"] == ["3.0", "environment"]
        assert reported["fps"] == ["20.0", "default"]
        assert reported["gs"] == ["127.0.0.1:9", str(file)]
        assert reported["period"] == ["4.0", "environment"]
        assert reported["token"] == ["(set)", str(file)]
        assert "s3cret" not in rig.mavproxy.output()
        file.write_text(file.read_text(encoding="utf-8").replace("tags =", "tgas ="), encoding="utf-8")
        printed = rig.mavproxy.ask("module reload vision", "Failed to load module")
        assert "no key 'tgas' in [vision]; did you mean tags?" in printed
        assert rig.get("/gradys/status").status_code == 200  # the others live on
    finally:
        rig.stop()


PIPELINE = 'videotestsrc is-live=true name="the eye" ! video/x-raw,width=64,height=48,framerate=10/1 ! identity'


def by_file(folder, _):
    file = folder / "uav.ini"
    file.write_text(f"[vision]\nsource = {PIPELINE}\nwidth = 64\nheight = 48\n", encoding="utf-8")
    return [f'--load-module=vision:{{"config":"{file}"}}'], {}


def by_environment(*_):
    return ["--load-module=vision"], {"VISION_SOURCE": PIPELINE, "VISION_WIDTH": "64", "VISION_HEIGHT": "48"}


def by_the_launchers_option(*_):
    keywords = json.dumps({"source": PIPELINE, "width": 64, "height": 48})
    loads = command_lines.module_loads(parse(["--module", f"vision:{keywords}"], environ={}), None)
    return [f"--cmd={load}" for load in loads if "vision" in load], {}


@pytest.mark.needs("gst-launch-1.0", "gstreamer1.0-tools")
@pytest.mark.parametrize(
    "way",
    [*(pytest.param(way, marks=pytest.mark.long) for way in (by_file, by_environment)), by_the_launchers_option],
)
def test_a_pipeline_with_spaces_and_quotes_is_configured_without_a_person(harness, tmp_path, way):
    pytest.importorskip("cv2")
    rig = harness.Rig(tmp_path, free_port())
    try:
        arguments, environment = way(tmp_path, rig)
        command = harness.mavproxy_command(harness.start_embedded(rig, speedup=2), *arguments)
        rig.mavproxy = rig.start("mavproxy", command, environment)
        rig.mavproxy.says(f"vision: looking for 36h11 through {PIPELINE}")
        harness.eventually(lambda: "camera ok" in rig.mavproxy.ask("vision status", "in view"), what="a picture")
    finally:
        rig.stop()
