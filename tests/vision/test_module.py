"""The module as MAVProxy loads it."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import vision
from mavproxy_uavapi.core import host as hosts
from mavproxy_vision.console import HELP
from mavproxy_vision.landing.flight_jobs import FlightJobs
from mavproxy_vision.settings import SOURCES
from tests.support.mavproxy import MainLoop


@pytest.fixture
def module(mpstate: SimpleNamespace) -> Any:
    module = vision.init(mpstate)
    yield module
    if module in module.host.members:
        module.unload()


@pytest.fixture
def running(module: Any, main_loop: MainLoop) -> Any:
    """The module after MAVProxy's first turn."""
    main_loop.modules.append(module)
    main_loop.turn()
    return module


def output(module: Any, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    capsys.readouterr()
    module.command(list(words))
    return capsys.readouterr().out


def said_later(module: Any, capsys: pytest.CaptureFixture[str], main_loop: MainLoop, *words: str) -> str:
    """What is printed in a later turn of the main loop."""
    assert output(module, capsys, *words) == ""
    printed: list[str] = []
    main_loop.until(lambda: printed.append(capsys.readouterr().out) or printed[-1])
    return printed[-1].strip()


def test_module_is_what_mavproxy_looks_for(module: Any, mpstate: SimpleNamespace) -> None:
    assert module.name == "vision"
    assert list(mpstate.command_map) == ["vision"]


def test_status_says_what_it_is_and_help_what_it_can(module: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert output(module, capsys).startswith("vision: source none")
    assert "AprilTag" in output(module, capsys, "status")
    assert output(module, capsys, "help") == HELP + "\n"


def test_commands_before_the_first_turn_say_so(module: Any, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["start"], ["stop"], ["land"], ["abort"], ["mission"]):
        assert "main loop" in output(module, capsys, *words)


def test_config_and_set_report_the_source_of_each_value(module: Any, capsys: pytest.CaptureFixture[str]) -> None:
    lines = output(module, capsys, "config").splitlines()
    assert [line.split()[0] for line in lines] == module.module_settings.names()
    assert output(module, capsys, "set").splitlines() == lines
    module.command(["set", "speed", "2"])
    assert output(module, capsys, "set", "speed").split()[:4] == ["speed", "2.0", "vision", "set"]
    assert [line.split()[0] for line in output(module, capsys, "set", "sim_[tl]*").splitlines()] == [
        "sim_tags",
        "sim_latency",
    ]
    assert output(module, capsys, "set", "spede") == "vision: no setting 'spede'; did you mean speed?\n"


def test_loading_and_unloading_leaves_nothing_behind(
    mpstate: SimpleNamespace, descriptors: Callable[[], int], threads: Callable[[], list[str]]
) -> None:
    names, before = threads(), descriptors()
    for _ in range(20):
        module = vision.init(mpstate)
        module.idle_task()
        module.unload()
    assert (mpstate.command_map, mpstate.completions, mpstate.select_extra) == ({}, {}, {})
    assert list(mpstate.completion_functions) == ["(OTHER)"]
    assert (threads(), descriptors()) == (names, before)


@pytest.mark.parametrize("turns", [0, 1], ids=["before the first turn", "running"])
def test_a_reload_leaves_nothing_to_say_at_the_end(mpstate: SimpleNamespace, turns: int) -> None:
    host = hosts.join(mpstate, None)  # another module that stays
    before = list(host.closing_messages)
    if turns:
        host.bridge.start()
    for _ in range(3):
        module = vision.init(mpstate)
        for _ in range(turns):
            module.idle_task()
        module.unload()
    assert host.closing_messages == before
    hosts.leave(mpstate, None)


def test_routes_come_and_go_with_it(mpstate: SimpleNamespace) -> None:
    host = hosts.join(mpstate, None)
    earlier = vision.init(mpstate)  # without an idle task: a client may call as soon as it is loaded
    assert {"/vision/status", "/vision/land", "/vision/stream.mjpg"} < set(host.extensions)
    later = vision.init(mpstate)
    routes = dict(host.extensions)
    earlier.unload()  # an unload that took longer than MAVProxy waits ends after the next load
    assert host.extensions == routes
    later.unload()
    assert host.extensions == {}
    hosts.leave(mpstate, None)


def test_a_running_camera_ends_with_the_module(
    mpstate: SimpleNamespace, main_loop: MainLoop, threads: Callable[[], list[str]]
) -> None:
    names = threads()
    module = vision.init(mpstate, source="http")
    main_loop.modules.append(module)
    both = {"vision-camera", "vision-detector"}
    main_loop.until(lambda: both <= set(threads()))
    main_loop.modules.clear()
    module.unload()
    assert threads() == names


def test_a_sources_password_is_never_shown(
    running: Any, main_loop: MainLoop, capsys: pytest.CaptureFixture[str]
) -> None:
    begun = said_later(running, capsys, main_loop, "set", "source", "rtsp://pilot:s3cret@127.0.0.1:1/cam")
    assert begun == "vision: looking for 36h11 through rtsp://pilot:***@127.0.0.1:1/cam"
    main_loop.until(lambda: running.tracker.health.error)
    for word in ("status", "config", "set"):
        text = output(running, capsys, word)
        assert "rtsp://pilot:***@127.0.0.1:1/cam" in text
        assert "s3cret" not in text
    assert "s3cret" not in str(running.tracker.health.error)


def test_without_a_source_the_status_names_none(
    running: Any, main_loop: MainLoop, capsys: pytest.CaptureFixture[str]
) -> None:
    said_later(running, capsys, main_loop, "set", "source", "http")
    assert "http" in output(running, capsys, "status")
    assert said_later(running, capsys, main_loop, "set", "source", '""') == "vision: stopped"
    assert "`vision set source` takes" in output(running, capsys, "status")


def test_routes_come_and_go(running: Any) -> None:
    host = running.host
    assert "/vision/status" in host.extensions
    assert host.extensions["/vision/land"].methods == ("POST",)
    running.unload()
    assert host.extensions == {}


def test_without_a_vehicle_nothing_flies(running: Any, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["land"], ["search"], ["mission"]):
        assert "no vehicle" in output(running, capsys, *words)


def test_bad_words_are_explained(running: Any, capsys: pytest.CaptureFixture[str], main_loop: MainLoop) -> None:
    assert "not an id" in output(running, capsys, "land", "x")
    assert "ALT NORTH EAST" in output(running, capsys, "mission", "a")
    assert "did you mean" in output(running, capsys, "set", "famly", "16h5")
    assert "not one of" in output(running, capsys, "set", "family", "4x4")
    assert "not ID:SIZE" in output(running, capsys, "set", "tags", "0")
    assert running.module_settings.snapshot().tags == "0:0.30"
    assert "one of velocity, landing_target" in output(running, capsys, "set", "method", "magic")
    said = said_later(running, capsys, main_loop, "start")
    assert said == f"vision: no camera is set: `vision set source` takes {SOURCES}"


def test_commands_with_files_print_their_outcome_later(
    running: Any, capsys: pytest.CaptureFixture[str], main_loop: MainLoop, tmp_path: Path
) -> None:
    file = tmp_path / "t.pdf"
    assert said_later(running, capsys, main_loop, "tag", str(file)) == f"vision: wrote {file}"
    assert said_later(running, capsys, main_loop, "snapshot", "a.png") == "vision: there is no frame yet"
    assert said_later(running, capsys, main_loop, "calibrate").startswith("vision: calibrate FOLDER")
    assert said_later(running, capsys, main_loop, "tag", f"{file}/x") == f"vision: {file}/x: Not a directory"


def test_a_setting_that_does_not_exist_is_an_import_error(mpstate: SimpleNamespace) -> None:
    with pytest.raises(ImportError, match="vision: no setting 'nonsense'"):
        vision.init(mpstate, nonsense=1)
    assert mpstate.command_map == {}


def test_nothing_else_of_the_project_needs_opencv() -> None:
    import subprocess

    code = "import mavproxy_uavapi.module, mavproxy_gradys.module, sys; print('cv2' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60).stdout
    assert out.split()[0] == "False"


def test_a_camera_that_hangs_does_not_hold_up_the_main_loop(
    running: Any, capsys: pytest.CaptureFixture[str], main_loop: MainLoop, long_waits: None
) -> None:
    assert "looking for 36h11 through http" in said_later(running, capsys, main_loop, "set", "source", "http")
    hanging, hang = threading.Event(), threading.Event()

    def read() -> None:
        hanging.set()
        hang.wait(120)

    running.tracker.worker.source.read = read
    assert hanging.wait(60)  # its thread is in there now
    began = time.monotonic()
    try:
        assert output(running, capsys, "set", "latency", "20") == ""
        assert output(running, capsys, "stop") == ""
        assert time.monotonic() - began < 30
    finally:
        hang.set()


def test_in_flight_only_what_opens_the_camera_again_is_refused(
    running: Any, capsys: pytest.CaptureFixture[str], main_loop: MainLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FlightJobs, "running", True)
    assert "tags is not changed in flight" in output(running, capsys, "set", "tags", "0:0.5")
    assert output(running, capsys, "set", "leash", "20") == ""
    main_loop.until(lambda: running.tracker.settings.leash == 20)
    assert running.tracker.settings.tags == "0:0.30"


def test_settings_are_taken_while_no_camera_is_set(
    running: Any, capsys: pytest.CaptureFixture[str], main_loop: MainLoop
) -> None:
    assert output(running, capsys, "set", "tags", "0:0.5") == ""
    main_loop.until(lambda: running.tracker.settings.tags == "0:0.5")
    assert output(running, capsys, "status").startswith("vision: source none")


def test_settings_outlive_a_reload(mpstate: SimpleNamespace, capsys: pytest.CaptureFixture[str]) -> None:
    first = vision.init(mpstate, fps=15, family="16h5", tags="0:0.2")
    first.command(["set", "tags", "0:0.4", "1:0.1"])
    first.unload()
    again = vision.init(mpstate)
    assert "vision: as before: fps=15.0, family=16h5, tags=0:0.4 1:0.1 (" in capsys.readouterr().out
    settings = again.module_settings.snapshot()
    assert (settings.fps, settings.family, settings.tags) == (15.0, "16h5", "0:0.4 1:0.1")
    again.unload()
