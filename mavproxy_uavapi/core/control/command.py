"""The right of one job to command one vehicle, for the job's whole life: a track or a mission has one for all its
verbs. It is the only way to send a vehicle what moves it.

    waiting -----> on its way -----> confirmed        `take` begins, `confirm` follows the whole effect
                      |   ^             |
                      v   |             v
                   interrupted  (by `stop`, until `resume`)        ended: the job is over, or superseded

Each message passes, in this order: the start gate; the authority: this command is in force, not interrupted; what its
verb needs (armed, mode, the pilot); the airspace. The same checks come once more where MAVProxy's main loop writes
the message, if anything has changed since (`Permit`).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from enum import Enum
from typing import Any, Protocol

from mavproxy_uavapi.core.control.authority import CommandAuthority, Rank
from mavproxy_uavapi.core.control.jobs import MOMENT, Job
from mavproxy_uavapi.core.control.mode_switch import ModeRequests, ModeSwitch, Overtaken
from mavproxy_uavapi.core.control.start_gate import pass_gate
from mavproxy_uavapi.core.errors import Aborted, ModeChanged, NotArmed, Rejected, TimedOut
from mavproxy_uavapi.core.link.command_sender import CommandSender
from mavproxy_uavapi.core.link.link import Address, Link
from mavproxy_uavapi.core.link.message_waiter import MessageWaiter
from mavproxy_uavapi.core.link.messages import MavCommand, set_mode
from mavproxy_uavapi.core.mainloop.permit import ORDER_LASTS, STOP_LASTS, Permit, Written, no_check, permitted
from mavproxy_uavapi.core.telemetry.flight_modes import flies_mission, mode_name, mode_number
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

LONGEST_PROTECTION = 60.0  # s that what stops a vehicle waits for it to stand; its stop has a deadline of its own
LONGEST_PAUSE = 3600.0  # s that an interrupted job waits for `resume`

Need = Callable[[], None]  # raises if the vehicle is not as a message needs it


class CommandState(Enum):
    """Where a command is in its life."""

    WAITING = "waiting"  # it has not taken the vehicle
    ON_ITS_WAY = "on its way"  # it has, and telemetry does not show its whole effect yet
    CONFIRMED = "confirmed"
    INTERRUPTED = "interrupted"  # by `stop`: it sends nothing until `resume`
    ENDED = "ended"


class Airspace(Protocol):
    """Remembers what a vehicle was told; its link asks it."""

    ordered: Any


class CommandedVehicle(Protocol):
    """What a command needs of its vehicle."""

    state: VehicleState
    authority: CommandAuthority
    mode_requests: ModeRequests
    waiting: MessageWaiter
    clock: Callable[[], float]
    lands_by_mission: bool

    @property
    def guard(self) -> Airspace:
        """Where it may fly."""

    @property
    def address(self) -> Address:
        """Its autopilot's MAVLink address."""

    @property
    def is_in_own_mode(self) -> bool:
        """Whether it is in a mode that we chose or have commanded in."""

    async def know_for_airspace(self) -> None:
        """Ask for what its airspace is measured from, if it is not known."""

    def require_own_mode(self, since: float) -> None:
        """Raise ModeChanged if somebody else has switched its mode since."""


class Command:
    """See the module's text.

    Args:
        vehicle: the vehicle that it commands.
        job: whose right it is.
        sender, link: the ways out; nobody else has them.
    """

    def __init__(self, vehicle: CommandedVehicle, job: Job, sender: CommandSender, link: Link) -> None:
        self._vehicle, self._job = vehicle, job
        self._sender, self._link = sender, link

    @property
    def state(self) -> CommandState:
        """Where it is in its life."""
        authority = self._vehicle.authority
        if not self._job.running:
            return CommandState.ENDED
        if self._job is authority.interrupted:
            return CommandState.INTERRUPTED
        if self._job is not authority.commander:
            return CommandState.WAITING
        return CommandState.ON_ITS_WAY if authority.on_its_way else CommandState.CONFIRMED

    # -- the right ----------------------------------------------------------------------------------------

    async def take(self, rank: Rank, allow: Need = no_check) -> None:
        """Make the job the commander, once all verbs that begin with it can begin, too.

        What stops or lands a vehicle waits until the border has stopped it.

        Raises:
            Aborted: one of these cannot; nothing has changed.
            ModeChanged: its pilot has switched the mode meanwhile, and the job has waited, does not stop it, or has
                commanded it before: a longer job.
            Busy, Paused, Superseded: as `CommandAuthority.take`. Also what `allow` raises.
        """
        began = self._vehicle.clock()
        await self.resumed()
        vehicle, since = self._vehicle, self._vehicle.state.mode_since
        if since > self._job.began_at:  # a longer job: whoever switched it since the request keeps it
            since = -math.inf
        if rank < Rank.STOP:  # what stops it goes out before anything is asked
            await vehicle.know_for_airspace()
        waits = rank is Rank.STOP and vehicle.authority.is_protected

        def may_begin() -> None:
            if not waits:
                vehicle.authority.require_turn(self._job, rank)
            if rank < Rank.STOP or self._job is vehicle.authority.commander:
                vehicle.require_own_mode(since)
            allow()

        may_begin()
        if await pass_gate(may_begin):
            may_begin()
        if rank is Rank.STOP:
            await self.wait_for_protection(since)
        elif vehicle.clock() - began > MOMENT:  # the pilot may have taken it meanwhile
            await vehicle.waiting.heartbeat_after(vehicle.clock())
            may_begin()
        vehicle.authority.take(self._job, rank)

    async def wait_for_protection(self, since: float) -> bool:
        """Wait while the vehicle is stopped at its envelope, or before another; whether that was so.

        Args:
            since: `state.mode_since` at the request.

        Raises:
            ModeChanged: the pilot or a failsafe has taken the vehicle meanwhile.
            TimedOut, LinkLost: it does not come to stand, or no heartbeat comes.
        """
        vehicle = self._vehicle
        if not vehicle.authority.is_protected:
            return False

        def is_over() -> bool | None:
            return None if vehicle.authority.is_protected else True

        names = {"HEARTBEAT", "GLOBAL_POSITION_INT"}
        with vehicle.authority.keeping_turn(self._job):
            await vehicle.waiting.until(names, is_over, LONGEST_PROTECTION, "stand, stopped at the border")
            await vehicle.waiting.heartbeat_after(vehicle.clock())
        vehicle.require_own_mode(since)
        return True

    async def resumed(self) -> None:
        """Wait while `stop` interrupts the job. Each verb of a longer job begins with it.

        Raises:
            ModeChanged, NotArmed: the pilot or a failsafe took the stopped vehicle.
            TimedOut, LinkLost.
        """
        authority, state = self._vehicle.authority, self._vehicle.state

        def goes_on() -> bool | None:
            if self._job is not authority.interrupted:
                return True
            if not state.armed:
                raise NotArmed("the vehicle was disarmed while it was stopped")
            if not authority.paused:
                name = mode_name(state.vehicle_type, state.mode)
                raise ModeChanged(f"the pilot or a failsafe switched the stopped vehicle to {name}")
            return None

        await self._vehicle.waiting.until((), goes_on, LONGEST_PAUSE, "go on")

    def require(self) -> None:
        """Raise Superseded or Paused unless the job commands, Aborted if it has failed meanwhile; Busy if two
        autopilots have the vehicle's id.
        """
        self._vehicle.state.require_one(self._vehicle.clock())
        self._vehicle.authority.require(self._job)
        if self._job.error is not None:  # its task hears that a moment later
            raise Aborted(f"{self._job.verb} has ended: {self._job.error}")

    def confirm(self) -> None:
        """Telemetry shows the whole verb: from now on any rank supersedes it."""
        self._vehicle.authority.confirm(self._job)

    # -- sending ------------------------------------------------------------------------------------------

    def permit(self, *needs: Need, lasts: float | None = None, written: Written | None = None) -> Permit:
        """What a message of this command needs, until it is written.

        Args:
            needs: raise if the vehicle is not as the message needs it.
            lasts: s; by default what stops the vehicle lasts longer.
            written: as of the `Permit`.
        """
        vehicle = self._vehicle
        stops = vehicle.authority.rank >= Rank.STOP and self._job is vehicle.authority.commander

        def check() -> None:
            self.require()
            for need in needs:
                need()

        return Permit(
            lasts or (STOP_LASTS if stops else ORDER_LASTS),
            check,
            system=vehicle.state.system,
            basis=lambda: (vehicle.authority.epoch, self._job.running, vehicle.state.are_two(vehicle.clock())),
            stops=stops,
            written=written or Written(),
        )

    async def send(
        self,
        order: MavCommand,
        *needs: Need,
        shown: Callable[[], bool] = lambda: False,
        written: Written | None = None,
    ) -> None:
        """Send an order; done when the vehicle has accepted it. If it refuses, what it was told before still counts.

        Args:
            order: what to do.
            needs, written: as for `permit`.
            shown: as for `CommandSender.send`.

        Raises:
            Rejected, TimedOut, Expired, LinkLost: as `CommandSender.send`.
            Superseded, Paused, OutsideEnvelope, TooNear, Stale: it may not be sent. Also the errors of `needs`.
        """
        permit = self.permit(*needs, written=written)
        self._job.note_sent(order.name)
        with self._ordering():
            await self._sender.send(order, permit, gate=pass_gate, shown=shown)

    async def send_until_shown(
        self,
        order: MavCommand,
        *needs: Need,
        shown: Callable[[], bool],
        action: str,
        accepted: Need = no_check,
        written: Written | None = None,
    ) -> None:
        """As `send`, but done when a heartbeat shows it. `accepted`, `action`: as for the sender's."""
        permit = self.permit(*needs, written=written)
        self._job.note_sent(order.name)
        with self._ordering():
            await self._sender.send_until_shown(order, permit, shown, action, gate=pass_gate, accepted=accepted)

    async def post(self, message: Any, *needs: Need, lasts: float = ORDER_LASTS) -> None:
        """Send a message that has no answer; done when it is written.

        Raises:
            Expired, LinkLost, Superseded, Paused, OutsideEnvelope, TooNear, Stale. Also the errors of `needs`.
        """
        await pass_gate()
        permit = self.permit(*needs, lasts=lasts)
        permit.check()
        with permitted(permit):
            await self._link.send(message, self._vehicle.state.system)
        self._job.note_sent(message.get_type())

    @contextlib.contextmanager
    def _ordering(self) -> Iterator[None]:
        vehicle = self._vehicle
        before, lands = vehicle.guard.ordered, vehicle.lands_by_mission
        try:
            yield
        except BaseException as error:
            if vehicle.authority.commander is self._job:
                vehicle.lands_by_mission = lands  # no answer shows that it lands: its mission is watched
                if isinstance(error, Rejected):
                    vehicle.guard.ordered = before
            raise

    async def switch_mode(
        self, mode: str, *needs: Need, order: MavCommand | None = None, onward: Collection[str] = ()
    ) -> None:
        """Switch the flight mode, and wait until a heartbeat shows it. That alone confirms nothing.

        Args:
            mode: the mode's name.
            needs: called before each sending, and after heartbeats that do not show it; what one raises ends it.
            order: what does more than switch it, such as to begin a landing; None for DO_SET_MODE.
            onward: modes to which the autopilot may go on from that mode by itself, before a heartbeat.

        Raises:
            Invalid: no such mode.
            ModeChanged: the pilot or a failsafe has switched it since the verb took the vehicle.
            Rejected, TimedOut, Expired, LinkLost.
        """
        began, authority = self._vehicle.clock(), self._vehicle.authority
        if self._job is authority.commander and self._vehicle.state.mode is not None:
            self._vehicle.require_own_mode(authority.taken_in)  # the verb may have asked for something meanwhile
        number = mode_number(self._vehicle.state.vehicle_type, mode)
        while True:
            sent_at = self._vehicle.clock()
            switch = await self._switch_mode(number, *needs, order=order, onward=onward)
            stops = authority.rank >= Rank.STOP and self._job is authority.commander
            older = self._vehicle.mode_requests.overtaken(began) if stops else []
            if not await self.is_undone(older, sent_at, switch.holds):
                break
        switch.shown()

    async def is_undone(self, older: list[Overtaken], began: float, holds: Callable[[], bool]) -> bool:
        """Wait until no older order of ours may arrive any more; whether one has undone what a newer one did.

        A newer message overtakes an older one where the link changes, or has several ways.

        Args:
            older: the older orders that may be overtaken.
            began: when the newer order was sent, s; an older one that was answered before has undone nothing since.
            holds: whether the vehicle is as the newer one has it.
        """
        clock, trip = self._vehicle.clock, self._vehicle.state.trip
        sender, left_at = self._sender, math.inf
        older = [one for one in older if one.until > clock()]
        if not older:
            return False
        until = max(one.until for one in older)

        def decided() -> bool | None:
            nonlocal left_at
            if holds():
                left_at = math.inf
                return False if all(sender.is_settled(one.order, one.sent_at) for one in older) else None
            left_at = min(left_at, clock())
            if any(one.is_shown() and sender.has_done_older(one.order, began) for one in older):
                return True
            return False if clock() > left_at + trip.deadline else None  # it was not ours

        with contextlib.suppress(TimedOut):
            names = {"HEARTBEAT", "COMMAND_ACK"}
            return await self._vehicle.waiting.until(names, decided, until - clock(), "answer all that it was told")
        return False

    async def _switch_mode(
        self, number: int, *needs: Need, order: MavCommand | None, onward: Collection[str]
    ) -> ModeSwitch:
        state, requests = self._vehicle.state, self._vehicle.mode_requests
        goals = {number, *(mode_number(state.vehicle_type, name) for name in onward)}
        name = mode_name(state.vehicle_type, number)
        does_more = order is not None or bool(onward)
        switch = ModeSwitch(state, goals, requests.on_their_way(), does_more=does_more)
        written = Written()

        def switched_by_nobody_else() -> None:
            switch.shown()

        def shown() -> bool:
            if switch.shown():
                return True
            for need in needs:
                need()
            return False

        def noted() -> None:
            requests.note(number, command.number, written)
            modes = {mode_name(state.vehicle_type, goal) for goal in goals}
            self._job.note_modes(modes, written)
            if any(map(flies_mission, modes)):
                self.note_mission()

        checks = switched_by_nobody_else, *needs, noted
        command = replace(order or set_mode(number), takes=True, proven_by_ack=switch.is_ambiguous)
        try:
            await self.send_until_shown(
                command,
                *checks,
                shown=shown,
                action=f"show mode {name}",
                accepted=lambda: switch.acknowledged(self._vehicle.clock()),
                written=written,
            )
        except Rejected:
            requests.forget(number)
            raise
        return switch

    def note_mission(self) -> None:
        """Note whether the job lands the vehicle by its mission, as a plane does; before what begins it is sent."""
        authority = self._vehicle.authority
        self._vehicle.lands_by_mission = self._job is authority.commander and authority.rank is Rank.STOP
