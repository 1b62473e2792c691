"""Waiting for one vehicle's messages in asyncio: for one of them, or for a series, such as the acks of a command."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Collection, Iterator
from typing import Any, Generic, TypeVar

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import LinkLost, TimedOut
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.mainloop.listening import Listening
from mavproxy_uavapi.core.telemetry.pending_waits import PendingWaits, Wait
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

HEARD_WITHIN = 5.0  # s until a heartbeat must come, or show what an order has done
T = TypeVar("T")
mavlink = mavutil.mavlink


class MessageWaiter:
    """Waits on one vehicle.

    Attributes:
        listening: when MAVProxy's main loop reads; a clock that stands while it does.

    Args:
        state: its state.
        pending: the host's waits.
        clock: monotonic seconds, the clock of arrivals.
    """

    def __init__(self, state: VehicleState, pending: PendingWaits, clock: Callable[[], float]) -> None:
        self.state = state
        self.clock = clock
        self.listening = pending.listening
        self._pending = pending

    async def message(
        self, names: Collection[str], test: Callable[[Any], T | None], timeout: float, action: str
    ) -> T:
        """Wait until `test` of a message of one of these names is not None.

        Args:
            names: message names; empty means every message of the vehicle.
            test: may raise to end the wait.
            timeout: in s.
            action: ends the sentence "vehicle 1 did not …" of a timeout.

        Raises:
            TimedOut: nothing in time.
            LinkLost: the vehicle's heartbeats stopped.
        """
        with self.expecting(names, test) as expected:
            return await expected.within(timeout, action)

    async def heartbeat_after(self, since: float) -> None:
        """Wait for a heartbeat that is newer than `since` (s): it shows what a pilot has done until then.

        Raises:
            TimedOut, LinkLost: none comes.
        """
        action = "send a heartbeat"
        await self.until({"HEARTBEAT"}, lambda: self.state.heard_since(since) or None, HEARD_WITHIN, action)

    async def evidence_of(self, sent_at: float, shown: Callable[[], bool], *, unbroken: bool) -> bool:
        """Whether `shown` holds; False once a heartbeat that left after our message's arrival does not show it.

        Args:
            sent_at: when the message was sent (s); see `VehicleState.shows`.
            shown: looks at the state, after each heartbeat and acknowledgement.
            unbroken: whether no message of the vehicle may be missing since then: what is missing may have shown it,
                and that the pilot has undone it.

        Raises:
            TimedOut, LinkLost: no such heartbeat comes, or too much is missing; also the errors of `shown`.
        """
        late_since: float | None = None

        def decided() -> bool | None:
            nonlocal late_since
            if shown():
                return True
            if not self.state.shows(sent_at):
                return None
            if not unbroken or not self.state.packets.has_any_since(sent_at):
                return False
            late_since = self.clock() if late_since is None else late_since
            if self.clock() - late_since <= self.state.trip.deadline:
                return None  # a newer message may have overtaken what is missing
            raise TimedOut(
                f"vehicle {self.state.system} does not show whether it has done that: messages of it are lost. It is "
                "not sent again, because the pilot may have undone it"
            )

        began = self.clock()
        while True:
            longest = HEARD_WITHIN + self.state.trip.longest  # it may be measured only now
            remaining = began + longest - self.clock()
            try:
                names = {"HEARTBEAT", "COMMAND_ACK"}
                return await self.until(names, decided, max(remaining, 0.1), "send a heartbeat")
            except TimedOut:
                if HEARD_WITHIN + self.state.trip.longest <= longest:
                    raise

    async def until(
        self, names: Collection[str], condition: Callable[[], T | None], timeout: float, action: str
    ) -> T:
        """Wait until `condition` is not None; it is checked now and after each message of these names.

        Raises:
            TimedOut, LinkLost: as `message`; also the errors of `condition`.
            Busy: two autopilots have the vehicle's id, so that nobody knows of which one it holds.
        """

        def look() -> T | None:
            self.state.require_one(self.clock())
            return condition()

        value = look()
        return value if value is not None else await self.message(names, lambda _: look(), timeout, action)

    @contextlib.contextmanager
    def expecting(self, names: Collection[str], test: Callable[[Any], T | None]) -> Iterator[ExpectedMessage[T]]:
        """A context that waits from the moment it is entered: enter it, send, then await `within`."""
        expected = ExpectedMessage(Wait(self.state.system, names, test), self.listening)
        with self._pending.registered(expected.wait):
            yield expected

    @contextlib.contextmanager
    def acks(
        self, command: int, asker: Address, shown: Callable[[], bool] = lambda: False
    ) -> Iterator[MessageExchange[int]]:
        """A context that catches the acks of `command` to `asker`, as MAV_RESULT; enter it before sending.

        A heartbeat after which `shown` holds counts as an ack that accepts; what `shown` raises ends the wait.
        """

        def result_of(message: Any) -> int | None:
            if message.get_type() == "HEARTBEAT":
                return mavlink.MAV_RESULT_ACCEPTED if shown() else None
            return message.result if message.command == command and not self.state.ack_is_copy else None

        exchange = MessageExchange(self.state, asker, {"COMMAND_ACK", "HEARTBEAT"}, result_of, self.listening)
        with self._pending.registered(exchange.wait):
            yield exchange

    @contextlib.contextmanager
    def exchange(self, names: Collection[str], asker: Address) -> Iterator[MessageExchange[Any]]:
        """A context that catches messages of these names to `asker`; enter it before sending."""
        exchange = MessageExchange(self.state, asker, names, lambda message: message, self.listening)
        with self._pending.registered(exchange.wait):
            yield exchange


class ExpectedMessage(Generic[T]):
    """A wait for one message.

    Attributes:
        wait: to be registered while it is expected.
    """

    def __init__(self, wait: Wait[T], listening: Listening) -> None:
        self.wait = wait
        self._listening = listening
        self._done = asyncio.Event()
        wait.on_settled = self._done.set

    async def within(self, timeout: float, action: str) -> T:
        """The awaited value.

        Args:
            timeout: in s.
            action: ends the sentence "vehicle 1 did not …".

        Raises:
            TimedOut, LinkLost: as `MessageWaiter.message`; also the errors of the test.
        """
        try:
            await self._listening.wait(timeout, self._done.wait)
        except asyncio.TimeoutError:
            sentence = f"vehicle {self.wait.system} did not {action} within {timeout:.1f} s"
            raise TimedOut(sentence) from None
        if self.wait.error is not None:
            raise self.wait.error
        return self.wait.value  # type: ignore[return-value]


def is_to(message: Any, asker: Address) -> bool:
    """Whether a message is addressed to `asker` or to everybody; one without a target is for everybody."""
    system, component = getattr(message, "target_system", 0), getattr(message, "target_component", 0)
    return system in (0, asker.system) and component in (0, asker.component)


class MessageExchange(Generic[T]):
    """The values of an autopilot's messages to us, in order; several messages may arrive in one batch.

    Attributes:
        wait: to be registered while the exchange lasts.

    Args:
        state: the vehicle.
        asker: our address; messages to others do not count.
        names: message names that belong to the exchange.
        read: gives the value of a message, or None to ignore it; what it raises ends the exchange.
        listening: when messages are read.
    """

    def __init__(
        self,
        state: VehicleState,
        asker: Address,
        names: Collection[str],
        read: Callable[[Any], T | None],
        listening: Listening,
    ) -> None:
        self._listening = listening
        self._state = state
        self._asker = asker
        self._read = read
        self._values: asyncio.Queue[T | None] = asyncio.Queue()
        self.wait: Wait[Any] = Wait(state.system, names, self._catch)
        self.wait.on_settled = lambda: self._values.put_nowait(None)

    def _catch(self, message: Any) -> None:
        if message.get_srcComponent() == self._state.component and is_to(message, self._asker):
            value = self._read(message)
            if value is not None:
                self._values.put_nowait(value)

    async def next(self, timeout: float) -> T | None:
        """The value of the next message; None when none comes within `timeout` s.

        Raises:
            LinkLost: the vehicle's heartbeats stopped; also the errors of `read`.
        """
        try:
            value = await self._listening.wait(timeout, self._values.get)
        except asyncio.TimeoutError:
            return None
        if value is None:
            raise self.wait.error or LinkLost(f"vehicle {self._state.system} is gone")
        return value
