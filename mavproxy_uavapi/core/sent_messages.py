"""Which messages were sent for which command, for the audit trail."""

from __future__ import annotations

import contextvars
from collections.abc import Iterator
from contextlib import contextmanager

MANY = 3  # messages of one name in a row are counted
MOST_RUNS = 40  # of one name each, that the trail has of a command


class SentNames:
    """Names of messages, in the order in which they were sent; bounded, however long a command takes.

    Attributes:
        is_audited: whether the trail has them; messages sent later are noted for no command.
    """

    def __init__(self) -> None:
        self._runs: list[tuple[str, int]] = []
        self._more = 0
        self.is_audited = False

    def add(self, name: str) -> None:
        """Note a message that is sent."""
        if self._runs and self._runs[-1][0] == name and not self._more:
            self._runs[-1] = name, self._runs[-1][1] + 1
        elif len(self._runs) < MOST_RUNS:
            self._runs.append((name, 1))
        else:
            self._more += 1

    def summary(self) -> tuple[str, ...]:
        """The names; three or more of one name in a row appear once, with their number: `NAME x240`."""
        self.is_audited = True
        names = [
            text for name, count in self._runs for text in ([name] * count if count < MANY else [f"{name} x{count}"])
        ]
        return (*names, f"and {self._more} more") if self._more else tuple(names)


# Of the present command; its tasks inherit it.
_sent: contextvars.ContextVar[SentNames | None] = contextvars.ContextVar("sent", default=None)


def note_sent(name: str) -> None:
    """Note that a message of that name goes to a vehicle for the present command."""
    sent = _sent.get()
    if sent is not None:
        sent.add(name)


@contextmanager
def noting_sent() -> Iterator[SentNames]:
    """The names of the messages that are sent within the context, and by the tasks that are begun in it."""
    sent = SentNames()
    token = _sent.set(sent)
    try:
        yield sent
    finally:
        _sent.reset(token)


@contextmanager
def noting_sent_unless_noted() -> Iterator[SentNames | None]:
    """As `noting_sent`; None within an HTTP call, which notes them itself."""
    sent = _sent.get()
    if sent is not None and not sent.is_audited:
        yield None
    else:
        with noting_sent() as names:
            yield names
