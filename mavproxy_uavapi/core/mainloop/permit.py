"""What must hold for a message when MAVProxy's main loop writes it, not only when it was queued.

A permit travels in the context of the task that sends, as a `StartGate`'s place does. So whatever link lies between,
`Bridge.on_main` finds it: a message without one has the default's age limit.
"""

from __future__ import annotations

import contextlib
import contextvars
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

SETPOINT_LASTS = 0.5  # s; the next one is on its way
CLOCK_LASTS = 0.2  # s; the time that a question for the vehicle's clock waits counts as its way
ORDER_LASTS = 2.0  # s; who asked has gone on by then
QUESTION_LASTS = 5.0  # s; it changes nothing
STOP_LASTS = 10.0  # s; it is looked at again all the same, and a late stop is better than none
WORK_LASTS = 60.0  # s; what sends nothing


def no_check() -> None:
    """No check besides the age."""


def no_basis() -> object:
    """Nothing that may change besides the vehicle's heartbeats."""
    return None


class Written:
    """Whether a message, or one of its repetitions, has been written.

    Attributes:
        value: False while it waits for MAVProxy's main loop, and if it never was; None where nobody knows. The main
            loop sets it.
    """

    value: bool | None = None


@dataclass(frozen=True)
class Permit:
    """What a message needs.

    Attributes:
        lasts: s from the request to send until it is too old.
        check: raises if the message may not be sent (any more). The asyncio thread only.
        again: what is checked besides, if it is checked again where it is written.
        system: the vehicle whose heartbeats may change the outcome of `check`; 0 for none.
        basis: what else may change it: compared by `==` with its value at the check. Any thread; cheap.
        stops: whether the message stops the vehicle, so that it is written before others that wait.
        written: becomes true when it is written.
    """

    lasts: float = QUESTION_LASTS
    check: Callable[[], None] = no_check
    again: Callable[[], None] = no_check
    system: int = 0
    basis: Callable[[], object] = no_basis
    stops: bool = False
    written: Written = field(default_factory=Written)


DEFAULT = Permit(WORK_LASTS)
_permit: contextvars.ContextVar[Permit] = contextvars.ContextVar("permit", default=DEFAULT)


def present_permit() -> Permit:
    """The permit of the message that this task sends now."""
    return _permit.get()


@contextlib.contextmanager
def permitted(permit: Permit) -> Iterator[None]:
    """Messages that are sent in this context need `permit`."""
    token = _permit.set(permit)
    try:
        yield
    finally:
        _permit.reset(token)
