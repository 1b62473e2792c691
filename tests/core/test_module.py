from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from mavproxy_uavapi.core import host as hosts
from mavproxy_uavapi.core.module import SharedModule, value_of


class Demo(SharedModule):
    def __init__(self, mpstate: Any, name: str = "demo") -> None:
        self.done: list[Any] = []
        actions = {
            "status": lambda args: self.done.append(("status", args)),
            "go": self.done.append,
        }
        super().__init__(mpstate, name, "a demo", actions, ["<status|go>"])

    def begin(self) -> None:
        self.done.append(("begun", self.host.bridge.running))

    async def end(self) -> None:
        self.done.append("ended")


@pytest.fixture
def demo(mpstate: Any, main_loop: Any) -> Iterator[Demo]:
    demo = Demo(mpstate)
    main_loop.modules.append(demo)
    yield demo
    if demo in demo.host.members:
        demo.unload()


def test_loading_adds_its_command_and_hears_every_vehicle(demo: Demo, mpstate: Any) -> None:
    assert mpstate.command_map["demo"] == (demo.command, "a demo")
    assert mpstate.completions["demo"] == ["<status|go>"]
    assert demo.multi_vehicle


def test_begin_comes_once_in_the_first_idle_task_when_the_host_runs(demo: Demo, main_loop: Any) -> None:
    assert demo.done == []
    main_loop.turn()
    main_loop.turn()
    assert demo.done == [("begun", True)]


def test_command_without_a_word_is_status(demo: Demo) -> None:
    demo.command([])
    demo.command(["go", "1", "2"])
    assert demo.done == [("status", []), ["1", "2"]]


def test_unknown_word_is_answered_with_the_nearest(demo: Demo, capsys: Any) -> None:
    demo.command(["statsu"])
    demo.command(["xyz"])
    assert capsys.readouterr().out == (
        "demo: no command 'statsu'; did you mean status?\ndemo: no command 'xyz'; there are status, go\n"
    )
    assert demo.done == []


def test_packets_reach_the_fleet(demo: Demo, main_loop: Any, msg: Any) -> None:
    main_loop.turn()
    demo.mavlink_packet(msg("heartbeat", system=4))
    main_loop.until(lambda: 4 in demo.host.fleet.vehicles)


def test_unload_ends_it_and_gives_all_back(demo: Demo, mpstate: Any, main_loop: Any) -> None:
    main_loop.turn()
    demo.unload()
    assert demo.done[-1] == "ended"
    assert mpstate.command_map == {}
    assert mpstate.completions == {}
    assert mpstate.select_extra == {}
    assert not hasattr(mpstate, hosts.ATTRIBUTE)


def test_unload_before_the_first_idle_task_ends_nothing_that_never_began(demo: Demo, mpstate: Any) -> None:
    demo.unload()
    assert demo.done == []
    assert not hasattr(mpstate, hosts.ATTRIBUTE)


def test_host_is_given_back_even_when_the_end_fails(demo: Demo, mpstate: Any, main_loop: Any) -> None:
    async def fail() -> None:
        raise RuntimeError("no")

    demo.end = fail  # type: ignore[method-assign]
    main_loop.turn()
    with pytest.raises(RuntimeError, match="no"):
        demo.unload()
    assert not hasattr(mpstate, hosts.ATTRIBUTE)


def test_second_module_goes_on_when_the_first_is_unloaded(demo: Demo, mpstate: Any, main_loop: Any, msg: Any) -> None:
    other = Demo(mpstate, "other")
    main_loop.modules.append(other)
    main_loop.turn()
    demo.unload()
    main_loop.modules.remove(demo)
    other.mavlink_packet(msg("heartbeat", system=4))
    main_loop.until(lambda: 4 in other.host.fleet.vehicles)
    other.unload()
    assert not hasattr(mpstate, hosts.ATTRIBUTE)


@pytest.mark.parametrize(
    ("words", "value"),
    [
        ([], ""),
        (['""'], ""),
        (["''"], ""),
        (["a"], "a"),
        (['"'], '"'),
        (["0:0.3", "1:0.1"], "0:0.3 1:0.1"),
        (['"my camera.json"'], "my camera.json"),
        (["v4l2src", 'device="/dev/video0"'], 'v4l2src device="/dev/video0"'),
    ],
)
def test_value_is_what_was_typed_without_the_quotation_marks_around_it(words: list[str], value: str) -> None:
    assert value_of(words) == value


def test_idle_task_never_raises_and_tells_of_each_failure_once(demo: Demo, main_loop: Any, capsys: Any) -> None:
    def fail() -> None:
        raise OSError("no more threads")

    start, demo.host.bridge.start = demo.host.bridge.start, fail  # type: ignore[method-assign]
    for _ in range(3):
        main_loop.turn()
    assert capsys.readouterr().out == (
        "demo: its idle task fails, `module reload demo` may help: OSError: no more threads\n"
    )
    assert demo.done == []
    demo.host.bridge.start = start  # type: ignore[method-assign]
    main_loop.turn()
    assert demo.done == [("begun", True)]


def test_beginning_that_fails_is_told_and_the_rest_goes_on(demo: Demo, main_loop: Any, capsys: Any, msg: Any) -> None:
    def fail() -> None:
        raise ValueError("no")

    demo.begin = fail  # type: ignore[method-assign]
    main_loop.turn()
    assert "ValueError: no" in capsys.readouterr().out
    demo.mavlink_packet(msg("heartbeat", system=4))
    main_loop.until(lambda: 4 in demo.host.fleet.vehicles)
