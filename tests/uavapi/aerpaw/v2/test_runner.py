"""Runners of v2: what is invalid at once, and their `config`."""

from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.aerpaw.decorators import (
    at_init,
    background,
    entrypoint,
    expose_field_zmq,
    expose_zmq,
    state,
    timed_state,
)
from mavproxy_uavapi.aerpaw.exceptions import MultipleInitialStatesError, NoEntrypointError, RunnerError
from mavproxy_uavapi.aerpaw.v2.runner import (
    BasicRunner,
    BasicRunnerConfig,
    StateMachine,
    StateMachineConfig,
    StateSpec,
    ZmqStateMachine,
    ZmqStateMachineConfig,
)
from tests.support.virtual_time import FastLoop


async def nothing(self: Any) -> None:
    """A method."""


def method() -> Any:
    async def one(self: Any) -> None:
        await nothing(self)

    return one


def test_class_with_two_entrypoints_or_two_first_states_is_refused() -> None:
    with pytest.raises(RunnerError, match="Only one @entrypoint"):
        type("Two", (BasicRunner,), {"a": entrypoint(method()), "b": entrypoint(method())})
    with pytest.raises(MultipleInitialStatesError):
        type("Two", (StateMachine,), {name: state(name, first=True)(method()) for name in "ab"})


def test_exposed_method_must_be_a_state() -> None:
    with pytest.raises(RunnerError, match="only be used on @state"):
        type("Bad", (ZmqStateMachine,), {"a": expose_zmq("a")(method())})


def test_config_tells_what_the_decorators_say() -> None:
    class Base(ZmqStateMachine):
        @at_init
        async def prepare(self) -> None: ...

        @state("start", first=True)
        @expose_zmq("begin")
        async def start_it(self) -> None: ...

        @expose_zmq("hold")
        @timed_state("wait", 5, loop=True)
        async def run(self) -> None: ...

    class Mission(Base):
        @background
        async def log(self) -> None: ...

        @expose_field_zmq("height")
        async def height(self) -> None: ...

    config = Mission.config
    assert isinstance(config, ZmqStateMachineConfig) and config.initial_state == "start"
    assert config.states == [
        StateSpec("start", "start_it", first=True),
        StateSpec("wait", "_script_run", duration=5, loop=True),
    ]
    assert (config.exposed_states, config.exposed_fields) == (
        {"begin": "start", "hold": "wait"},
        {"height": "height"},
    )
    assert config.at_init == ["prepare"] and "log" in config.backgrounds and "log" not in Base.config.backgrounds


def test_config_takes_the_place_of_decorators(loop: FastLoop) -> None:
    class Basic(BasicRunner):
        config = BasicRunnerConfig(entrypoint="run")
        ran = False

        async def run(self) -> None:  # type: ignore[override]
            self.ran = True

    basic = Basic()
    loop.run(basic.run(None))
    assert basic.ran

    class Machine(StateMachine):
        config = StateMachineConfig(
            "one", [StateSpec("one", "first"), StateSpec("two", "second", duration=3.0)], [], ["prepare"]
        )

        def __init__(self) -> None:
            self.log: list[str] = []

        async def prepare(self) -> None:
            self.log.append("prepare")

        async def first(self) -> str:
            self.log.append("one")
            return "two"

        async def second(self) -> None:
            self.log.append("two")

    machine, began = Machine(), loop.time()
    loop.run(machine.run(None))
    assert machine.log == ["prepare", "one", "two"] and loop.time() - began == pytest.approx(3, abs=0.2)


def test_what_prepares_runs_in_order(loop: FastLoop) -> None:
    class Machine(StateMachine):
        log = ""

        @at_init
        async def second_by_name(self) -> None:
            self.log += "1"

        @at_init
        async def first_by_name(self) -> None:
            self.log += "2"

        @state("only", first=True)
        async def only(self) -> None:
            self.log += "3"

    machine = Machine()
    loop.run(machine.run(None))
    assert machine.log == "123"


def test_runner_without_an_entrypoint_is_refused_when_it_runs(loop: FastLoop) -> None:
    with pytest.raises(NoEntrypointError):
        loop.run(type("Without", (BasicRunner,), {})().run(None))
