"""`python -m mavproxy_uavapi.sim`: the real process over real sockets."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.ports import free_port

SET_MESSAGE_INTERVAL, SYSTEM_TIME = 511, 2
SIM = [sys.executable, "-m", "mavproxy_uavapi.sim", "--port", "0"]


@contextlib.contextmanager
def running(*arguments):
    """The process and the ports it printed."""
    lines = 2 if "--control" in arguments else 1
    with subprocess.Popen([*SIM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            ports = [int(process.stdout.readline().rsplit(":", 1)[1]) for _ in range(lines)]
            yield process, ports
        finally:
            process.terminate()
            process.wait(60)


def test_mavlink_over_tcp_reconnects_and_a_clean_end():
    with running("--sysid", "3", "--speedup", "20", "--control", "0") as (process, (port, control)):
        for _ in range(2):
            connection = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", retries=1)
            heartbeat = connection.wait_heartbeat(timeout=60)
            assert heartbeat.get_srcSystem() == 3
            connection.close()
        with socket.create_connection(("127.0.0.1", control), timeout=60) as line:
            line.sendall(b'{"op": "state"}\n')
            state = json.loads(line.makefile().readline())
        assert state["mode"] == "STABILIZE"
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
        assert process.stderr.read() == ""


def test_vehicle_lets_others_have_the_processor_first():
    with running() as (process, (port,)):
        connection = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", retries=1)
        connection.wait_heartbeat(timeout=60)
        connection.close()
        assert os.getpriority(os.PRIO_PROCESS, process.pid) > os.getpriority(os.PRIO_PROCESS, 0)


SESSION = Path("/proc/self/autogroup")


@pytest.mark.skipif(not SESSION.exists(), reason="this Linux does not share the processor among sessions")
@pytest.mark.parametrize(("is_leader", "niceness"), [(True, "10"), (False, "0")])
def test_only_a_session_of_its_own_yields_the_processor_as_a_whole(is_leader: bool, niceness: str) -> None:
    program = f"from mavproxy_uavapi.core.platform import yield_processor as y; y(); print(open('{SESSION}').read())"
    words = [sys.executable, "-c", program]
    if not is_leader:
        words = ["setsid", "--wait", "sh", "-c", '"$@"; exit', "sh", *words]
    said = subprocess.run(words, start_new_session=is_leader, capture_output=True, text=True, check=True).stdout
    assert said.split()[-1] == niceness


def test_speedup_runs_simulated_time_faster():
    with running("--speedup", "10") as (_, (port,)):
        connection = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", retries=1)
        connection.wait_heartbeat(timeout=60)
        connection.mav.command_long_send(1, 1, SET_MESSAGE_INTERVAL, 0, SYSTEM_TIME, 100_000, 0, 0, 0, 0, 0)
        deadline = time.monotonic() + 60
        while not 5 <= speedup_of(connection, 0.5) <= 15:  # a process may rest meanwhile
            assert time.monotonic() < deadline
        connection.close()


def speedup_of(connection, seconds):
    """The vehicle's seconds for each of ours, in so many of ours."""
    first, began, ended = heard(connection), time.monotonic(), 0.0
    while ended < began + seconds:
        last, ended = heard(connection), time.monotonic()
    return (last - first) / (ended - began)


def heard(connection):
    """The vehicle's clock (s)."""
    return connection.recv_match(type="SYSTEM_TIME", blocking=True, timeout=60).time_boot_ms / 1000


def test_udp_peers_get_heartbeats_and_can_answer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.bind(("127.0.0.1", 0))
        ground.settimeout(60)
        with running("--udp", f"127.0.0.1:{ground.getsockname()[1]}", "--speedup", "5"):
            data, _ = ground.recvfrom(2048)
    assert data[0] == 0xFD


def test_a_copter_asks_the_rovers_that_it_hears_where_they_are():
    port = free_port()
    with running("--decks", str(port)), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as rover:
        rover.settimeout(60)
        mav = mavlink.MAVLink(None, srcSystem=2)
        heartbeat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GROUND_ROVER, 3, 0, 0, 0, 3)
        rover.sendto(heartbeat.pack(mav), ("127.0.0.1", port))
        (asked,) = mav.parse_buffer(rover.recv(2048))
    assert (asked.target_system, asked.command, asked.param1) == (2, SET_MESSAGE_INTERVAL, 108)


def test_a_taken_port_is_one_line_and_status_1():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        ended = subprocess.run([*SIM[:-1], str(port)], capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 1
    assert ended.stderr.count("\n") == 1
    assert str(port) in ended.stderr


@pytest.mark.parametrize(
    "arguments", [["--speedup", "0"], ["--sysid", "300"], ["--home", "1,2"], ["--battery", "0"], ["--wind", "x"]]
)
def test_bad_options_are_refused(arguments):
    ended = subprocess.run([*SIM, *arguments], capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 2
    assert arguments[0] in ended.stderr
