from __future__ import annotations

import threading
from typing import Any

import pytest

import gradys
from mavproxy_gradys.module import HELP


@pytest.fixture
def module(mpstate: Any) -> Any:
    module = gradys.init(mpstate)
    yield module
    if module in module.host.members:
        module.unload()


def test_module_is_what_mavproxy_looks_for(module: Any, mpstate: Any) -> None:
    assert module.name == "gradys"
    assert list(mpstate.command_map) == ["gradys"]


def test_status_says_what_it_is_and_help_what_it_can(module: Any, capsys: Any) -> None:
    module.command([])
    assert capsys.readouterr().out.startswith("gradys: ")
    module.command(["help"])
    assert capsys.readouterr().out == HELP + "\n"


def test_loading_and_unloading_leaves_nothing_behind(mpstate: Any, descriptors: Any) -> None:
    threads, before = threading.active_count(), descriptors()
    for _ in range(20):
        module = gradys.init(mpstate)
        module.idle_task()
        module.unload()
    assert (mpstate.command_map, mpstate.completions, mpstate.select_extra) == ({}, {}, {})
    assert (threading.active_count(), descriptors()) == (threads, before)


def test_status_tells_the_ground_station(mpstate: Any, capsys: Any) -> None:
    module = gradys.init(mpstate, gs="10.0.0.5:8000")
    module.idle_task()
    module.command(["status"])
    assert "ground station http://10.0.0.5:8000" in capsys.readouterr().out
    module.unload()
