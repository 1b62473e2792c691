from __future__ import annotations

import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from MAVProxy.modules.lib.mp_settings import MPSetting

from mavproxy_uavapi.core import host as hosts
from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.module import SharedModule, value_of
from mavproxy_uavapi.core.settings import ModuleSettings
from tests.support.mavproxy import MainLoop
from tests.support.messages import message_of


class DemoSettings(ModuleSettings[Any]):
    module = "demo"

    @staticmethod
    def table() -> list[Any]:
        return [MPSetting("rate", int, 4, "", range=(1, 10)), MPSetting("name", str, "")]

    def make(self, values: Any, origins: Any) -> Any:
        return SimpleNamespace(**values)


class OtherSettings(DemoSettings):
    module = "other"


class Demo(SharedModule[Any]):
    def __init__(
        self, mpstate: SimpleNamespace, settings: type[DemoSettings] = DemoSettings, **keywords: Any
    ) -> None:
        self.done: list[Any] = []
        self.refused = ""
        actions = {
            "status": lambda args: self.done.append(("status", args)),
            "go": self.done.append,
        }
        super().__init__(mpstate, keywords, settings, "a demo", actions=actions, completions=["<status|go>"])
        self.finish_loading([SimpleNamespace(path=f"/{self.name}")])

    def begin(self) -> None:
        self.done.append(("begun", self.host.bridge.running))

    async def end(self) -> None:
        self.done.append("ended")

    def check_change(self, name: str) -> None:
        if name == self.refused:
            raise SettingError(f"{name} is not changed now", name)

    def use_settings(self, name: str, before: Any, after: Any) -> None:
        self.done.append((name, before.rate, after.rate))


@pytest.fixture
def demo(mpstate: SimpleNamespace, main_loop: MainLoop) -> Iterator[Demo]:
    demo = Demo(mpstate)
    main_loop.modules.append(demo)
    yield demo
    if demo in demo.host.members:
        demo.unload()


def test_loading_adds_its_command_and_hears_every_vehicle(demo: Demo, mpstate: SimpleNamespace) -> None:
    assert mpstate.command_map["demo"] == (demo.command, "a demo")
    assert mpstate.completions["demo"] == ["<status|go>", "set (DEMOSETTING) (DEMOVALUE)"]
    assert demo.multi_vehicle


def test_begin_comes_once_in_the_first_idle_task_when_the_host_runs(demo: Demo, main_loop: MainLoop) -> None:
    assert demo.done == []
    main_loop.turn()
    main_loop.turn()
    assert demo.done == [("begun", True)]


def test_keyword_that_is_refused_is_an_import_error_and_nothing_is_loaded(mpstate: SimpleNamespace) -> None:
    with pytest.raises(ImportError, match="^demo: rate = 11: it takes a whole number from 1 to 10$"):
        Demo(mpstate, rate=11)
    assert mpstate.command_map == {}
    assert not hasattr(mpstate, hosts.ATTRIBUTE)


def test_text_of_the_state_is_printed_before_and_after_the_first_idle_task(
    demo: Demo, main_loop: MainLoop, capsys: pytest.CaptureFixture[str]
) -> None:
    def text() -> str:
        return "here" if threading.current_thread() is threading.main_thread() else "in the asyncio thread"

    demo._print_text(text)
    main_loop.turn()
    demo._print_text(text)
    assert capsys.readouterr().out == "here\nin the asyncio thread\n"


def test_command_without_a_word_is_status(demo: Demo) -> None:
    demo.command([])
    demo.command(["go", "1", "2"])
    assert demo.done == [("status", []), ["1", "2"]]


def test_command_finds_the_vehicle_that_the_command_before_it_chose(
    demo: Demo, main_loop: MainLoop, mpstate: SimpleNamespace
) -> None:
    main_loop.turn()
    mpstate.settings.target_system = 3
    demo.command(["go"])

    async def current() -> int:
        return demo.host.registry.current

    assert demo.host.bridge.run(current()) == 3


def test_unknown_word_is_answered_with_the_nearest(demo: Demo, capsys: pytest.CaptureFixture[str]) -> None:
    demo.command(["statsu"])
    demo.command(["xyz"])
    assert capsys.readouterr().out == (
        "demo: no command 'statsu'; did you mean status?\ndemo: no command 'xyz'; there are status, go, set, config\n"
    )
    assert demo.done == []


def test_settings_are_completed(demo: Demo, mpstate: SimpleNamespace) -> None:
    assert mpstate.completion_functions["(DEMOSETTING)"]("") == ["rate", "name"]


@pytest.mark.parametrize("words", [["config"], ["set"], ["set", "r"]])
def test_config_and_set_without_a_value_list_the_settings(
    demo: Demo, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    demo.command(words)
    assert capsys.readouterr().out.splitlines()[0].split() == ["rate", "4", "default"]


def test_setting_is_used_once_the_main_loop_runs_and_remembered_at_once(demo: Demo, main_loop: MainLoop) -> None:
    demo.command(["set", "rate", "5"])
    assert demo.done == []
    main_loop.turn()
    demo.command(["set", "rate", '"6"'])
    assert demo.done[1:] == [("rate", 5, 6)]
    assert demo.remembered.changed == {"rate": "6"}


def test_setting_that_stays_as_it_was_is_not_used(demo: Demo, main_loop: MainLoop) -> None:
    main_loop.turn()
    demo.command(["set", "rate", "4"])
    assert demo.done == [("begun", True)]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["rate", "11"], "demo: rate = '11': it takes a whole number from 1 to 10"),
        (["rat", "5"], "demo: no setting 'rat'; did you mean rate?"),
        (["xyz"], "demo: no setting 'xyz'; there are rate, name"),
        (["name", "a"], "demo: name is not changed now"),
    ],
)
def test_change_that_is_refused_changes_nothing(
    demo: Demo, main_loop: MainLoop, capsys: pytest.CaptureFixture[str], words: list[str], line: str
) -> None:
    demo.refused = "name"
    main_loop.turn()
    demo.command(["set", *words])
    assert capsys.readouterr().out == f"{line}\n"
    assert (demo.module_settings.snapshot().rate, demo.remembered.changed) == (4, {})
    assert demo.done == [("begun", True)]


def test_packets_reach_the_fleet(demo: Demo, main_loop: MainLoop) -> None:
    main_loop.turn()
    demo.mavlink_packet(message_of("heartbeat", system=4))
    main_loop.until(lambda: 4 in demo.host.fleet.vehicles)


def test_unload_ends_it_and_gives_all_back(demo: Demo, mpstate: SimpleNamespace, main_loop: MainLoop) -> None:
    main_loop.turn()
    demo.unload()
    assert demo.done[-1] == "ended"
    assert mpstate.command_map == {}
    assert mpstate.completions == {}
    assert list(mpstate.completion_functions) == ["(OTHER)"]
    assert mpstate.select_extra == {}
    assert not hasattr(mpstate, hosts.ATTRIBUTE)


def test_unload_before_the_first_idle_task_ends_nothing_that_never_began(
    demo: Demo, mpstate: SimpleNamespace
) -> None:
    demo.unload()
    assert demo.done == []
    assert not hasattr(mpstate, hosts.ATTRIBUTE)


def test_host_is_given_back_even_when_the_end_fails(
    demo: Demo, mpstate: SimpleNamespace, main_loop: MainLoop
) -> None:
    async def fail() -> None:
        raise RuntimeError("no")

    demo.end = fail  # type: ignore[method-assign]
    main_loop.turn()
    with pytest.raises(RuntimeError, match="no"):
        demo.unload()
    assert not hasattr(mpstate, hosts.ATTRIBUTE)


def test_second_module_goes_on_when_the_first_is_unloaded(
    demo: Demo, mpstate: SimpleNamespace, main_loop: MainLoop
) -> None:
    other = Demo(mpstate, OtherSettings)
    main_loop.modules.append(other)
    main_loop.turn()
    demo.unload()
    main_loop.modules.remove(demo)
    other.mavlink_packet(message_of("heartbeat", system=4))
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


def test_idle_task_never_raises_and_reports_each_failure_once(
    demo: Demo, main_loop: MainLoop, capsys: pytest.CaptureFixture[str]
) -> None:
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


def test_beginning_that_fails_is_reported_and_the_rest_goes_on(
    demo: Demo, main_loop: MainLoop, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> None:
        raise ValueError("no")

    demo.begin = fail  # type: ignore[method-assign]
    main_loop.turn()
    assert "ValueError: no" in capsys.readouterr().out
    demo.mavlink_packet(message_of("heartbeat", system=4))
    main_loop.until(lambda: 4 in demo.host.fleet.vehicles)


def test_loaded_while_the_main_loop_runs_it_begins_at_once(
    demo: Demo, mpstate: SimpleNamespace, main_loop: MainLoop
) -> None:
    assert demo.done == []
    main_loop.turn()
    other = Demo(mpstate, OtherSettings)
    assert other.done == [("begun", True)]
    other.idle_task()
    assert other.done == [("begun", True)]
    assert set(demo.host.extensions) == {"/demo", "/other"}
    other.unload()
    assert set(demo.host.extensions) == {"/demo"}


def test_beginning_that_fails_leaves_a_module_that_can_be_unloaded(
    demo: Demo, mpstate: SimpleNamespace, main_loop: MainLoop, capsys: pytest.CaptureFixture[str]
) -> None:
    class Failing(Demo):
        def begin(self) -> None:
            raise ValueError("no")

    main_loop.turn()
    failing = Failing(mpstate, OtherSettings)
    assert "other: its idle task fails" in capsys.readouterr().out
    failing.unload()
    assert list(mpstate.command_map) == ["demo"]
