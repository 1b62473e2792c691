"""Scripts of aerpawlib's kind fly: examples, a script that dies, one that is stopped, ZMQ."""

from __future__ import annotations

import csv
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest
import requests

from tests.support.processes import Rig

pytestmark = pytest.mark.long

EXAMPLES = Path(__file__).parents[2] / "examples" / "aerpaw"
HOST = [sys.executable, "-m", "mavproxy_uavapi.aerpaw"]
TIMEOUT = 200.0  # s


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rig(
    request: pytest.FixtureRequest, harness: ModuleType, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Rig]:
    """A rig with folders of its own for scripts."""
    directory = tmp_path_factory.mktemp("aerpaw")
    folders = {"scripts_path": str(directory / "scripts"), "script_logs": str(directory / "logs")}
    start = harness.embedded if request.param == "embedded" else harness.ardupilot
    made = start(directory, speedup=3, **folders)  # a script has to keep up with it
    yield made
    made.stop()


def begin(rig: Rig, script: Path, *more: str) -> subprocess.Popen[str]:
    """A script in flight."""
    command = [*HOST, "--script", str(script), "--conn", rig.url, *more]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def end(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    try:
        out, err = process.communicate(timeout=TIMEOUT)
    finally:
        process.kill()
    return process.returncode, out, err


def on_the_ground(rig: Rig) -> bool:
    status = rig.status()
    return (status["armed"], status["landed_state"]) == (False, "on_ground")


@pytest.mark.long  # the script that is uploaded below is the same one
def test_square_is_flown(rig: Rig) -> None:
    status, out, err = end(begin(rig, EXAMPLES / "square.py", "--vehicle", "drone", "--side", "8"))
    assert status == 0, out + err
    assert [line.partition(":")[0] for line in out.splitlines()] == ["north", "east", "south", "west"]
    assert on_the_ground(rig)


@pytest.mark.long
def test_velocities_and_a_log_beside_them(rig: Rig, tmp_path: Path) -> None:
    log = tmp_path / "sweep.csv"
    status, out, err = end(begin(rig, EXAMPLES / "sweep.py", "--output", str(log)))
    assert status == 0, out + err
    heading = float(out.splitlines()[-1].removeprefix("heading "))
    assert abs((heading - 359 + 180) % 360 - 180) <= 5
    rows = list(csv.reader(log.read_text().splitlines()))
    lats = [float(row[0]) for row in rows]
    assert (max(lats) - min(lats)) * 111_319 > 2
    assert on_the_ground(rig)


@pytest.mark.long
def test_tasks_of_v2_are_flown_and_a_cancelled_one_returns_to_launch(rig: Rig) -> None:
    status, out, err = end(begin(rig, EXAMPLES / "tasks.py", "--api-version", "v2"))
    assert status == 0, out + err
    steps = ["may go there: (True, '')", "under way", "100% of the way", "cancelled, landed"]
    assert out.splitlines()[:-1] == steps
    assert on_the_ground(rig) and rig.status()["mode"] == "RTL"


@pytest.mark.long
def test_pilots_switch_ends_a_task_and_the_script_leaves_the_vehicle_to_him(rig: Rig, tmp_path: Path) -> None:
    file = tmp_path / "far.py"
    file.write_text(FAR)
    process = begin(rig, file)
    assert process.stdout is not None and process.stdout.readline() == "under way\n"
    rig.ok(rig.get("/command/set_mode", mode="LOITER"))
    status, _, err = end(process)
    assert status == 1 and "NavigationError" in err
    assert (rig.status()["mode"], rig.status()["armed"]) == ("LOITER", True)
    rig.ok(rig.get("/command/land"))


FAR = """
from aerpawlib.v2 import BasicRunner, Drone, entrypoint

class Far(BasicRunner):
    @entrypoint
    async def fly(self, drone: Drone):
        await drone.takeoff(altitude=5)
        await drone.goto_north(500, blocking=False)
        print("under way", flush=True)
        await drone.await_ready_to_move()
"""
DIES = """
from aerpawlib.v1.runner import BasicRunner, entrypoint
from aerpawlib.v1.util import VectorNED
from aerpawlib.v1.vehicle import Drone

class Dies(BasicRunner):
    @entrypoint
    async def fly(self, drone: Drone):
        await drone.takeoff(5)
        await drone.set_velocity(VectorNED(3, 0, 0))
        print("under way", flush=True)
        {rest}
"""


@pytest.fixture
def script(tmp_path: Path) -> Callable[[str], Path]:
    """A script that takes off, flies on, and then does that."""

    def make(rest: str) -> Path:
        file = tmp_path / "dies.py"
        file.write_text(DIES.format(rest=rest))
        return file

    return make


def test_script_that_dies_in_flight_brings_its_vehicle_home(rig: Rig, script: Callable[[str], Path]) -> None:
    status, _, err = end(begin(rig, script("raise RuntimeError('lost')")))
    assert status == 1 and "lost" in err
    assert on_the_ground(rig)


@pytest.mark.long
def test_script_that_is_stopped_lands_its_vehicle(rig: Rig, script: Callable[[str], Path]) -> None:
    process = begin(rig, script("import asyncio; await asyncio.sleep(600)"), "--on-exit", "land")
    assert process.stdout is not None and process.stdout.readline() == "under way\n"
    process.send_signal(signal.SIGTERM)
    status, _, err = end(process)
    assert status == 130, err
    assert on_the_ground(rig)


@pytest.mark.long
def test_killed_script_leaves_no_velocity_behind(rig: Rig, script: Callable[[str], Path]) -> None:
    process = begin(rig, script("import time; time.sleep(600)"))
    assert process.stdout is not None and process.stdout.readline() == "under way\n"
    process.kill()
    end(process)
    deadline = time.monotonic() + 15
    while (speed := rig.ok(rig.get("/telemetry/general"))["info"]["groundspeed"]) > 0.3:
        assert time.monotonic() < deadline, f"it still flies at {speed} m/s"
        time.sleep(0.2)
    assert rig.status()["mode"] == "GUIDED"
    rig.ok(rig.get("/command/land"))


@pytest.fixture
def proxy() -> Iterator[None]:
    """The proxy between runners."""
    pytest.importorskip("zmq")
    made = subprocess.Popen(
        [sys.executable, "-m", "mavproxy_uavapi.aerpaw.zmq_proxy"], stdout=subprocess.PIPE, text=True
    )
    assert made.stdout is not None and "publish to" in made.stdout.readline()
    yield
    made.send_signal(signal.SIGINT)
    made.communicate(timeout=10)


@pytest.mark.long
def test_runners_talk_by_zmq(rig: Rig, proxy: None) -> None:
    names = ["--zmq-proxy-server", "127.0.0.1", "--zmq-identifier"]
    flyer = begin(rig, EXAMPLES / "answer.py", *names, "flyer")
    base = begin(rig, EXAMPLES / "ask.py", "--vehicle", "none", *names, "base")
    status, out, err = end(base)
    assert (status, out) == (0, "the flyer is 4 m high\n"), err
    assert end(flyer)[0] == 0
    assert on_the_ground(rig)


@pytest.mark.needs("tmux")
def test_script_runs_uploaded_as_it_is(rig: Rig) -> None:
    files = {"file": ("square.py", (EXAMPLES / "square.py").read_bytes())}
    rig.ok(requests.post(rig.url + "/mission/upload-script", files=files, timeout=10))
    rig.ok(rig.post("/mission/execute-script", script_name="square", args=["--side", "5"]))
    deadline = time.monotonic() + TIMEOUT
    while (run := rig.ok(rig.get("/mission/scripts/square"))["run"])["running"]:
        assert time.monotonic() < deadline
        time.sleep(0.5)
    assert run["exit_status"] == 0, run["err"]
    assert on_the_ground(rig)
