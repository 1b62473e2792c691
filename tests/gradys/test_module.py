from __future__ import annotations

import asyncio
import contextlib
import sqlite3
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import gradys
from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.module import HELP
from tests.support.mavproxy import MainLoop


@pytest.fixture
def make(mpstate: SimpleNamespace, main_loop: MainLoop, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Loads the module, up to its first idle task."""
    made: list[Any] = []

    def load(**keywords: Any) -> Any:
        module = gradys.init(mpstate, **{"spool": str(tmp_path / "spool.db"), **keywords})
        made.append(module)
        main_loop.modules.append(module)
        main_loop.turn()
        return module

    yield load
    for module in made:
        if module in module.host.members:
            module.unload()


def test_module_is_what_mavproxy_looks_for(make: Callable[..., Any], mpstate: SimpleNamespace) -> None:
    module = make()
    assert module.name == "gradys"
    assert list(mpstate.command_map) == ["gradys"]


def test_status_says_what_it_does_and_help_what_it_can(
    make: Callable[..., Any], capsys: pytest.CaptureFixture[str]
) -> None:
    module = make()
    capsys.readouterr()
    module.command([])
    assert capsys.readouterr().out.startswith("gradys: running\nno ground station is set")
    module.command(["help"])
    assert capsys.readouterr().out == HELP + "\n"


def test_before_the_first_idle_task_it_says_that_mavproxy_is_starting(
    mpstate: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    module = gradys.init(mpstate)
    for command in (lambda: module.command(["status"]), lambda: module.host.commands["fly"](["a.plan"])):
        command()
        assert "still starting" in capsys.readouterr().out
    module.command(["set", "gs", "10.0.0.5:8000"])
    module.command(["set", "gs"])
    assert capsys.readouterr().out.split()[:4] == ["gs", "10.0.0.5:8000", "gradys", "set"]
    module.unload()


def test_config_reports_the_source_of_each_value_and_no_secret(
    mpstate: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    module = gradys.init(mpstate, token="s3cret", sink="mqtt://me:pass@broker/x")
    module.command(["set", "period", "2"])
    capsys.readouterr()
    module.command(["config"])
    lines = capsys.readouterr().out
    assert [line.split()[0] for line in lines.splitlines()] == module.module_settings.names()
    rows = {line.split()[0]: line.split()[1:] for line in lines.splitlines()}
    assert rows["period"] == ["2.0", "gradys", "set"]
    assert rows["timeout"] == ["3.0", "default"]
    assert rows["token"] == ["(set)", "module", "load"]
    assert rows["sink"] == ["mqtt://me:***@broker/x", "module", "load"]
    assert "s3cret" not in lines and "pass" not in lines
    module.command(["set"])
    assert capsys.readouterr().out == lines
    module.command(["set", "perod"])
    assert capsys.readouterr().out == "gradys: no setting 'perod'; did you mean period?\n"
    module.unload()


def test_loading_and_unloading_leaves_nothing_behind(
    mpstate: SimpleNamespace, descriptors: Callable[[], int], threads: Callable[[], list[str]], tmp_path: Path
) -> None:
    names, before, functions = threads(), descriptors(), dict(mpstate.completion_functions)
    for _ in range(20):
        module = gradys.init(mpstate, gs="127.0.0.1:9", sink="http://127.0.0.1:9/r", spool=str(tmp_path / "s.db"))
        module.idle_task()
        module.unload()
    assert (mpstate.command_map, mpstate.completions, mpstate.select_extra) == ({}, {}, {})
    assert mpstate.completion_functions == functions
    assert (threads(), descriptors()) == (names, before)


def test_routes_come_and_go_with_it(mpstate: SimpleNamespace) -> None:
    module = gradys.init(mpstate)  # without an idle task: a client may call as soon as it is loaded
    host = module.host
    assert set(host.extensions) == {
        "/gradys/status",
        "/gradys/readings",
        "/gradys/recent",
        "/gradys/flush",
        "/mission/fly-track",
    }
    module.unload()
    assert host.extensions == {} and host.commands == {}


def test_setting_takes_effect_at_once(
    make: Callable[..., Any], main_loop: MainLoop, capsys: pytest.CaptureFixture[str]
) -> None:
    module = make(gs="127.0.0.1:9")
    module.command(["set", "gs", "127.0.0.1:8,127.0.0.1:7"])
    main_loop.until(lambda: "pushing to http://127.0.0.1:8, http://127.0.0.1:7" in capsys.readouterr().out)
    module.command(["status"])
    output = capsys.readouterr().out
    assert "ground station http://127.0.0.1:8" in output and "ground station http://127.0.0.1:7" in output
    assert "127.0.0.1:9" not in output


def test_the_prompt_waits_for_no_goodbye(
    make: Callable[..., Any], main_loop: MainLoop, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    leaving, left = threading.Event(), threading.Event()

    class Slow:
        async def send(self, batch: Any) -> Any:
            raise NotDelivered("nobody is there")

        async def close(self) -> None:
            leaving.set()
            await asyncio.to_thread(left.wait, 120)

    monkeypatch.setattr("mavproxy_gradys.forwarding.sender.make_sink", lambda *_: Slow())
    module = make(sink="http://127.0.0.1:9/r", quantities="")
    main_loop.until(lambda: "no ground station" in capsys.readouterr().out)
    module.command(["set", "gs", "127.0.0.1:8"])
    module.command(["stop"])
    module.command(["set", "period", "2"])
    assert leaving.wait(60)
    assert "pushing to" not in capsys.readouterr().out  # the prompt was free all the time
    left.set()
    main_loop.until(lambda: "stopped" in capsys.readouterr().out)


def test_a_stopped_module_stays_stopped_when_a_setting_changes(
    make: Callable[..., Any], capsys: pytest.CaptureFixture[str]
) -> None:
    module = make(gs="127.0.0.1:9")
    module.command(["stop"])
    module.command(["set", "period", "2"])
    capsys.readouterr()
    module.command(["status"])
    assert capsys.readouterr().out.startswith("gradys: stopped")


class FullDisk:
    """Every spool's `append` fails; `makes_room` ends that."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._full = True
        append = Spool.append

        def appended(spool: Spool, readings: Any) -> list[int]:
            if self._full:
                raise sqlite3.OperationalError("database or disk is full")
            return append(spool, readings)

        monkeypatch.setattr(Spool, "append", appended)

    def makes_room(self) -> None:
        self._full = False


@pytest.fixture
def full_disk(monkeypatch: pytest.MonkeyPatch) -> FullDisk:
    return FullDisk(monkeypatch)


def put(module: Any, count: int) -> None:
    """Have that many readings wait in memory."""

    async def wait() -> None:
        for number in range(count):
            module.gradys.pipeline._started_thread().put(Reading("uav-1", 1, "alt", "m", float(number), 0.0))

    module.host.bridge.run(wait())


def kept(file: Path) -> int:
    with contextlib.closing(sqlite3.connect(file)) as db:
        (count,) = db.execute("SELECT count(*) FROM readings").fetchone()
    return int(count)


@pytest.mark.parametrize(("count", "lost"), [(1, "1 reading is lost: "), (12, "12 readings are lost: ")])
def test_an_unload_says_how_many_readings_are_lost(
    make: Callable[..., Any],
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    full_disk: FullDisk,
    tmp_path: Path,
    count: int,
    lost: str,
) -> None:
    module = make()
    put(module, count)
    module.unload()
    assert f"gradys: {lost}" in capsys.readouterr().out
    (reported,) = (record.message for record in caplog.records if "lost" in record.message)
    assert reported.startswith(lost) and "disk is full" in reported


def test_an_unload_writes_what_it_can_and_then_says_nothing(
    make: Callable[..., Any], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    module = make()
    put(module, 12)
    module.unload()
    assert "lost" not in capsys.readouterr().out and kept(tmp_path / "spool.db") == 12


@pytest.mark.parametrize("room", [True, False])
def test_what_was_left_at_a_stop_is_tried_once_more_at_the_unload(
    make: Callable[..., Any],
    main_loop: MainLoop,
    capsys: pytest.CaptureFixture[str],
    full_disk: FullDisk,
    tmp_path: Path,
    room: bool,
) -> None:
    module = make()
    put(module, 12)
    module.command(["stop"])
    main_loop.until(lambda: "stopped" in capsys.readouterr().out)
    if room:
        full_disk.makes_room()
    module.unload()
    assert ("12 readings are lost" in capsys.readouterr().out) == (not room)
    assert kept(tmp_path / "spool.db") == (12 if room else 0)


def test_disk_that_hangs_at_the_unload_is_left_and_its_readings_are_told(
    make: Callable[..., Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    module = make()
    hung, requested = threading.Event(), threading.Event()

    def hang(*_: Any) -> list[int]:
        requested.set()
        hung.wait(30)
        return []

    monkeypatch.setattr("mavproxy_gradys.module.LONGEST_END", 0.1)
    monkeypatch.setattr(Spool, "append", hang)
    put(module, 7)
    assert requested.wait(60)
    module.unload()
    assert "gradys: 7 readings" in capsys.readouterr().out
    hung.set()


@pytest.mark.parametrize("keywords", [{"gs": "x:y"}, {"nope": 1}, {"config": "/no/such/file"}])
def test_a_bad_setting_is_an_import_error_of_one_line(mpstate: SimpleNamespace, keywords: dict[str, Any]) -> None:
    with pytest.raises(ImportError) as raised:
        gradys.init(mpstate, **keywords)
    assert "\n" not in str(raised.value)
    assert mpstate.command_map == {}


def test_settings_outlive_a_reload_and_no_password_is_shown(
    mpstate: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sink = "mqtt://me:secret@127.0.0.1/fleet"
    module = gradys.init(mpstate, spool=str(tmp_path / "spool.db"), sink=sink, token="hidden")
    module.command(["set", "gs", "127.0.0.1:9"])
    module.unload()
    again = gradys.init(mpstate)
    reported = capsys.readouterr().out
    assert "sink=mqtt://me:***@127.0.0.1/fleet, token=(set), gs=127.0.0.1:9" in reported
    assert "secret" not in reported and "hidden" not in reported
    settings = again.module_settings.snapshot()
    assert ([sink.url for sink in settings.sink], settings.token, settings.gs[0].url) == (
        [sink],
        "hidden",
        "http://127.0.0.1:9",
    )
    again.unload()


def test_after_a_defect_too_an_unload_says_what_is_lost(
    make: Callable[..., Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, main_loop: MainLoop
) -> None:
    module = make()

    def defect(*_: Any) -> list[int]:
        raise RuntimeError("a defect")

    monkeypatch.setattr(Spool, "append", defect)
    put(module, 3)
    with contextlib.suppress(RuntimeError):
        module.unload()
    assert "gradys: 3 readings are lost" in capsys.readouterr().out


def test_a_sink_that_takes_long_to_say_goodbye_costs_no_reading(
    make: Callable[..., Any],
    main_loop: MainLoop,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    long_waits: None,
) -> None:
    leaving = asyncio.Event()

    class Slow:
        async def send(self, batch: Any) -> Any:
            raise NotDelivered("nobody is there")

        async def close(self) -> None:
            await leaving.wait()

    monkeypatch.setattr("mavproxy_gradys.forwarding.sender.make_sink", lambda *_: Slow())
    monkeypatch.setattr("mavproxy_gradys.module.LONGEST_END", 2.0)
    module = make(sink="http://127.0.0.1:9/r", quantities="")
    main_loop.until(lambda: "no ground station" in capsys.readouterr().out)
    put(module, 5)
    module.unload()
    assert "lost" not in capsys.readouterr().out and kept(tmp_path / "spool.db") == 5
