"""What runs on Windows runs on a Python without POSIX; what does not says so."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import requests
from pymavlink import mavutil

from mavproxy_uavapi.core.platform import NEEDED
from tests.support import as_windows
from tests.support.back_door import RemoteDoor
from tests.support.ports import free_instance, free_port
from tests.support.processes import Process, eventually

LIKE_WINDOWS = [sys.executable, as_windows.__file__]


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Starts a module of ours there, as a process; `started(module, …)`."""
    processes: list[Process] = []

    def start(*command: str) -> Process:
        processes.append(Process([*LIKE_WINDOWS, *command], tmp_path / f"{command[0]}.log", tmp_path))
        return processes[-1]

    yield start
    for process in processes:
        process.stop()


def test_a_simulated_vehicle_is_heard_and_obeys_its_back_door(started: Callable[..., Process]) -> None:
    instance, port = free_instance(), free_port()
    process = started("mavproxy_uavapi.sim", f"--instance={instance}", f"--control={port}")
    process.says("control on tcp")
    master = mavutil.mavlink_connection(f"tcp:127.0.0.1:{5760 + 10 * instance}")
    try:
        assert master.wait_heartbeat(timeout=60) is not None
    finally:
        master.close()
    control = RemoteDoor(port)
    control.fault("pilot_mode", mode="LOITER")
    control.close()


def test_the_station_stores_a_reading(started: Callable[..., Process]) -> None:
    port = free_port()
    process = started("mavproxy_gradys.station", "--port", str(port))
    url = f"http://127.0.0.1:{port}"

    def is_up() -> bool:
        process.require_running()
        try:
            return requests.get(f"{url}/health", timeout=5).ok
        except requests.ConnectionError:
            return False

    eventually(is_up, what="the station")
    reading = {"device": "uav-1", "id": "1", "seq": 1, "quantity": "soil", "representation": "percent", "value": 7}
    taken = requests.post(f"{url}/readings", json={"readings": [{**reading, "time": 1.7e9}]}, timeout=5)
    assert taken.ok, taken.text
    assert [one["value"] for one in requests.get(f"{url}/readings", timeout=5).json()["readings"]] == [7]


@pytest.mark.parametrize("module", ["mavproxy_uavapi.client.drone", "mavproxy_gradys.relay --help"])
def test_it_is_imported(module: str) -> None:
    done = subprocess.run([*LIKE_WINDOWS, *module.split()], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("module", ["uavapi", "vision", "gradys"])
def test_a_module_of_mavproxy_says_what_it_needs(module: str) -> None:
    done = subprocess.run([*LIKE_WINDOWS, module], capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1] == f"ImportError: {NEEDED}"


def test_the_launcher_says_what_it_needs() -> None:
    code = "from tests.support.as_windows import unlike_posix; unlike_posix(); from mavproxy_uavapi.commands import main; exit(main(['--simulated']))"  # noqa: E501
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, f"mavproxy-uavapi: {NEEDED}\n")
