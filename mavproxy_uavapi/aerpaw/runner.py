"""`aerpawlib.v1.runner` but for ZMQ: what scripts derive their experiments from."""

from __future__ import annotations

import asyncio
import inspect
import logging
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from mavproxy_uavapi.aerpaw.constants import STATE_MACHINE_DELAY_S
from mavproxy_uavapi.aerpaw.decorators import AT_INIT, BACKGROUND, ENTRYPOINT, MARKS, STATE, StateMark
from mavproxy_uavapi.aerpaw.exceptions import (
    InvalidStateError,
    MultipleInitialStatesError,
    NoEntrypointError,
    NoInitialStateError,
    StateMachineError,
)

log = logging.getLogger("aerpawlib.v1.runner")

Method = Callable[..., Awaitable[Any]]
AGAIN_AFTER = 0.5  # s from a background method's failure to its next call
BREATH = 0.001  # s between two of its calls
ASIDE = "_script_s_run"  # where a script's own method `run` goes: the runner has one


async def call(method: Method, vehicle: Any) -> Any:
    """Call a script's method with the vehicle, or without, as it wants."""
    return await (method(vehicle) if inspect.signature(method).parameters else method())


class Runner:
    """Base of all runners."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = cls.__dict__.get("run")
        if any(hasattr(own, mark) for mark in MARKS):
            setattr(cls, ASIDE, own)
            del cls.run

    def marked(self, mark: str) -> list[tuple[Any, Method]]:
        """The methods with that mark, and its values, in the order of their names."""
        methods = [(name, getattr(type(self), name)) for name in dir(type(self)) if not name.startswith("__")]
        return [(getattr(func, mark), getattr(self, name)) for name, func in methods if hasattr(func, mark)]

    def initialize_args(self, extra_args: Sequence[str]) -> None:
        """Take the script's own arguments; before anything else."""

    def cleanup(self) -> None:
        """Close what is open; at the end, however that comes."""

    async def run(self, vehicle: Any) -> None:
        """Run the experiment."""


class BasicRunner(Runner):
    """Runs one method, the `@entrypoint`."""

    async def run(self, vehicle: Any) -> None:
        """Run it.

        Raises:
            NoEntrypointError, StateMachineError: there is none, or more than one.
        """
        methods = self.marked(ENTRYPOINT)
        if not methods:
            raise NoEntrypointError
        if len(methods) > 1:
            raise StateMachineError("Multiple @entrypoint decorators found; a BasicRunner has one")
        try:
            await call(methods[0][1], vehicle)
        finally:
            self.cleanup()


class StateMachine(Runner):
    """Goes from state to state; each returns the name of the next one, or None at the end."""

    _running = False

    def _build(self) -> None:
        """Find its states.

        Raises:
            NoInitialStateError, MultipleInitialStatesError, StateMachineError: it makes no sense.
        """
        self._states: dict[str, tuple[StateMark, Method]] = {}
        self._overrides: deque[str] = deque()  # states that came from elsewhere, and go before what a state returns
        for mark, method in self.marked(STATE):
            if mark.name in self._states:
                raise StateMachineError(f"There are two states '{mark.name}'")
            self._states[mark.name] = mark, method
        first = [mark.name for mark, _ in self._states.values() if mark.first]
        if not first:
            raise NoInitialStateError
        if len(first) > 1:
            raise MultipleInitialStatesError
        self._entrypoint = first[0]

    async def run(self, vehicle: Any) -> None:
        """Run from the first state to the last.

        Raises:
            InvalidStateError: a state returned what is none.
            StateMachineError: see `_build`.
        """
        self._build()
        self._running = True
        beside: list[asyncio.Task[None]] = []
        try:
            await asyncio.gather(*(call(method, vehicle) for _, method in self.marked(AT_INIT)))
            beside = [asyncio.create_task(self._beside(method, vehicle)) for _, method in self.marked(BACKGROUND)]
            await self._go(vehicle)
        finally:
            self._running = False
            for task in beside:
                task.cancel()
            await asyncio.gather(*beside, return_exceptions=True)
            self.cleanup()

    async def _go(self, vehicle: Any) -> None:
        current: str | None = self._entrypoint
        while self._running and current is not None:
            if current not in self._states:
                raise InvalidStateError(current, self._states)
            log.debug("state %s", current)
            following = await self._last(*self._states[current], vehicle)
            await asyncio.sleep(STATE_MACHINE_DELAY_S)
            current = self._overrides.popleft() if self._overrides else following

    async def _last(self, mark: StateMark, method: Method, vehicle: Any) -> str | None:
        """Be in a state until it is over; the name of the next one."""
        if mark.duration is None:
            return _name(await call(method, vehicle))
        loop = asyncio.get_running_loop()
        over = loop.time() + mark.duration
        following = _name(await call(method, vehicle))
        while mark.loop and loop.time() < over:
            await asyncio.sleep(STATE_MACHINE_DELAY_S)
            following = _name(await call(method, vehicle))
        await asyncio.sleep(max(over - loop.time(), 0))
        return following

    async def _beside(self, method: Method, vehicle: Any) -> None:
        """Call a background method over and over; one that fails does not end the flight."""
        while self._running:
            try:
                await call(method, vehicle)
            except Exception:
                log.exception("%s failed, and is called again", getattr(method, "__name__", method))
                await asyncio.sleep(AGAIN_AFTER)
            await asyncio.sleep(BREATH)  # it may never wait itself

    def stop(self) -> None:
        """End after the state that it is in."""
        self._running = False


def _name(returned: Any) -> str | None:
    if returned is None or isinstance(returned, str):
        return returned
    raise StateMachineError(f"A state returned {returned!r}, which is no name of a state")
