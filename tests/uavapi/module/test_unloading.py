"""`module unload uavapi`: what it ends, answers and gives back: a part of `module.py`."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from mavproxy_uavapi.module import UavApiModule
from tests.support.mavproxy import MainLoop
from tests.support.messages import message_of
from tests.support.module_loader import Loader, ask, listens


def test_unload_leaves_nothing_behind_twenty_times(
    loader: Loader,
    main_loop: MainLoop,
    mpstate: SimpleNamespace,
    port: int,
    descriptors: Callable[[], int],
    threads: Callable[[], list[str]],
) -> None:
    names, before = threads(), descriptors()
    for number in range(20):
        module = loader.load(port=port)
        if number % 5:  # and sometimes it is unloaded before it began
            main_loop.until(lambda module=module: module.api.listening)
            module.mavlink_packet(message_of("heartbeat"))
            main_loop.until(lambda module=module: module.host.fleet.vehicles)
            assert ask(port, "/telemetry/status")[0] == 200
        loader.unload(module)
        assert (mpstate.command_map, mpstate.completions, mpstate.select_extra) == ({}, {}, {})
        assert list(mpstate.completion_functions) == ["(OTHER)"]
        assert not hasattr(mpstate, "uavapi_host")
    assert not listens(port)
    assert threads() == names
    assert descriptors() == before


def test_unload_ends_a_call_in_flight_and_answers_it(
    loader: Loader, module: UavApiModule, arming: Callable[[], Any]
) -> None:
    loader.unload(module)
    status, body = arming()
    assert (status, body["code"]) == (409, "aborted")


def test_unload_takes_its_descriptors_back_from_a_host_that_goes_on(
    loader: Loader, main_loop: MainLoop, mpstate: SimpleNamespace, port: int
) -> None:
    import vision

    other = vision.init(mpstate)
    main_loop.modules.append(other)
    before = len(other.host.bridge._open_sockets)
    for _ in range(3):
        module = loader.load(port=port)
        main_loop.until(lambda: listens(port))
        loader.unload(module)
        assert not listens(port)
    assert len(other.host.bridge._open_sockets) == before
    assert other.host.bridge.running
