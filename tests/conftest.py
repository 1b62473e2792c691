"""What all tests share: a time-travelling asyncio loop, messages as they come off the wire, MAVProxy's state."""

from __future__ import annotations

import asyncio
import importlib.util
import os
import runpy
import selectors
import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported anywhere

import pytest
from pymavlink import mavutil

mavlink = mavutil.mavlink

NOTHING_HAPPENS = 5.0  # real s after which a loop that waits for nothing but other threads is called stuck


class TimeTravellingLoop(asyncio.SelectorEventLoop):
    """An asyncio loop that never waits: when nothing is ready, its clock jumps to the next timer.

    Attributes:
        patience: real s that sockets get to become ready before the clock jumps; 0 without sockets.
        defects: what reached the loop's exception handler; a test that expects some clears them.
    """

    def __init__(self) -> None:
        self.now = 1000.0
        self.patience = 0.0
        self.defects: list[dict[str, Any]] = []
        super().__init__(_JumpingSelector(self))
        self.set_exception_handler(lambda _, context: self.defects.append(context))

    def time(self) -> float:
        return self.now

    def run(self, coroutine: Any) -> Any:
        """The coroutine's result."""
        return self.run_until_complete(coroutine)

    def pass_time(self, seconds: float) -> None:
        """Let that much time go by."""
        self.run_until_complete(asyncio.sleep(seconds))

    def settle(self) -> None:
        """Run what is ready, without any time going by."""

        async def a_few_rounds() -> None:
            for _ in range(20):
                await asyncio.sleep(0)

        self.run_until_complete(a_few_rounds())


class _JumpingSelector(selectors.DefaultSelector):
    def __init__(self, loop: TimeTravellingLoop) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> Any:
        if timeout is None:
            ready = super().select(NOTHING_HAPPENS)
            if not ready:
                raise RuntimeError("nothing will ever happen: no timer, no socket")
            return ready
        ready = super().select(min(timeout, self._loop.patience))
        if not ready:
            self._loop.now += max(timeout, 0.0)
        return ready


@pytest.fixture
def loop() -> Iterator[TimeTravellingLoop]:
    """The asyncio loop of the test; it must end without a defect."""
    loop = TimeTravellingLoop()
    asyncio.set_event_loop(loop)
    yield loop
    if not loop.is_closed():
        tasks = asyncio.all_tasks(loop)
        for task in tasks:
            task.cancel()
        if tasks:
            loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.run_until_complete(loop.shutdown_default_executor())
        loop.close()
    asyncio.set_event_loop(None)
    assert loop.defects == []


DEFAULTS: dict[str, dict[str, Any]] = {
    "heartbeat": {
        "type": mavlink.MAV_TYPE_QUADROTOR,
        "autopilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        "base_mode": mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
        "custom_mode": 0,
        "system_status": mavlink.MAV_STATE_STANDBY,
        "mavlink_version": 3,
    },
    "statustext": {"severity": mavlink.MAV_SEVERITY_CRITICAL},
    "command_ack": {"result": mavlink.MAV_RESULT_ACCEPTED},
    "param_value": {"param_type": mavlink.MAV_PARAM_TYPE_REAL32, "param_count": 1, "param_index": 0},
    "home_position": {"x": 0.0, "y": 0.0, "z": 0.0, "q": [1.0, 0.0, 0.0, 0.0]}
    | dict.fromkeys(("approach_x", "approach_y", "approach_z"), 0.0),
    "extended_sys_state": {"vtol_state": 0},
}


def message_of(name: str, system: int = 1, component: int = 1, sequence: int = 0, **fields: Any) -> Any:
    """A message as pymavlink hands it over after parsing; fields that are not given are 0.

    `armed` and `mode` spell a heartbeat's bits; texts may be given as str.
    """
    cls = getattr(mavlink, f"MAVLink_{name.lower()}_message")
    given = {**DEFAULTS.get(name.lower(), {}), **fields}
    if given.pop("armed", False):
        given["base_mode"] |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    if "mode" in given and name.lower() == "heartbeat":
        given["custom_mode"] = mavutil.mode_mapping_byname(given["type"])[given.pop("mode")]
    for field in cls.fieldnames:
        given.setdefault(field, 0)
        if isinstance(given[field], str):
            given[field] = given[field].encode()
    message = cls(**given)
    message._header = mavlink.MAVLink_header(cls.id, srcSystem=system, srcComponent=component, seq=sequence % 256)
    return message


@pytest.fixture
def msg() -> Callable[..., Any]:
    """`message_of`."""
    return message_of


class FakeMaster:
    """One of MAVProxy's links: remembers what is written to it."""

    def __init__(self) -> None:
        self.written: list[Any] = []
        self.mav = SimpleNamespace(send=self.written.append)


def mavproxy_state() -> Any:
    """What our modules touch of MAVProxy's `mpstate`."""
    master = FakeMaster()
    return SimpleNamespace(
        select_extra={},
        command_map={},
        completions={},
        completion_functions={"(OTHER)": len},
        multi_instance={},
        instance_count={},
        public_modules={},
        settings=SimpleNamespace(target_system=0, target_component=0, source_system=255, source_component=230),
        status=SimpleNamespace(logdir=None),
        continue_mode=False,
        mav_param_by_sysid={},
        the_master=master,
        master=lambda system=None: master,
    )


@pytest.fixture
def mpstate() -> Any:
    """MAVProxy's state, with one link up."""
    return mavproxy_state()


class MainLoop:
    """MAVProxy's main loop, turned by hand: `select()` over select_extra, then the modules' idle tasks."""

    def __init__(self, mpstate: Any) -> None:
        self._mpstate = mpstate
        self.modules: list[Any] = []

    def turn(self, wait: float = 0.0) -> None:
        """One turn; wakes early when one of our descriptors does."""
        with selectors.DefaultSelector() as selector:
            for fd in self._mpstate.select_extra:
                selector.register(fd, selectors.EVENT_READ)
            ready = [key.fd for key, _ in selector.select(wait)] if selector.get_map() else []
        for fd in ready:
            function, argument = self._mpstate.select_extra[fd]
            function(argument)
        for module in self.modules:
            module.idle_task()

    def until(self, condition: Callable[[], Any], turns: int = 500) -> None:
        """Turn until that holds."""
        for _ in range(turns):
            if condition():
                return
            self.turn(0.01)
        raise AssertionError("it did not happen")


@pytest.fixture
def main_loop(mpstate: Any) -> MainLoop:
    """MAVProxy's main loop over `mpstate`."""
    return MainLoop(mpstate)


def open_descriptors() -> int:
    """How many descriptors this process has open."""
    return len(os.listdir("/proc/self/fd"))


@pytest.fixture
def descriptors() -> Callable[[], int]:
    """`open_descriptors`."""
    return open_descriptors


def load_file(path: str) -> Any:
    """A module of our tests that is no test, by its path under tests/, loaded once."""
    name = "helpers_" + path.replace("/", "_").removesuffix(".py")
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, Path(__file__).parent / path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    return sys.modules[name]


@pytest.fixture(scope="session")
def helper() -> Callable[[str], Any]:
    """`load_file`."""
    return load_file


@pytest.fixture
def setup_py() -> dict[str, Any]:
    """What setup.py gives to setuptools."""
    import setuptools

    with pytest.MonkeyPatch.context() as patch:
        given: dict[str, Any] = {}
        patch.setattr(setuptools, "setup", given.update)
        runpy.run_path(str(Path(__file__).parents[1] / "setup.py"))
    return given


@pytest.fixture
def boards(helper: Callable[[str], Any]) -> Any:
    """The module that draws chessboards."""
    pytest.importorskip("cv2")
    return helper("vision/boards.py")


def pytest_configure() -> None:
    """Heed what a run in the background (nohup, `&`) ignores: what our tests start would ignore it too."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what this machine has not got.

    Without ArduPilot there is nothing that the tests marked `sitl` could run on. A bare machine lacks tmux, a
    browser or a broker: what needs them is skipped there, but never in CI.
    """
    if not os.environ.get("ARDUPILOT_HOME"):
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("sitl")])
        items[:] = [item for item in items if not item.get_closest_marker("sitl")]
    if os.environ.get("CI"):
        return
    for item in items:
        for marker in item.iter_markers("needs"):
            program, package = marker.args[0], marker.args[-1]
            if shutil.which(program, path=os.environ["PATH"] + ":/usr/sbin") is None:
                item.add_marker(pytest.mark.skip(reason=f"{program} is not installed (apt-get install {package})"))
