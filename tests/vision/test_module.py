from __future__ import annotations

import threading
from typing import Any

import pytest

import vision
from mavproxy_vision.module import HELP


@pytest.fixture
def module(mpstate: Any) -> Any:
    module = vision.init(mpstate)
    yield module
    if module in module.host.members:
        module.unload()


def test_module_is_what_mavproxy_looks_for(module: Any, mpstate: Any) -> None:
    assert module.name == "vision"
    assert list(mpstate.command_map) == ["vision"]


def test_status_says_what_it_is_and_help_what_it_can(module: Any, capsys: Any) -> None:
    module.command([])
    assert capsys.readouterr().out.startswith("vision: ")
    module.command(["help"])
    assert capsys.readouterr().out == HELP + "\n"


def test_loading_and_unloading_leaves_nothing_behind(mpstate: Any, descriptors: Any) -> None:
    threads, before = threading.active_count(), descriptors()
    for _ in range(20):
        module = vision.init(mpstate)
        module.idle_task()
        module.unload()
    assert (mpstate.command_map, mpstate.completions, mpstate.select_extra) == ({}, {}, {})
    assert (threading.active_count(), descriptors()) == (threads, before)
