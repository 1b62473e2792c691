"""`mavproxy-uavapi --simulated`, as `make demo` starts it."""

from __future__ import annotations

import os
import signal
import socket
import sys
from pathlib import Path

import pytest
import requests

from tests.support.ports import free_port

HOME = (-35.2, 149.1)


@pytest.fixture
def station():
    """A ground station's socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(30)
        yield made


@pytest.fixture(params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def launched(request, harness, station, tmp_path):
    port = free_port()
    command = [str(harness.SCRIPTS / "mavproxy-uavapi"), "--simulated", "true", "--speedup", "3"]
    command += ["--port", str(port), "--sysid", "42", "--log_path", str(tmp_path)]
    command += [
        "--location",
        f"{HOME[0]},{HOME[1]},600,90",
        "--gs_connection",
        f"127.0.0.1:{station.getsockname()[1]}",
    ]
    if request.param == "ardupilot":
        command += ["--ardupilot_path", os.environ["ARDUPILOT_HOME"]]
    process = harness.Process([sys.executable, *command], tmp_path / "launcher.log", tmp_path)
    assert process.popen.stdin is not None
    yield process, f"http://127.0.0.1:{port}", tmp_path
    process.stop()


def of_this_run(directory: Path) -> list[str]:
    """The command lines of all processes that name this run's directory, or are tagged with it."""
    lines = []
    for proc in Path("/proc").glob("[0-9]*"):
        try:
            text = (proc / "cmdline").read_bytes() + (proc / "environ").read_bytes()
        except OSError:
            continue
        if str(directory).encode() in text:
            lines.append((proc / "cmdline").read_bytes().replace(b"\0", b" ").decode())
    return lines


def test_one_command_gives_a_vehicle_to_fly_and_ends_all_it_started(launched, station, harness):
    process, url, directory = launched
    printed = process.says("/telemetry/gps", timeout=120)
    lines = [line.strip() for line in printed.splitlines() if "curl" in line]
    assert len(lines) == 3 and all(url in line for line in lines)

    def ask(path):
        answer = requests.get(url + path, timeout=120)
        if answer.json().get("code") != "not_armed":
            assert answer.status_code == 200, answer.text
            assert answer.json()["id"] == "42"
            return True
        return False

    def takes_off():
        return ask("/command/arm") and ask("/command/takeoff?alt=5")

    harness.eventually(takes_off, what="its take-off: armed on the ground it disarms after 10 s of its clock")
    assert ask("/command/land")
    place = requests.get(url + "/telemetry/gps", timeout=10).json()["info"]["position"]
    assert (place["lat"], place["lon"]) == pytest.approx(HOME, abs=1e-4)
    assert station.recv(2048)[0] in (0xFE, 0xFD)  # a MAVLink frame
    os.kill(process.pid, signal.SIGTERM)
    assert process.popen.wait(60) == 0
    harness.eventually(lambda: of_this_run(directory) == [], 60, "the end of all its processes")


def test_a_taken_port_is_one_line(harness, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        command = [sys.executable, str(harness.SCRIPTS / "mavproxy-uavapi"), "--simulated"]
        command += ["--port", str(taken.getsockname()[1]), "--log_path", str(tmp_path)]
        process = harness.Process(command, tmp_path / "launcher.log", tmp_path)
        assert process.popen.wait(60) != 0
        printed = process.output().strip()
        process.stop()
    assert len(printed.splitlines()) == 1 and "taken" in printed
