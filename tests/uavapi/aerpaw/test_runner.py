"""Runners: what calls what, and when."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mavproxy_uavapi.aerpaw.decorators import at_init, background, entrypoint, state, timed_state
from mavproxy_uavapi.aerpaw.exceptions import (
    InvalidStateError,
    InvalidStateNameError,
    MultipleInitialStatesError,
    NoEntrypointError,
    NoInitialStateError,
    StateMachineError,
)
from mavproxy_uavapi.aerpaw.runner import BasicRunner, StateMachine, in_background, sleep
from tests.support.virtual_time import FastLoop


class Logging:
    """What was called, in its order."""

    def __init__(self) -> None:
        self.log: list[str] = []

    def cleanup(self) -> None:
        self.log.append("cleanup")


@pytest.mark.parametrize("name", ["run", "fly"])
def test_entrypoint_gets_the_vehicle_whatever_its_name(name: str) -> None:
    async def experiment(self: Any, vehicle: str) -> None:
        self.log.append(vehicle)

    kind = type("Experiment", (Logging, BasicRunner), {name: entrypoint(experiment)})
    runner = kind()
    asyncio.run(runner.run("the vehicle"))
    assert runner.log == ["the vehicle", "cleanup"]


def test_entrypoint_may_want_no_vehicle_and_cleanup_follows_a_failure() -> None:
    class Experiment(Logging, BasicRunner):
        @entrypoint
        async def fly(self) -> None:
            raise RuntimeError("no")

    runner = Experiment()
    with pytest.raises(RuntimeError):
        asyncio.run(runner.run("the vehicle"))
    assert runner.log == ["cleanup"]


def test_experiment_has_one_entrypoint() -> None:
    async def experiment(self: Any) -> None: ...

    with pytest.raises(NoEntrypointError):
        asyncio.run(type("None_", (BasicRunner,), {})().run(None))
    two = {"a": entrypoint(experiment), "b": entrypoint(experiment)}
    with pytest.raises(StateMachineError, match="Multiple"):
        asyncio.run(type("Two", (BasicRunner,), two)().run(None))


class Machine(Logging, StateMachine):
    @at_init
    async def prepare(self, vehicle: str) -> None:
        self.log.append(f"init {vehicle}")

    @state(name="start", first=True)
    async def begin(self, vehicle: str) -> str:
        self.log.append("start")
        return "hold"

    @timed_state(name="hold", duration=1.0, loop=True)
    async def hold(self, _: str) -> str:
        self.log.append("hold")
        await sleep(0.3)
        return "end"

    @state("end")
    async def finish(self) -> None:
        self.log.append("end")


def test_states_follow_each_other(loop: FastLoop) -> None:
    machine = Machine()
    loop.run(machine.run("v"))
    assert machine.log == ["init v", "start", "hold", "hold", "hold", "hold", "end", "cleanup"]


def test_timed_state_lasts_its_time(loop: FastLoop) -> None:
    class Waiting(StateMachine):
        @timed_state("wait", duration=5, first=True)
        async def wait(self, _: Any) -> None:
            return None

    began = loop.time()
    loop.run(Waiting().run(None))
    assert loop.time() - began == pytest.approx(5, abs=0.1)


def test_background_goes_on_beside_the_states_though_it_fails(
    loop: FastLoop, caplog: pytest.LogCaptureFixture
) -> None:
    class Beside(Logging, StateMachine):
        @background
        async def dump(self, _: Any) -> None:
            await sleep(0.2)
            self.log.append("dump")
            if len(self.log) == 2:
                raise RuntimeError("disk full")

        @state("only", first=True)
        async def only(self, _: Any) -> None:
            await sleep(2.0)

    machine = Beside()
    loop.run(machine.run(None))
    assert 6 <= machine.log.count("dump") <= 9 and machine.log[-1] == "cleanup"
    assert "disk full" in caplog.text


def test_background_that_never_waits_holds_nothing_up(loop: FastLoop) -> None:
    class Busy(Logging, StateMachine):
        @background
        async def spin(self) -> None:
            self.log.append("spin")

        @state("only", first=True)
        async def only(self) -> None:
            await sleep(0)

    machine = Busy()
    loop.run(machine.run(None))
    assert machine.log[-1] == "cleanup"


def test_failure_of_a_state_ends_it_all_and_cleans_up(loop: FastLoop) -> None:
    class Failing(Logging, StateMachine):
        @state("only", first=True)
        async def only(self, _: Any) -> None:
            raise RuntimeError("lost")

    machine = Failing()
    with pytest.raises(RuntimeError, match="lost"):
        loop.run(machine.run(None))
    assert machine.log == ["cleanup"]


def test_state_that_there_is_not_is_named(loop: FastLoop) -> None:
    class Lost(StateMachine):
        @state("only", first=True)
        async def only(self, _: Any) -> str:
            return "nowhere"

    with pytest.raises(InvalidStateError, match="nowhere"):
        loop.run(Lost().run(None))


def test_machine_can_be_stopped_by_itself(loop: FastLoop) -> None:
    class Endless(StateMachine):
        count = 0

        @state("again", first=True)
        async def again(self, _: Any) -> str:
            self.count += 1
            if self.count == 3:
                self.stop()
            return "again"

    machine = Endless()
    loop.run(machine.run(None))
    assert machine.count == 3


@pytest.mark.parametrize(("firsts", "error"), [(0, NoInitialStateError), (2, MultipleInitialStatesError)])
def test_machine_has_one_first_state(loop: FastLoop, firsts: int, error: type[Exception]) -> None:
    async def nothing(self: Any, _: Any) -> None: ...

    def named(name: str, first: bool) -> Any:
        async def one(self: Any, _: Any) -> None: ...

        return state(name, first=first)(one)

    kind = type("Kind", (StateMachine,), {"a": named("a", firsts > 0), "b": named("b", firsts > 1)})
    with pytest.raises(error):
        loop.run(kind().run(None))


def test_marks_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InvalidStateNameError):
        state("")
    with pytest.raises(StateMachineError, match="more than one"):

        @state("a")
        @timed_state("b", 1)
        async def both(self: Any) -> None: ...


def test_in_background_is_a_task(loop: FastLoop) -> None:
    async def flight() -> int:
        async def number() -> int:
            return 3

        return await in_background(number())

    assert loop.run(flight()) == 3
