"""Rigs: a vehicle and a MAVProxy that flies it, as real processes; see `tests/support/processes.py`."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from types import ModuleType

import pytest

from tests.support import processes
from tests.support.lan import Lan
from tests.support.processes import Rig, ardupilot, ardupilot_with_faults, embedded
from tests.support.wired_rig import WiredRig


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A rig that the tests of a file share; each leaves it fit to fly. With RIG_LOGS in the file MAVProxy logs."""
    directory, logs = tmp_path_factory.mktemp(request.param), getattr(request.module, "RIG_LOGS", False)
    made = embedded(directory, logs=logs) if request.param == "embedded" else ardupilot(directory)
    yield made
    made.stop()


@pytest.fixture(scope="module")
def embedded_rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A rig with the embedded vehicle, for tests that need its back door.

    Its file may set RIG_SPEEDUP, and RIG_LOGS as for `rig`.
    """
    speedup = getattr(request.module, "RIG_SPEEDUP", processes.SPEEDUP)
    logs = getattr(request.module, "RIG_LOGS", False)
    made = embedded(tmp_path_factory.mktemp("embedded"), speedup=speedup, logs=logs)
    yield made
    made.stop()


@pytest.fixture(scope="module", params=["lockstep", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def faulty_rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A rig with a back door: what was sent can be seen, and the link, the pilot and the vehicle can misbehave.

    The embedded vehicle flies in lock step here, ArduPilot by real processes.
    """
    directory = tmp_path_factory.mktemp(request.param)
    if request.param == "lockstep":
        made: Rig = WiredRig(directory)
    else:
        made = ardupilot_with_faults(directory, link_timeout=5, max_age=5)
    yield made
    made.stop()


def free_network() -> str:
    """The first three numbers of a network of which this machine has none: a run that was killed leaves its own."""
    have = subprocess.run(["ip", "-4", "-o", "address"], capture_output=True, text=True, check=False).stdout
    networks = (f"10.213.{(os.getpid() + other) % 250}" for other in range(250))
    return next(network for network in networks if f"{network}." not in have)


@pytest.fixture
def lan() -> Iterator[Lan]:
    """Another computer on a LAN; only root may make one."""
    name, link, net = f"uavapi-{os.getpid()}", f"uavapi{os.getpid() % 100000}", free_network()
    commands = (
        f"netns add {name}",
        f"link add {link} type veth peer name eth0 netns {name}",
        # An IPv6 address that is confirmed a second later would have a browser there give up its requests.
        f"link set {link} addrgenmode none",
        f"-n {name} link set eth0 addrgenmode none",
        f"addr add {net}.1/24 dev {link}",
        f"link set {link} up",
        f"-n {name} addr add {net}.2/24 dev eth0",
        f"-n {name} link set eth0 up",
        f"-n {name} link set lo up",
    )
    try:
        for command in commands:
            done = subprocess.run(["ip", *command.split()], capture_output=True, text=True, check=False)
            if done.returncode and not (os.environ.get("CI") and os.geteuid() == 0):
                pytest.skip(f"no network namespace can be made here: {done.stderr.strip()}")
            assert done.returncode == 0, done.stderr
        yield Lan(f"{net}.1", f"{net}.0/24", ("ip", "netns", "exec", name))
    finally:
        subprocess.run(["ip", "link", "del", link], capture_output=True, check=False)
        subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


@pytest.fixture(scope="session")
def poster() -> ModuleType:
    """The module `poster`; a machine without OpenCV has none."""
    pytest.importorskip("cv2")
    from tests.support import poster

    return poster


@pytest.fixture(scope="session")
def harness() -> ModuleType:
    """The module `processes`, for tests that start some of their own."""
    return processes
