from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import gradys
from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.module import HELP


@pytest.fixture
def make(mpstate: Any, main_loop: Any, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Loads the module, up to its first idle task."""
    made: list[Any] = []

    def load(**given: Any) -> Any:
        module = gradys.init(mpstate, **{"spool": str(tmp_path / "spool.db"), **given})
        made.append(module)
        main_loop.modules.append(module)
        main_loop.turn()
        return module

    yield load
    for module in made:
        if module in module.host.members:
            module.unload()


def test_module_is_what_mavproxy_looks_for(make: Any, mpstate: Any) -> None:
    module = make()
    assert module.name == "gradys"
    assert list(mpstate.command_map) == ["gradys"]


def test_status_says_what_it_does_and_help_what_it_can(make: Any, capsys: Any) -> None:
    module = make()
    capsys.readouterr()
    module.command([])
    assert capsys.readouterr().out.startswith("gradys: running\nno ground station is set")
    module.command(["help"])
    assert capsys.readouterr().out == HELP + "\n"


def test_before_the_first_idle_task_it_says_that_mavproxy_is_starting(mpstate: Any, capsys: Any) -> None:
    module = gradys.init(mpstate)
    module.command(["status"])
    assert "still starting" in capsys.readouterr().out
    module.command(["set", "gs", "10.0.0.5:8000"])
    module.command(["set", "gs"])
    assert "gs 10.0.0.5:8000" in capsys.readouterr().out
    module.unload()


def test_loading_and_unloading_leaves_nothing_behind(mpstate: Any, descriptors: Any, tmp_path: Path) -> None:
    threads, before, functions = threading.active_count(), descriptors(), dict(mpstate.completion_functions)
    for _ in range(20):
        module = gradys.init(mpstate, gs="127.0.0.1:9", sink="http://127.0.0.1:9/r", spool=str(tmp_path / "s.db"))
        module.idle_task()
        module.unload()
    assert (mpstate.command_map, mpstate.completions, mpstate.select_extra) == ({}, {}, {})
    assert mpstate.completion_functions == functions
    assert (threading.active_count(), descriptors()) == (threads, before)


def test_routes_come_and_go_with_it(make: Any) -> None:
    module = make()
    host = module.host
    assert set(host.extensions) == {"/gradys/status", "/gradys/readings", "/gradys/flush", "/mission/fly-track"}
    module.unload()
    assert host.extensions == {}


def test_setting_takes_effect_at_once(make: Any, main_loop: Any, capsys: Any) -> None:
    module = make(gs="127.0.0.1:9")
    module.command(["set", "gs", "127.0.0.1:8,127.0.0.1:7"])
    main_loop.until(lambda: "telling http://127.0.0.1:8, http://127.0.0.1:7" in capsys.readouterr().out)
    module.command(["status"])
    said = capsys.readouterr().out
    assert "ground station http://127.0.0.1:8" in said and "ground station http://127.0.0.1:7" in said
    assert "127.0.0.1:9" not in said


def test_the_prompt_waits_for_no_goodbye(make: Any, main_loop: Any, capsys: Any, monkeypatch: Any) -> None:
    leaving, left = threading.Event(), threading.Event()

    class Slow:
        async def send(self, batch: Any) -> Any:
            raise NotDelivered("nobody is there")

        async def close(self) -> None:
            leaving.set()
            await asyncio.to_thread(left.wait, 20)

    monkeypatch.setattr("mavproxy_gradys.sender.make_sink", lambda *_: Slow())
    module = make(sink="http://127.0.0.1:9/r", quantities="")
    main_loop.until(lambda: "no ground station" in capsys.readouterr().out)
    module.command(["set", "gs", "127.0.0.1:8"])
    module.command(["stop"])
    module.command(["set", "period", "2"])
    assert leaving.wait(10)
    assert "telling" not in capsys.readouterr().out  # the prompt was free all the time
    left.set()
    main_loop.until(lambda: "stopped" in capsys.readouterr().out)


def test_a_stopped_module_stays_stopped_when_a_setting_changes(make: Any, capsys: Any) -> None:
    module = make(gs="127.0.0.1:9")
    module.command(["stop"])
    module.command(["set", "period", "2"])
    capsys.readouterr()
    module.command(["status"])
    assert capsys.readouterr().out.startswith("gradys: stopped")


@pytest.mark.parametrize("given", [{"gs": "x:y"}, {"nope": 1}, {"config": "/no/such/file"}])
def test_a_bad_setting_is_an_import_error_of_one_line(mpstate: Any, given: dict[str, Any]) -> None:
    with pytest.raises(ImportError) as raised:
        gradys.init(mpstate, **given)
    assert "\n" not in str(raised.value)
    assert mpstate.command_map == {}


def test_settings_outlive_a_reload_and_no_password_is_shown(mpstate: Any, tmp_path: Path, capsys: Any) -> None:
    sink = "mqtt://me:secret@127.0.0.1/fleet"
    module = gradys.init(mpstate, spool=str(tmp_path / "spool.db"), sink=sink, token="hidden")
    module.command(["set", "gs", "127.0.0.1:9"])
    module.unload()
    again = gradys.init(mpstate)
    told = capsys.readouterr().out
    assert "sink=mqtt://me:***@127.0.0.1/fleet, token=(set), gs=127.0.0.1:9" in told
    assert "secret" not in told and "hidden" not in told
    settings = again.gradys_settings.snapshot()
    assert (settings.sink, settings.token, settings.gs[0].url) == ((sink,), "hidden", "http://127.0.0.1:9")
    again.unload()
