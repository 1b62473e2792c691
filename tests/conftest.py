"""What all tests share: the loop, MAVProxy's state, a host, and a small scripted copter at its other end."""

from __future__ import annotations

import asyncio
import gc
import itertools
import os
import re
import shutil
import signal
import sys
import threading
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere
os.environ["UAVAPI_FLIGHTS"] = "off"  # what is flown here is recorded where a test wishes it

import pytest
from packaging.requirements import Requirement

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.mainloop.bridge import Bridge
from mavproxy_uavapi.core.mainloop.listening import STANDS
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support import chromium
from tests.support.drone import Drone
from tests.support.fake_link import FakeLink
from tests.support.mavproxy import MainLoop, mavproxy_state
from tests.support.pilotage import Pilotage
from tests.support.virtual_time import FastLoop

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


@pytest.fixture
def loop() -> Iterator[FastLoop]:
    """The asyncio loop of the test; it must end without a defect."""
    loop = FastLoop()
    asyncio.set_event_loop(loop)
    yield loop
    if not loop.is_closed():
        loop.end()
    assert loop.defects == []


@pytest.fixture
def mpstate() -> SimpleNamespace:
    """MAVProxy's state, with one link up."""
    return mavproxy_state()


@pytest.fixture
def main_loop(mpstate: SimpleNamespace) -> MainLoop:
    """MAVProxy's main loop over `mpstate`."""
    return MainLoop(mpstate)


@pytest.fixture
def host(loop: FastLoop, mpstate: SimpleNamespace) -> Iterator[Host]:
    """A host whose asyncio side runs in the test's loop and clock."""
    host = Host(mpstate, clock=loop.time, link=FakeLink(), loop=loop)

    def read() -> None:
        """MAVProxy's main loop reads all the time, also while no vehicle says anything."""
        host.bridge.listening.look(lambda: False)
        loop.call_later(STANDS / 2, read)

    read()
    yield host
    host.bridge._calls.close()


@pytest.fixture
def link(host: Host) -> FakeLink:
    """The host's way out: remembers what was sent."""
    return host.link


@pytest.fixture
def registry(host: Host) -> VehicleRegistry:
    """The vehicles."""
    return host.registry


@pytest.fixture
def make_drone(loop: FastLoop, host: Host) -> Callable[..., Drone]:
    """Puts a drone on the link: `make_drone(system=2)`. Several share the link."""
    drones: list[Drone] = []

    def on_send(message: Any, system: int) -> None:
        for drone in drones:
            drone.on_send(message, system)

    def receive(message: Any) -> None:
        host.bridge.feed(message)
        host.bridge.turn()

    def make(system: int = 1) -> Drone:
        drone = Drone(loop, receive, system)
        drones.append(drone)
        host.link.on_send = on_send
        drone.power_on()
        loop.settle()
        return drone

    return make


@pytest.fixture
def drone(make_drone: Callable[..., Drone]) -> Drone:
    """The vehicle at the other end, with system id 1: on the ground in STABILIZE, ready to arm."""
    return make_drone()


@pytest.fixture
def flying(loop: FastLoop, drone: Drone) -> Drone:
    """The drone, 20 m above home in GUIDED."""
    drone.fly()
    loop.settle()
    return drone


@pytest.fixture
def copter(drone: Drone, registry: VehicleRegistry) -> Vehicle:
    """Our side of the drone."""
    return registry.find(1)


@pytest.fixture
def pilotage(loop: FastLoop, host: Host, copter: Vehicle) -> Iterator[Pilotage]:
    """Verbs of the drone's as jobs."""
    pilotage = Pilotage(loop, host.jobs, copter)
    yield pilotage
    pilotage.book.on_ended.clear()  # what is in flight yet ends with the loop: nothing must follow it


def open_descriptors() -> int:
    """How many descriptors this process has open."""
    return len(os.listdir("/proc/self/fd"))


@pytest.fixture
def descriptors() -> Callable[[], int]:
    """`open_descriptors`; what earlier tests have left to the garbage collector is closed."""
    gc.collect()
    return open_descriptors


def running_threads() -> list[str]:
    """The names of the threads that `threading` started.

    Without a `_DummyThread`: a collection of garbage may run in pytest-xdist's thread, and what it ends may log; then
    Python lists that thread for ever.
    """
    return sorted(thread.name for thread in threading.enumerate() if not isinstance(thread, threading._DummyThread))


@pytest.fixture
def threads() -> Callable[[], list[str]]:
    """`running_threads`."""
    return running_threads


@pytest.fixture
def asked_for() -> dict[str, list[Requirement]]:
    """What pyproject.toml asks for: by extra, with what an extra takes from others; under "" without any extra."""
    with (Path(__file__).parents[1] / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    extras = project["optional-dependencies"]

    def requested(extra: str) -> Iterator[Requirement]:
        for line in map(Requirement, extras[extra]):
            if line.name == project["name"]:
                for other in sorted(line.extras):
                    yield from requested(other)
            else:
                yield line

    return {"": [*map(Requirement, project["dependencies"])], **{extra: [*requested(extra)] for extra in extras}}


@pytest.fixture
def boards() -> Any:
    """The module that draws chessboards."""
    pytest.importorskip("cv2")
    from tests.support import boards

    return boards


@pytest.fixture
def long_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """What waits for the asyncio thread in vain does so for two minutes: no slow machine looks like that."""
    monkeypatch.setattr(Bridge, "patience", 120.0)


SHARES = 10  # of the long tests and the cases of a matrix; each run of CI takes another one
ALWAYS = 0  # the share of a matrix that every run takes


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", default="all", help="which long tests: all, none, or a number, which is one in ten")


def is_left_out(item: pytest.Item, which: str) -> bool:
    """Whether it is a long test, or a case of a matrix, whose turn it is not."""
    # The tests of such a file share their processes.
    is_real = "end_to_end" in item.path.parts and item.get_closest_marker("apart") is None
    share = zlib.crc32((item.path.name if is_real else item.nodeid).encode()) % SHARES
    is_case = item.get_closest_marker("matrix") is not None and hasattr(item, "callspec")
    waits = item.get_closest_marker("long") is not None or (is_case and share != ALWAYS)
    return waits and (which == "none" or share != int(which) % SHARES)


# Begun first, in this order.
LONGEST = ("end_to_end/test_hostile", "end_to_end/test_vision", "end_to_end/", "rules/", "vision/landing/")


def pytest_configure() -> None:
    """Heed what a run in the background (nohup, `&`) ignores: what our tests start would ignore it too.

    No garbage is looked for while tests are collected: there is none, and it takes a third of the time.
    """
    gc.disable()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_finish() -> None:
    """Have the garbage collector pass over what was imported and collected: it stays, and is much."""
    gc.collect()
    gc.freeze()
    gc.enable()
    gc.set_threshold(50_000, 20, 100)  # a flight in virtual time makes many objects: looking for cycles took 15 %


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with what takes longest, and leave out what this machine has not got, and what has its turn later.

    Files that wait for real processes alternate with files that compute, so that no processor rests. Without
    ArduPilot there is nothing that the tests marked `sitl` could run on. A bare machine lacks tmux, a browser or a
    broker: what needs them is skipped there, but never in CI.
    """
    if not os.environ.get("ARDUPILOT_HOME"):
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("sitl")])
        items[:] = [item for item in items if not item.get_closest_marker("sitl")]
    which = config.getoption("long")
    if which != "all":
        config.hook.pytest_deselected(items=[item for item in items if is_left_out(item, which)])
        items[:] = [item for item in items if not is_left_out(item, which)]
    items.sort(key=lambda item: next((n for n, part in enumerate(LONGEST) if part in item.nodeid), len(LONGEST)))
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    waiting = [file for file in files if file.parent.name == "end_to_end"]
    computing = [file for file in files if file not in waiting]
    pairs = itertools.zip_longest(waiting, computing)
    items[:] = [item for pair in pairs for file in pair if file is not None for item in files[file]]
    if os.environ.get("CI"):
        return
    for item in items:
        for marker in item.iter_markers("needs"):
            program, package = marker.args[0], marker.args[-1]
            programs = chromium.PROGRAMS if program == "chromium" else (program,)
            if not any(shutil.which(one, path=os.environ["PATH"] + ":/usr/sbin") for one in programs):
                item.add_marker(pytest.mark.skip(reason=f"{program} is not installed (apt-get install {package})"))


def pytest_unconfigure(config: pytest.Config) -> None:
    """Say in the last line which programs would bring how many more tests."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reasons = [str(report.longrepr) for report in reporter.stats.get("skipped", ())] if reporter else []
    packages = Counter(
        match[1]
        for reason in reasons
        if (match := re.search(r"is not installed \(apt-get install ([^\s)]+)\)", reason))
    )
    if reporter and packages:
        more = ", ".join(f"{package} ({count} more)" for package, count in packages.most_common())
        reporter.write_line(f"Tests were skipped for want of programs; apt-get install: {more}")


@pytest.fixture
def ini(tmp_path: Path) -> Callable[[str], str]:
    """Writes an INI file, and says where it is."""

    def write(text: str) -> str:
        file = tmp_path / "uavapi.ini"
        file.write_text(text, encoding="utf-8")
        return str(file)

    return write
