"""What outlives a reload, what MAVProxy knows already, and starts that take long, in a real MAVProxy."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import requests

from tests.support.ports import free_instance, free_port

pytestmark = pytest.mark.long

SPEEDUP = 4  # a take-off and a landing are all that is flown
LAT, LON, GROUND = -353632610, 1491652300, 584  # 1e-7 degrees, m AMSL


@pytest.fixture(scope="module")
def rig(harness, tmp_path_factory) -> Iterator:
    """A MAVProxy with vehicles 1, its current one, and 2, and none of our modules; it has their parameters."""
    made = harness.Rig(tmp_path_factory.mktemp("reload"), free_port())
    try:
        first = harness.start_embedded(made, speedup=SPEEDUP)
        second = free_instance()
        simulator = [sys.executable, "-m", "mavproxy_uavapi.sim", f"--home={harness.HOME}"]
        more = made.start("second", [*simulator, f"--instance={second}", "--sysid=2", f"--speedup={SPEEDUP}"])
        more.says("listening on tcp")
        command = harness.mavproxy_command(first, f"--master=tcp:127.0.0.1:{5760 + 10 * second}")
        made.mavproxy = made.start("mavproxy", command)
        made.mavproxy.says("Received", timeout=60)
        made.mavproxy.type("vehicle 2")
        made.mavproxy.ask("param fetch", "Received", timeout=60)
        made.mavproxy.type("vehicle 1")
        yield made
    finally:
        made.stop()


@pytest.fixture
def prompt(rig) -> Iterator:
    """Its prompt; the modules that a test loads are gone after it."""
    yield rig.mavproxy
    for name in ("gradys", "vision", "uavapi"):
        rig.mavproxy.ask(f"module unload {name}", f"module {name}")


def vehicle_of(port: int) -> str | None:
    """Which vehicle the API on that port flies; None before it has heard it."""
    answer = requests.get(f"http://127.0.0.1:{port}/telemetry/status", timeout=5)
    return answer.json()["id"] if answer.status_code == 200 else None


def flat(output: str) -> str:
    return " ".join(output.split())


def test_uavapi_keeps_its_keywords_and_what_was_set_at_the_prompt(rig, prompt, harness):
    other = free_port()
    prompt.ask(f'module load uavapi:{{"port":{rig.port},"sysid":2}}', f"listening on {rig.url}")
    prompt.ask(f"uavapi set port {other}", f"listening on http://127.0.0.1:{other}")
    for line in ("module reload uavapi", "module unload uavapi\nmodule load uavapi"):
        output = prompt.ask(line, f"listening on http://127.0.0.1:{other}")
        assert f"uavapi: as before: port={other}, sysid=2 (keywords at `module load` replace all that)" in flat(
            output
        )
        assert harness.eventually(lambda: vehicle_of(other)) == "2"
    output = prompt.ask(f'module reload uavapi:{{"port":{rig.port}}}', f"listening on {rig.url}")
    assert "as before" not in output
    assert harness.eventually(lambda: vehicle_of(rig.port)) == "1"


def test_gradys_and_vision_keep_theirs(rig, prompt):
    prompt.ask(f'module load gradys:{{"spool":"{rig.directory}/spool.db"}}', "no ground station")
    prompt.ask("gradys set gs 127.0.0.1:9", "pushing to http://127.0.0.1:9")
    prompt.ask("module reload gradys", "pushing to http://127.0.0.1:9")
    prompt.ask('module load vision:{"source":"http"}', "looking for 36h11 through http")
    prompt.ask("vision set tags 0:0.4", "looking for")
    output = prompt.ask("module reload vision", "looking for 36h11 through http")
    assert "vision: as before: source=http, tags=0:0.4 (" in flat(output)


def test_takeoff_asks_for_no_parameter_that_mavproxy_has(rig, prompt):
    prompt.ask(f'module load uavapi:{{"port":{rig.port},"sysid":1}}', "listening on")
    rig.wait_until_up()
    since = rig.control.ask("received", since=0)["last"]
    rig.ok(rig.get("/command/arm"))
    rig.ok(rig.get("/command/takeoff", alt=3))
    received = [message["name"] for message in rig.control.ask("received", since=since)["messages"]]
    rig.ok(rig.get("/command/land"))
    assert "COMMAND_LONG" in received
    assert "PARAM_REQUEST_READ" not in received


def test_track_is_flown_by_the_apis_own_vehicle(rig, prompt, harness, tmp_path: Path):
    track = tmp_path / "a.track"
    places = ((LAT, LON), (LAT + 2000, LON), (LAT + 2000, LON + 2000))
    track.write_text(
        "".join(f"({n}, {lat}, {lon}, 594000, 0, 65535, 0, 0, 3, 10)\n" for n, (lat, lon) in enumerate(places))
    )
    prompt.ask(f'module load uavapi:{{"port":{rig.port},"sysid":2}}', "listening on")
    prompt.ask(f'module load gradys:{{"spool":"{rig.directory}/spool.db"}}', "no ground station")
    rig.wait_until_up()
    harness.eventually(lambda: rig.get("/telemetry/gps").status_code == 200, what="its telling where it is")
    prompt.ask(f"uavapi fly {track} --ground {GROUND}", "legs with vehicle 2")
    prompt.ask(f"gradys track fly {track} --sysid 9", "no vehicle 9 on the link yet")
    rig.ok(rig.get("/command/land"))


def test_start_that_takes_long_says_so_and_mavproxy_goes_on(rig, prompt, tmp_path: Path):
    """The log file is a pipe that nobody reads: to open it takes as long."""
    pipe = tmp_path / "uav.log"
    os.mkfifo(pipe)
    prompt.ask(f'module load uavapi:{{"port":{rig.port},"log_path":"{pipe}"}}', "Loaded module uavapi")
    prompt.ask("uavapi status", f"it would be {rig.url}")
    prompt.says(f"still trying to listen on {rig.url}; a line follows when it is done")
    with pytest.raises(requests.ConnectionError):
        rig.get("/telemetry/status", timeout=5)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    prompt.says(f"uavapi: listening on {rig.url}")
    rig.wait_until_up()
    os.close(reader)
