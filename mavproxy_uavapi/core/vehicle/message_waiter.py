"""Waiting for one vehicle's messages in asyncio: `host.pending` with deadlines and link loss."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from types import TracebackType
from typing import Any, Generic, TypeVar

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import LinkLost, TimedOut
from mavproxy_uavapi.core.mavlink.link import Address
from mavproxy_uavapi.core.mavlink.pending_waits import PendingWaits, Wait
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.core.vehicle.message_exchange import MessageExchange

T = TypeVar("T")
mavlink = mavutil.mavlink


class MessageWaiter:
    """Waits on one vehicle.

    Args:
        state: what is known of it.
        pending: the host's waits.
        clock: monotonic seconds, the clock of arrivals.
    """

    def __init__(self, state: VehicleState, pending: PendingWaits, clock: Callable[[], float]) -> None:
        self.state = state
        self.clock = clock
        self._pending = pending

    async def message(self, names: Collection[str], test: Callable[[Any], T | None], timeout: float, what: str) -> T:
        """Wait until `test` of a message of one of these names is not None.

        Args:
            names: message names; empty means every message of the vehicle.
            test: may raise to end the wait.
            timeout: in s.
            what: ends the sentence "vehicle 1 did not …" of a timeout.

        Raises:
            TimedOut: nothing in time.
            LinkLost: the vehicle's heartbeats stopped.
        """
        with self.expecting(names, test) as expected:
            return await expected.within(timeout, what)

    async def until(self, names: Collection[str], condition: Callable[[], T | None], timeout: float, what: str) -> T:
        """Wait until `condition` of the state, looked at now and after each message of these names, holds.

        Raises:
            TimedOut, LinkLost: as `message`; and whatever `condition` raises.
        """
        value = condition()
        if value is not None:
            return value
        return await self.message(names, lambda _: condition(), timeout, what)

    def expecting(self, names: Collection[str], test: Callable[[Any], T | None]) -> ExpectedMessage[T]:
        """A context that waits from its entering on: enter it, send, then await `within`."""
        return ExpectedMessage(Wait(self.state.system, names, test), self._pending)

    def acks(self, command: int, asker: Address, shown: Callable[[], bool] = lambda: False) -> Acks:
        """A context that catches the acks of `command` to `asker`; enter it before sending.

        A heartbeat after which `shown` holds counts as an ack that accepts; what `shown` raises ends the wait.
        """
        return Acks(command, self.state, asker, self._pending, shown)

    def conversation(self, names: Collection[str], asker: Address) -> MessageExchange:
        """A context that catches messages of these names to `asker`; enter it before sending."""
        return MessageExchange(self.state, asker, self._pending, names)


class ExpectedMessage(Generic[T]):
    """A registered wait, forgotten when its context is left."""

    def __init__(self, wait: Wait[T], pending: PendingWaits) -> None:
        self._wait = wait
        self._pending = pending
        self._done = asyncio.Event()
        wait.on_settled = self._done.set

    def __enter__(self) -> ExpectedMessage[T]:
        self._pending.add(self._wait)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pending.discard(self._wait)

    async def within(self, timeout: float, what: str) -> T:
        """The awaited value.

        Args:
            timeout: in s.
            what: ends the sentence "vehicle 1 did not …".

        Raises:
            TimedOut, LinkLost: as `MessageWaiter.message`; and whatever the test raises.
        """
        try:
            await wait_with_timeout(timeout, self._done.wait())
        except asyncio.TimeoutError:
            sentence = f"vehicle {self._wait.system} did not {what} within {timeout:.1f} s"
            raise TimedOut(sentence) from None
        if self._wait.error is not None:
            raise self._wait.error
        return self._wait.value  # type: ignore[return-value]


class Acks:
    """The acks of one command, caught from entering to leaving the context.

    They are queued: an IN_PROGRESS and the ack that follows it may arrive in one batch.
    """

    def __init__(
        self, command: int, state: VehicleState, asker: Address, pending: PendingWaits, shown: Callable[[], bool]
    ) -> None:
        self._command = command
        self._shown = shown
        self._state = state
        self._asker = asker
        self._pending = pending
        self._results: asyncio.Queue[int | None] = asyncio.Queue()
        self._wait: Wait[int] = Wait(state.system, {"COMMAND_ACK", "HEARTBEAT"}, self._catch)
        self._wait.on_settled = lambda: self._results.put_nowait(None)

    def __enter__(self) -> Acks:
        self._pending.add(self._wait)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pending.discard(self._wait)

    def _catch(self, message: Any) -> None:
        if message.get_type() == "HEARTBEAT":
            if self._shown():
                self._results.put_nowait(mavlink.MAV_RESULT_ACCEPTED)
        elif message.command == self._command and self._is_to_us(message):
            self._results.put_nowait(message.result)

    def _is_to_us(self, message: Any) -> bool:
        return (
            message.get_srcComponent() == self._state.component
            and message.target_system in (0, self._asker.system)
            and message.target_component in (0, self._asker.component)
        )

    async def next(self, timeout: float) -> int | None:
        """MAV_RESULT of the next ack; None when none came for `timeout` s.

        Raises:
            LinkLost: the vehicle's heartbeats stopped.
        """
        try:
            result = await wait_with_timeout(timeout, self._results.get())
        except asyncio.TimeoutError:
            return None
        if result is None:
            raise self._wait.error or LinkLost(f"vehicle {self._state.system} is gone")
        return result
