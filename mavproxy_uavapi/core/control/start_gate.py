"""Several verbs that begin together or not at all: each waits before its first message until all can send.

Each has then passed its own checks, and they still hold when the last one comes. A verb finds its place at a gate in
the context of its task.
"""

from __future__ import annotations

import asyncio
import contextvars
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from mavproxy_uavapi.core.errors import Aborted, UavApiError
from mavproxy_uavapi.core.mainloop.permit import no_check


class StartGate:
    """Opens when every verb has arrived; stays closed if one has failed.

    Args:
        count: how many verbs there are.
    """

    def __init__(self, count: int) -> None:
        self._missing = count
        self._decided = asyncio.Event()
        self._failure: str | None = None
        self._checks: dict[str, Callable[[], None]] = {}  # by the verb's name

    @contextmanager
    def place(self, name: str) -> Iterator[None]:
        """A verb's place: code in this context, and tasks that begin in it, wait at the gate.

        Args:
            name: the verb's vehicle, for the error of the others.
        """
        place = _Place(self, name)
        token = _place.set(place)
        try:
            yield
        except UavApiError as error:
            place.come(f"{name}: {error}")
            raise
        finally:
            place.come()  # done without a message, or its client hung up
            _place.reset(token)

    def came(self, name: str, check: Callable[[], None], failure: str | None) -> None:
        """One verb has arrived, with a check that must still hold when the last one does, or has failed before."""
        if self._decided.is_set():
            return
        self._missing -= 1
        self._failure, self._checks[name] = failure, check
        if failure is None and not self._missing:
            self._failure = self._first_failure()
        if failure is not None or not self._missing:
            self._decided.set()

    def _first_failure(self) -> str | None:
        for name, check in self._checks.items():
            try:
                check()
            except UavApiError as error:
                return f"{name}: {error}"
        return None

    async def passed(self) -> None:
        """Wait for the decision.

        Raises:
            Aborted: one verb has failed.
        """
        await self._decided.wait()
        if self._failure is not None:
            raise Aborted(f"nothing was sent: {self._failure}")


class _Place:
    def __init__(self, gate: StartGate, name: str) -> None:
        self._gate, self._name = gate, name
        self._has_come = False

    def come(self, failure: str | None = None, check: Callable[[], None] = no_check) -> None:
        if not self._has_come:
            self._has_come = True
            self._gate.came(self._name, check, failure)

    async def passed(self, check: Callable[[], None]) -> None:
        self.come(check=check)
        try:
            await self._gate.passed()
        except Aborted:
            check()  # whose own error it is gets that
            raise


_place: contextvars.ContextVar[_Place | None] = contextvars.ContextVar("place", default=None)


def begun_before() -> None:
    """The present verb joins a job, which has its vehicle already: nobody waits at the gate for its end."""
    place = _place.get()
    if place is not None:
        place.come()


async def pass_gate(check: Callable[[], None] = no_check) -> bool:
    """Wait for the other verbs, if the present verb has a place at a gate; called before the checks for a message.

    Args:
        check: raises if the verb cannot begin; called again when the last one arrives.

    Returns:
        Whether it has one, so that time may have passed.

    Raises:
        Aborted: another verb of the gate has failed.
    """
    place = _place.get()
    if place is None:
        return False
    await place.passed(check)
    return True
