"""The decorators for the methods of a script's runner. A mark is an attribute of the function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from mavproxy_uavapi.aerpaw.exceptions import InvalidStateNameError, StateMachineError

F = TypeVar("F", bound=Callable[..., Any])

ENTRYPOINT, BACKGROUND, AT_INIT = "_entrypoint", "_is_background", "_run_at_init"
STATE, EXPOSED_STATE, EXPOSED_FIELD = "_aerpaw_state", "_zmq_state_name", "_zmq_field_name"
MARKS = (ENTRYPOINT, BACKGROUND, AT_INIT, STATE, EXPOSED_STATE, EXPOSED_FIELD)


@dataclass(frozen=True)
class StateMark:
    """One state of a StateMachine.

    Attributes:
        name: its name; other states return it to make it the next state.
        first: whether the machine begins with it.
        duration: the least time (s) that it lasts; None for no least time.
        loop: whether its method is called repeatedly during that time.
    """

    name: str
    first: bool
    duration: float | None = None
    loop: bool = False


def _marked(func: F, mark: str, value: object = True) -> F:
    setattr(func, mark, value)
    return func


def entrypoint(func: F) -> F:
    """The one method that a BasicRunner runs."""
    return _marked(func, ENTRYPOINT)


def background(func: F) -> F:
    """A method that is called repeatedly while the states run."""
    return _marked(func, BACKGROUND)


def at_init(func: F) -> F:
    """A method that runs once, before the vehicle is armed."""
    return _marked(func, AT_INIT)


def state(name: str, first: bool = False) -> Callable[[F], F]:
    """A state; its method returns the name of the next one, or None at the end."""
    return _state(StateMark(name, first))


def timed_state(name: str, duration: float, loop: bool = False, first: bool = False) -> Callable[[F], F]:
    """A state that lasts at least `duration` s; with `loop` its method is called repeatedly during that time."""
    return _state(StateMark(name, first, duration, loop))


def _state(mark: StateMark) -> Callable[[F], F]:
    if not mark.name:
        raise InvalidStateNameError

    def decorate(func: F) -> F:
        if hasattr(func, STATE):
            raise StateMachineError("A method cannot be decorated with more than one of @state/@timed_state")
        return _marked(func, STATE, mark)

    return decorate


def expose_zmq(name: str) -> Callable[[F], F]:
    """A state that other runners may request by that name."""
    return _exposed(EXPOSED_STATE, name)


def expose_field_zmq(name: str) -> Callable[[F], F]:
    """A method whose result other runners may query by that name."""
    return _exposed(EXPOSED_FIELD, name)


def _exposed(mark: str, name: str) -> Callable[[F], F]:
    if not name:
        raise InvalidStateNameError
    return lambda func: _marked(func, mark, name)
