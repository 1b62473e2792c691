"""A command and its acknowledgement.

An ack counts only if the addressed component sends it to us, for that command, after we sent the command. Without
an ack, a command that may be repeated is sent again.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
from collections import defaultdict, deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Expired, Rejected, TimedOut, UavApiError
from mavproxy_uavapi.core.link.link import Address, Link
from mavproxy_uavapi.core.link.message_waiter import MessageWaiter, is_to
from mavproxy_uavapi.core.link.messages import MavCommand, time_question
from mavproxy_uavapi.core.mainloop.permit import CLOCK_LASTS, DEFAULT, Permit, permitted
from mavproxy_uavapi.core.telemetry.trip import GRAIN, Trip
from mavproxy_uavapi.core.telemetry.vehicle_state import HEARTBEAT_PERIOD, VehicleState

mavlink = mavutil.mavlink

log = logging.getLogger("uavapi.copter")

ACK_TIMEOUT = 1.5  # s until a command is sent again; more on a slow link
SENDINGS = 4  # the first one and three more
IN_PROGRESS_TIMEOUT = 10.0  # s by which each IN_PROGRESS extends the wait
IN_PROGRESS_LIMIT = 60.0  # s until a command that is still in progress is given up
RETRY_PAUSE = 1.0  # s before a patient command is sent again
SHOWN_WITHIN = (2.0, 1.5, 1.5)  # s after each acknowledgement in which a heartbeat must show what was done
SENT_KEPT = 32  # times of the newest sendings of each command
LATE_ACK = 10.0  # s after a sending in which its ack may still come
TEXT_TIMEOUT = 0.5  # s that the STATUSTEXT of a refusal may come after its ack
QUESTIONS = {mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_RUN_PREARM_CHECKS}  # they change nothing
WORTH_ASKING_AGAIN = {mavlink.MAV_RESULT_TEMPORARILY_REJECTED, mavlink.MAV_RESULT_FAILED}


Gate = Callable[[], Awaitable[object]]


async def open_gate() -> None:
    """Nothing to wait for."""


@dataclass(frozen=True)
class Sending:
    """A command that was sent and not answered yet: its parameters, and when (s)."""

    params: tuple[float, ...]
    at: float


class CommandSender:
    """Sends commands to one vehicle and waits for their acks; those of one MAV_CMD go one after the other."""

    def __init__(self, state: VehicleState, link: Link, waiting: MessageWaiter) -> None:
        self._state = state
        self._link = link
        self._waiting = waiting
        self._locks: defaultdict[int, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._unanswered: defaultdict[int, deque[Sending]] = defaultdict(deque)  # oldest first
        self._sent_at: defaultdict[int, deque[float]] = defaultdict(lambda: deque(maxlen=SENT_KEPT))  # s

    async def send(
        self,
        command: MavCommand,
        permit: Permit = DEFAULT,
        *,
        gate: Gate = open_gate,
        retry_for: float = 20.0,
        shown: Callable[[], bool] = lambda: False,
    ) -> None:
        """Send `command`; returns when the vehicle has accepted it.

        Args:
            command: what to send.
            permit: its check is called before each sending, and again where the message is written if anything has
                changed: what it raises ends the command, and nothing more is sent.
            gate: awaited before each sending.
            retry_for: how long (s) a patient command is sent again while it is refused.
            shown: called after each heartbeat: whether telemetry shows the effect, even if the ack was lost; what
                it raises ends the command.

        Raises:
            Rejected: refused, with MAV_RESULT and the STATUSTEXTs since the command.
            TimedOut: no ack, also after sending again.
            Expired: MAVProxy was busy for too long.
            LinkLost: the heartbeats stopped, or there is no link.
        """
        async with self._locks[command.number]:
            started = self._waiting.clock()
            while True:
                result = await self._ask(command, permit, gate, shown)
                log.debug("%s%s: %s", command.name, command.params, result_name(result))
                if result == mavlink.MAV_RESULT_ACCEPTED:
                    return
                again = result in (WORTH_ASKING_AGAIN if command.patient else command.again_after)
                if not again or self._waiting.clock() + RETRY_PAUSE > started + retry_for:
                    raise await self._refusal(command, result, started)
                await asyncio.sleep(RETRY_PAUSE)
                if shown():
                    return

    async def send_until_shown(
        self,
        command: MavCommand,
        permit: Permit,
        shown: Callable[[], bool],
        action: str,
        *,
        gate: Gate = open_gate,
        accepted: Callable[[], None] = lambda: None,
    ) -> None:
        """Send `command` until a heartbeat shows that it was done.

        The ack is not enough: MAVLink does not number commands, so it may belong to an earlier one. Only then it is
        sent again, if a heartbeat that left the vehicle later than the command could arrive does not show it.

        Args:
            command: what to send.
            permit, shown, gate: as for `send`.
            accepted: called after each acknowledgement.
            action: ends the sentence "vehicle 1 did not …".

        Raises:
            Rejected, TimedOut, Expired, LinkLost: as `send`; also the errors of the check and of `shown`.
        """
        began = self._waiting.clock()
        for number in range(len(SHOWN_WITHIN)):
            others = len(self._outstanding(command.number))
            await self.send(command, permit, shown=shown, gate=gate)
            accepted()
            sent_at = self._waiting.clock()
            with contextlib.suppress(TimedOut):
                await self._waiting.until(
                    {"HEARTBEAT"}, lambda: shown() or None, self._trip.at_least(SHOWN_WITHIN[number]), action
                )
                return
            if await self._is_shown_since(sent_at, shown, permit):
                return
            if not others:  # the ack was for this command: it was done, and somebody has undone it since
                break
        waited = self._waiting.clock() - began
        raise TimedOut(f"vehicle {self._state.system} did not {action} within {waited:.1f} s")

    async def _is_shown_since(self, sent_at: float, shown: Callable[[], bool], permit: Permit) -> bool:
        """Whether the effect of a sending shows; False once a heartbeat that left after its arrival does not show it.

        If messages of the vehicle are missing, that shows nothing, except for what stops the vehicle.

        Raises:
            TimedOut, LinkLost: no such heartbeat comes; also the errors of `shown`.
        """
        if not shown():
            await self._ask_clock()
        return await self._waiting.evidence_of(sent_at, shown, unbroken=not permit.stops)

    async def _outcome_in_silence(
        self, number: int, shown: Callable[[], bool], permit: Permit, *, alone: bool
    ) -> int | None:
        """The MAV_RESULT of a sending, by an ack that comes only now or by what telemetry shows; None for nothing.

        Args:
            number: of the command.
            shown, permit: as for `send`.
            alone: whether a late ack can be for this command only.
        """
        since, unanswered = self._waiting.clock(), self._unanswered[number]
        counted = len(self._answers(number, since)[0])  # of this very moment

        def late() -> list[Any]:
            return self._answers(number, since)[0][counted:] if alone else []

        if not await self._is_shown_since(unanswered[-1].at, lambda: shown() or bool(late()), permit):
            return None
        if late():
            unanswered.popleft()
        return int(late()[0].result if late() else mavlink.MAV_RESULT_ACCEPTED)

    async def _ask_clock(self) -> None:
        """Ask for the vehicle's clock: its answer shows that what was sent before has arrived, or is lost."""
        address = Address(self._state.system, self._state.component)
        question = time_question(address, self._trip.ask(self._waiting.clock()))
        with contextlib.suppress(Expired), permitted(Permit(CLOCK_LASTS)):  # others are asked every second
            await self._link.send(question, self._state.system)

    @property
    def _trip(self) -> Trip:
        return self._state.trip

    def _outstanding(self, number: int) -> deque[Sending]:
        """The sendings of that command whose ack may still come, oldest first."""
        unanswered = self._unanswered[number]
        while unanswered and unanswered[0].at < self._waiting.clock() - LATE_ACK:
            unanswered.popleft()
        return unanswered

    def is_settled(self, number: int, since: float) -> bool:
        """Whether all commands `number` since `since` (s) have their acks, and the newest heartbeat left later."""
        acks, sent = self._answers(number, since)
        return len(acks) >= sent and all(map(self._state.heartbeat_follows, acks))

    def has_done_older(self, number: int, since: float) -> bool:
        """Whether a command `number` from before `since` (s) was accepted: more acks came than were sent since."""
        acks, sent = self._answers(number, since)
        return sum(bool(ack.result == mavlink.MAV_RESULT_ACCEPTED) for ack in acks) > sent

    def _answers(self, number: int, since: float) -> tuple[list[Any], int]:
        """The final acks of a command since then, and how many of it were sent since then."""
        acks = [ack for at, ack in self._state.acks if at >= since and ack.command == number]
        final = [a for a in acks if a.result != mavlink.MAV_RESULT_IN_PROGRESS and is_to(a, self._link.source)]
        return final, sum(at >= since for at in self._sent_at[number])

    async def _pass(self, gate: Gate, command: MavCommand) -> None:
        """Wait at the gate. After a longer wait hear a heartbeat: the pilot may have the vehicle by now."""
        came_at = self._waiting.clock()
        await gate()
        if command.takes and self._waiting.clock() - came_at > HEARTBEAT_PERIOD:
            await self._waiting.heartbeat_after(self._waiting.clock())

    async def _ask(self, command: MavCommand, permit: Permit, gate: Gate, shown: Callable[[], bool]) -> int:
        """Send it until it is answered; the MAV_RESULT.

        MAVLink does not number commands. Where the ack is the only proof, an ack that may belong to an earlier
        command does not count: the command is sent once more for each of them.
        """
        number, unanswered = command.number, self._outstanding(command.number)
        others = sum(sending.params != command.params for sending in unanswered)
        late = others if command.proven_by_ack else 0
        sendings = SENDINGS if command.repeatable else 1
        give_up_at = self._waiting.clock() + IN_PROGRESS_LIMIT
        silences = 0
        for confirmation in itertools.count():
            await self._pass(gate, command)
            if confirmation and command.takes:
                result = await self._outcome_in_silence(number, shown, permit, alone=not others)
                if result is not None:
                    return result
            permit.check()
            try:
                result = await self._exchange(command, confirmation, permit, shown, give_up_at)
            except Expired:
                if not confirmation:
                    raise
                break  # the first one was written
            if result is None:
                silences += 1
                if silences == sendings or self._waiting.listening.is_behind:
                    break
                continue
            if unanswered:
                unanswered.popleft()
            is_doubtful = others > 0 and command.repeatable and result != mavlink.MAV_RESULT_ACCEPTED
            others -= 1
            if not late and not is_doubtful:
                return result
            late = max(late - 1, 0)
        times = "" if sendings == 1 else f", sent {sendings} times"
        why = "; MAVProxy's main loop stood" if self._waiting.listening.is_behind else times
        raise TimedOut(f"vehicle {self._state.system} did not acknowledge {command.name}{why}")

    async def _exchange(
        self, command: MavCommand, confirmation: int, permit: Permit, shown: Callable[[], bool], give_up_at: float
    ) -> int | None:
        """Write it once; the MAV_RESULT of its last ack, or None for silence."""
        address = Address(self._state.system, self._state.component)
        with self._waiting.acks(command.number, self._link.source, shown) as acks:
            self._sent_at[command.number].append(self._waiting.clock())
            try:
                with permitted(permit):
                    await self._link.send(command.to(address, confirmation), self._state.system)
            except UavApiError:  # it was not written; where the task is cancelled, it may have been
                self._sent_at[command.number].pop()
                raise
            sent_at, listened = self._waiting.clock(), self._waiting.listening.seconds()
            self._unanswered[command.number].append(Sending(command.params, sent_at))
            result = await acks.next(self._trip.at_least(ACK_TIMEOUT))
            if result is not None and not confirmation and command.number in QUESTIONS:
                seconds = self._waiting.clock() - sent_at
                if seconds - (self._waiting.listening.seconds() - listened) < GRAIN:  # it did not wait in MAVProxy
                    self._trip.measured(seconds)
            while result == mavlink.MAV_RESULT_IN_PROGRESS:
                if self._waiting.clock() >= give_up_at:
                    waited = f"{IN_PROGRESS_LIMIT:g} s"
                    raise TimedOut(f"vehicle {self._state.system} did not finish {command.name} within {waited}")
                result = await acks.next(IN_PROGRESS_TIMEOUT)
            return result

    async def _refusal(self, command: MavCommand, result: int, started: float) -> Rejected:
        with contextlib.suppress(TimedOut):  # ArduPilot queues its texts, so that they may come after the ack
            await self._waiting.until(
                {"STATUSTEXT"}, lambda: self._state.statustexts.since(started) or None, TEXT_TIMEOUT, "say why"
            )
        texts = self._state.statustexts.since(started)
        ack = result_name(result)
        because = f": {'; '.join(texts)}" if texts else ""
        return Rejected(f"the vehicle refused {command.name} ({ack}){because}", ack, texts)


def result_name(result: int) -> str:
    """MAV_RESULT's name, such as `MAV_RESULT_FAILED`."""
    entry: Any = mavlink.enums["MAV_RESULT"].get(result)
    return entry.name if entry else f"MAV_RESULT_{result}"
