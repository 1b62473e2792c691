"""The launcher ends all of its processes and none of anybody else's; MAVProxy and the vehicle are stand-ins."""

from __future__ import annotations

import contextlib
import os
import pty
import signal
import subprocess
import sys
import termios
import time
import warnings
from pathlib import Path

import pytest

from mavproxy_uavapi.launcher import cli
from tests.support.ports import free_port

ROOT = Path(cli.__file__).resolve().parents[2]
FAKE_MAVPROXY = """
import http.server, json, os, signal, subprocess, sys, threading, time
mode = os.environ.get("FAKE_MODE", "")
print("MAVProxy stand-in", flush=True)
if mode == "crash":
    sys.exit("cannot open the link")
if mode == "no module":
    print("Failed to load module: uavapi: no setting 'x'. Use 'set moddebug 3' for more", flush=True)
stray = subprocess.Popen(["sleep", "300"])
other = subprocess.Popen(["sleep", "300"], start_new_session=True)
with open(os.environ["FAKE_PIDS"], "a") as pids:
    print("mavproxy", os.getpid(), "\\nstray", stray.pid, "\\nother", other.pid, file=pids)
stop = threading.Event()
def on_term(*_):
    if mode != "deaf":
        stop.set()
signal.signal(signal.SIGTERM, on_term)
[load] = [word for word in sys.argv if word.startswith("--cmd=module load uavapi:")]
class Api(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.end_headers()
    def log_message(self, *_):
        pass
server = http.server.HTTPServer(("127.0.0.1", json.loads(load.partition("uavapi:")[2])["port"]), Api)
if mode == "silent":
    server.server_close()
elif mode != "no module":
    threading.Thread(target=server.serve_forever, daemon=True).start()
if "--daemon" in sys.argv:
    stop.wait()
else:
    try:
        input("MAV> ")
    except (EOFError, KeyboardInterrupt):
        pass
print("Unloading module uavapi", flush=True)
os._exit(1)
"""
FAKE_VEHICLE = """
import os, subprocess, sys, time
child = subprocess.Popen(["sleep", "300"])
with open(os.environ["FAKE_PIDS"], "a") as pids:
    print("vehicle", os.getpid(), "\\nchild", child.pid, file=pids)
if os.environ.get("FAKE_MODE") == "no vehicle":
    sys.exit("sim: the port is taken")
print("sim: vehicle 10 listening on tcp:127.0.0.1:5760", flush=True)
time.sleep(300)
"""
DRIVER = """
import fcntl, os, sys, termios
if os.isatty(0):
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
from mavproxy_uavapi.launcher import environment, instances, supervisor
from mavproxy_uavapi.launcher import cli, command_lines
environment.mavproxy_program = lambda: [sys.executable, "-S", {mavproxy!r}]
command_lines.embedded_command = lambda *_: [sys.executable, "-S", {vehicle!r}]
instances.ports_are_free = lambda _: True
if os.environ["FAKE_MODE"] == "silent":
    supervisor.API_START_S = 0.3
supervisor.MAVPROXY_GRACE_S = supervisor.PROMPT_GRACE_S = supervisor.MAVPROXY_FORCED_S = 0.3
sys.exit(cli.run())
"""


def is_alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def state_of(pid):
    """What a process does, and where in the kernel each of its threads waits."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        return state, [(thread / "wchan").read_text() for thread in Path(f"/proc/{pid}/task").iterdir()]
    except (FileNotFoundError, ProcessLookupError):
        return "gone"


def eventually(condition, timeout_s=60.0):
    """Wait for real processes; the time is a limit, not a pause."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


class Launched:
    """The launcher in a process of its own, around the stand-ins."""

    def __init__(self, directory, words, mode="", stdin=subprocess.DEVNULL):
        for name, text in {"mavproxy": FAKE_MAVPROXY, "vehicle": FAKE_VEHICLE}.items():
            (directory / f"{name}.py").write_text(text)
        driver = DRIVER.format(mavproxy=str(directory / "mavproxy.py"), vehicle=str(directory / "vehicle.py"))
        (directory / "driver.py").write_text(driver)
        self.pids_file = directory / "pids"
        self.out_file = directory / "out"
        self.port = free_port()
        interactive = stdin is not subprocess.DEVNULL
        with self.out_file.open("wb") as output:
            self.process = subprocess.Popen(
                [sys.executable, str(directory / "driver.py"), f"--port={self.port}", *words],
                stdin=stdin,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, "PYTHONPATH": str(ROOT), "FAKE_PIDS": str(self.pids_file), "FAKE_MODE": mode},
                cwd=directory,
                start_new_session=interactive,
            )

    @property
    def pids(self):
        lines = self.pids_file.read_text().splitlines() if self.pids_file.exists() else []
        return {name: int(pid) for name, pid in map(str.split, lines)}

    @property
    def out(self):
        return self.out_file.read_text()

    def ours(self):
        return [pid for name, pid in self.pids.items() if name != "other" and is_alive(pid)]

    def status(self):
        """Its exit status, once it has ended. What holds up an end of more than 5 s is a warning."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(5)
        held_up = [f"{name} {state_of(pid)}" for name, pid in {"launcher": self.process.pid, **self.pids}.items()]
        status = self.process.wait(60)
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.warn(f"the run takes long to end: {held_up}", stacklevel=2)
        return status

    def wait_up(self):
        up = eventually(lambda: "API of vehicle" in self.out or self.process.poll() is not None)
        assert up and self.process.poll() is None, self.out

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for pid in self.pids.values():
            if is_alive(pid):
                os.kill(pid, signal.SIGKILL)


@pytest.fixture
def launched(tmp_path):
    started = []

    def launch(*words, **more):
        started.append(Launched(tmp_path, words, **more))
        return started[-1]

    yield launch
    for one in started:
        one.close()


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_signal_ends_all_of_its_processes_and_no_other(launched, tmp_path, signum):
    run = launched("--simulated")
    run.wait_up()
    assert set(run.pids) == {"mavproxy", "stray", "other", "vehicle", "child"}
    assert f"curl http://127.0.0.1:{run.port}/command/arm" in run.out
    run.process.send_signal(signum)
    assert run.status() == 0
    assert run.ours() == []
    assert is_alive(run.pids["other"]), "what MAVProxy started in another session is not ours to end"
    [run_dir] = (tmp_path / "state" / "mavproxy-uavapi" / "uav10").iterdir()
    assert "Unloading module uavapi" in (run_dir / "mavproxy.log").read_text()
    assert {entry.name for entry in tmp_path.iterdir()} == {
        *("mavproxy.py", "vehicle.py", "driver.py", "pids", "out", "state")
    }


def test_killed_launcher_takes_everything_with_it(launched):
    run = launched("--simulated")
    run.wait_up()
    run.process.kill()
    assert eventually(lambda: run.ours() == [])
    assert is_alive(run.pids["other"])


def test_mavproxy_that_does_not_listen_is_killed(launched):
    run = launched(mode="deaf")
    run.wait_up()
    run.process.terminate()
    assert run.status() == 0
    assert run.ours() == []


def test_clean_end_of_mavproxy_is_status_0(launched):
    run = launched("--simulated")
    run.wait_up()
    os.kill(run.pids["mavproxy"], signal.SIGTERM)
    assert run.status() == 0
    assert run.ours() == []


def test_crash_of_mavproxy_is_one_line_with_its_log(launched):
    run = launched("--simulated", mode="crash")
    assert run.status() == 1
    assert "MAVProxy ended with status 1: cannot open the link (log: " in run.out
    assert run.ours() == []


def test_api_that_cannot_load_ends_the_wait_in_mavproxys_words(launched):
    run = launched("--simulated", mode="no module")
    assert run.status() == 1
    assert "mavproxy-uavapi: Failed to load module: uavapi: no setting 'x'. (log: " in run.out
    assert run.ours() == []


def test_api_that_never_answers_leaves_a_vehicle_its_mavproxy(launched):
    run = launched(mode="silent")
    assert eventually(lambda: "does not answer after" in run.out or run.process.poll() is not None)
    time.sleep(0.5)
    assert run.process.poll() is None and is_alive(run.pids["mavproxy"]), run.out
    run.process.terminate()
    assert run.status() == 0
    assert run.ours() == []


def test_api_that_never_answers_ends_a_simulation_that_nobody_looks_at(launched):
    run = launched("--simulated", mode="silent")
    assert run.status() == 1
    assert f"the API at http://127.0.0.1:{run.port} does not answer after" in run.out
    assert run.ours() == []


def test_mavproxy_killed_from_outside_is_reported_as_a_shell_would(launched):
    run = launched()
    run.wait_up()
    os.kill(run.pids["mavproxy"], signal.SIGKILL)
    assert run.status() == 128 + signal.SIGKILL
    assert run.ours() == []


def test_vehicle_that_does_not_start_is_one_line_with_its_log(launched):
    run = launched("--simulated", mode="no vehicle")
    assert run.status() == 1
    assert "the vehicle did not start: sim: the port is taken (log: " in run.out
    assert run.ours() == []


def test_vehicle_that_dies_ends_the_run(launched):
    run = launched("--simulated")
    run.wait_up()
    os.kill(run.pids["vehicle"], signal.SIGKILL)
    assert run.status() == 1
    assert "the simulated vehicle ended" in run.out
    assert run.ours() == []


@pytest.mark.parametrize("typed", [b"exit\n", b"\x03", b"\x04"])
def test_at_a_terminal_mavproxy_has_the_prompt_and_ends_the_run(launched, typed):
    keyboard, terminal = pty.openpty()
    try:
        run = launched("--simulated", stdin=terminal)
        run.wait_up()
        assert os.getpgid(run.pids["mavproxy"]) == run.process.pid, "the terminal's foreground group"
        assert os.getsid(run.pids["vehicle"]) != run.process.pid, "out of reach of the terminal's Ctrl-C"
        os.write(keyboard, typed)
        assert run.status() == 0
        assert run.ours() == []
    finally:
        os.close(keyboard)
        os.close(terminal)


def test_at_a_terminal_a_signal_to_the_launcher_ends_the_run_too(launched):
    keyboard, terminal = pty.openpty()
    try:
        run = launched("--simulated", stdin=terminal, mode="deaf")
        run.wait_up()
        before = termios.tcgetattr(terminal)
        run.process.terminate()
        assert run.status() == 0
        assert run.ours() == []
        assert termios.tcgetattr(terminal) == before
    finally:
        os.close(keyboard)
        os.close(terminal)
