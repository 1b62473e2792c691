"""`mavproxy-uavapi --simulated`, as `make demo` starts it."""

from __future__ import annotations

import os
import signal
import socket
import sys
from pathlib import Path

import pytest
import requests


@pytest.fixture(params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def launched(request, harness, tmp_path):
    port = harness.free_port()
    command = [str(harness.SCRIPTS / "mavproxy-uavapi"), "--simulated", "true", "--speedup", "10"]
    command += ["--port", str(port), "--sysid", "42", "--log_path", str(tmp_path)]
    if request.param == "ardupilot":
        command += ["--ardupilot_path", os.environ["ARDUPILOT_HOME"]]
    process = harness.Process([sys.executable, *command], tmp_path / "launcher.log", tmp_path)
    assert process.popen.stdin is not None
    yield process, f"http://127.0.0.1:{port}", tmp_path
    process.stop()


def of_this_run(directory: Path) -> list[str]:
    """The command lines of all processes that name this run's directory, or are tagged with it."""
    found = []
    for proc in Path("/proc").glob("[0-9]*"):
        try:
            text = (proc / "cmdline").read_bytes() + (proc / "environ").read_bytes()
        except OSError:
            continue
        if str(directory).encode() in text:
            found.append((proc / "cmdline").read_bytes().replace(b"\0", b" ").decode())
    return found


def test_one_command_gives_a_vehicle_to_fly_and_ends_all_it_started(launched, harness):
    process, url, directory = launched
    said = process.says("/telemetry/gps", timeout=120)
    lines = [line.strip() for line in said.splitlines() if "curl" in line]
    assert len(lines) == 3 and all(url in line for line in lines)
    for path in ("/command/arm", "/command/takeoff?alt=5", "/command/land"):
        answer = requests.get(url + path, timeout=120)
        assert answer.status_code == 200, answer.text
        assert answer.json()["id"] == "42"
    os.kill(process.pid, signal.SIGTERM)
    assert process.popen.wait(30) == 0
    harness.eventually(lambda: of_this_run(directory) == [], 10, "the end of all its processes")


def test_a_taken_port_is_one_line(harness, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        command = [sys.executable, str(harness.SCRIPTS / "mavproxy-uavapi"), "--simulated"]
        command += ["--port", str(taken.getsockname()[1]), "--log_path", str(tmp_path)]
        process = harness.Process(command, tmp_path / "launcher.log", tmp_path)
        assert process.popen.wait(30) != 0
        said = process.output().strip()
        process.stop()
    assert len(said.splitlines()) == 1 and "taken" in said
