"""`aerpawlib.v1.runner` without ZMQ: the base classes of scripts' experiments, and helpers."""

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
RETRY_AFTER = 0.5  # s from a background method's failure to its next call
CALL_PAUSE = 0.001  # s between two of its calls
MOVED_RUN = "_script_run"  # new name of a script's own method `run`, because the runner has a method `run`


def in_background(work: Awaitable[Any]) -> asyncio.Future[Any]:
    """Start it, and do not wait for it."""
    return asyncio.ensure_future(work)


async def sleep(seconds: float) -> None:
    """Wait."""
    await asyncio.sleep(seconds)


async def call(method: Method, vehicle: Any) -> Any:
    """Call a script's method; the vehicle is passed if the method has a parameter."""
    return await (method(vehicle) if inspect.signature(method).parameters else method())


class Runner:
    """Base of all runners."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = cls.__dict__.get("run")
        if any(hasattr(own, mark) for mark in MARKS):
            setattr(cls, MOVED_RUN, own)
            del cls.run

    @classmethod
    def _marked_names(cls, mark: str) -> list[str]:
        """The names of the methods with that mark, those of base classes first, in the order of their definitions."""
        names = dict.fromkeys(name for kind in reversed(cls.__mro__) for name in vars(kind))
        return [name for name in names if not name.startswith("__") and hasattr(getattr(cls, name, None), mark)]

    def marked(self, mark: str) -> list[tuple[Any, Method]]:
        """The mark's value and the method, for each of `_marked_names`."""
        return [(getattr(getattr(self, name), mark), getattr(self, name)) for name in self._marked_names(mark)]

    def set_event_log(self, event_log: object) -> None:
        """Receive the log of `--structured-log`."""
        self._event_log = event_log

    def initialize_args(self, extra_args: Sequence[str]) -> None:
        """Receive the script's own arguments; called first."""

    def cleanup(self) -> None:
        """Release resources; called at the end, after a failure, too."""

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
            raise StateMachineError("Multiple @entrypoint decorators found. Only one @entrypoint is allowed")
        try:
            await call(methods[0][1], vehicle)
        finally:
            self.cleanup()


class StateMachine(Runner):
    """Runs states; each returns the name of the next one, or None at the end."""

    _running = False

    def _build(self) -> None:
        """Collect its states.

        Raises:
            NoInitialStateError, MultipleInitialStatesError, StateMachineError: the states are inconsistent.
        """
        self._states: dict[str, tuple[StateMark, Method]] = {}
        self._overrides: deque[str] = deque()  # states that others requested; they override a state's return value
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
            InvalidStateError: a state returned the name of no state.
            StateMachineError: see `_build`.
        """
        self._build()
        self._running = True
        background: list[asyncio.Task[None]] = []
        try:
            await self._prepare([method for _, method in self.marked(AT_INIT)], vehicle)
            methods = [method for _, method in self.marked(BACKGROUND)]
            background = [asyncio.create_task(self._call_repeatedly(method, vehicle)) for method in methods]
            await self._run_states(vehicle)
        finally:
            self._running = False
            for task in background:
                task.cancel()
            await asyncio.gather(*background, return_exceptions=True)
            self.cleanup()

    async def _prepare(self, methods: Sequence[Method], vehicle: Any) -> None:
        """Call the methods that run before the states, all at once."""
        await asyncio.gather(*(call(method, vehicle) for method in methods))

    async def _run_states(self, vehicle: Any) -> None:
        current: str | None = self._entrypoint
        while self._running and current is not None:
            if current not in self._states:
                raise InvalidStateError(current, self._states)
            log.debug("state %s", current)
            following = await self._run_state(*self._states[current], vehicle)
            await asyncio.sleep(STATE_MACHINE_DELAY_S)
            current = self._overrides.popleft() if self._overrides else following

    async def _run_state(self, mark: StateMark, method: Method, vehicle: Any) -> str | None:
        """Run a state to its end; returns the name of the next one."""
        if mark.duration is None:
            return _name(await call(method, vehicle))
        loop = asyncio.get_running_loop()
        ends_at = loop.time() + mark.duration
        following = _name(await call(method, vehicle))
        while mark.loop and loop.time() < ends_at:
            await asyncio.sleep(STATE_MACHINE_DELAY_S)
            following = _name(await call(method, vehicle))
        await asyncio.sleep(max(ends_at - loop.time(), 0))
        return following

    async def _call_repeatedly(self, method: Method, vehicle: Any) -> None:
        """Call a background method repeatedly; a failure of it does not end the flight."""
        while self._running:
            try:
                await call(method, vehicle)
            except Exception:
                log.exception("%s failed; it is called again", getattr(method, "__name__", method))
                await asyncio.sleep(RETRY_AFTER)
            await asyncio.sleep(CALL_PAUSE)  # the method itself may never wait

    def stop(self) -> None:
        """End after the present state."""
        self._running = False


def _name(returned: Any) -> str | None:
    if returned is None or isinstance(returned, str):
        return returned
    raise StateMachineError(f"A state returned {returned!r}, which is not the name of a state")
