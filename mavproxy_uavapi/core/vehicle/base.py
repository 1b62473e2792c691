"""What the verbs of all vehicles use: state, guards, waits, mode switches, requests."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import braking, time_limits
from mavproxy_uavapi.core.airspace.envelope_check import Spaces
from mavproxy_uavapi.core.airspace.guard import EnvelopeGuard, GuardedLink
from mavproxy_uavapi.core.airspace.speeds import Speeds
from mavproxy_uavapi.core.control.authority import CommandAuthority, Rank
from mavproxy_uavapi.core.control.command import Command
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.control.mode_switch import ModeRequests
from mavproxy_uavapi.core.errors import ModeChanged, TimedOut, UavApiError
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.command_sender import CommandSender
from mavproxy_uavapi.core.link.dataflash import DataflashLogs
from mavproxy_uavapi.core.link.link import BoundedLink, Link
from mavproxy_uavapi.core.link.message_waiter import HEARD_WITHIN, MessageWaiter
from mavproxy_uavapi.core.link.parameters import Parameters
from mavproxy_uavapi.core.mainloop.permit import QUESTION_LASTS, Permit, Written, no_check, permitted
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import PathPoint
from mavproxy_uavapi.core.mission.mission_protocol import Waypoints
from mavproxy_uavapi.core.shared_tasks import SharedTasks
from mavproxy_uavapi.core.telemetry.flight_modes import (
    LANDING_MODES,
    RETURN_MODES,
    STOPPING_MODES,
    flies_mission,
    mode_name,
)
from mavproxy_uavapi.core.telemetry.pending_waits import PendingWaits
from mavproxy_uavapi.core.telemetry.vehicle_state import HEARTBEAT_PERIOD, VehicleState
from mavproxy_uavapi.core.vehicle.reporting import ReportingVehicle

T = TypeVar("T")
mavlink = mavutil.mavlink

REPORT_TIMEOUT = 5.0  # s until a requested message must come; it is requested twice


class BaseVehicle(ReportingVehicle):
    """One vehicle, and what its verbs use.

    Verbs raise errors of `errors.py`: `Rejected` when the autopilot refuses, `TimedOut`, `LinkLost`,
    `ModeChanged` when the pilot or a failsafe takes the vehicle, `Busy` and `NotArmed` when its state
    forbids the verb; then nothing has been sent.

    Attributes:
        moving_modes: the modes in which it flies by a movement, or takes off, for us.
        failsafe_modes: the modes in which a failsafe goes on, if the vehicle is in them already.
        stops_by: the parameters that tell how it stops: the names of each quantity.

    Args:
        state: its state, which the host keeps up to date.
        link: the way out.
        pending: the host's waits.
        clock: monotonic seconds, the clock of arrivals.
        spaces: gives the envelopes in force for it.
    """

    moving_modes: Collection[str] = frozenset({"GUIDED"})
    failsafe_modes: Collection[str] = LANDING_MODES | RETURN_MODES | {"AUTO_RTL"}
    stops_by: Sequence[tuple[str, ...]] = (*braking.WANTED, *time_limits.WANTED)

    def __init__(
        self,
        state: VehicleState,
        link: Link,
        pending: PendingWaits,
        clock: Callable[[], float],
        spaces: Spaces = tuple,
    ) -> None:
        super().__init__(state, clock)
        self.speeds = Speeds(state)
        self.arm_sent_at = -math.inf  # s; when the order to arm was sent last
        self.arm_written = Written()  # whether it was written
        self.lands_by_mission = False  # in AUTO: whether a verb that stops or lands it has begun that
        # `landing_places` of its mission; None while it is not known.
        self.landing_items: Mapping[int, tuple[float, float] | None] | None = None
        self.guard = EnvelopeGuard(self, spaces)
        self._link: Link = BoundedLink(GuardedLink(link, self.guard))
        self.authority = CommandAuthority(state)
        self.waiting = MessageWaiter(state, pending, clock)
        self._sender = CommandSender(state, self._link, self.waiting)
        self.waypoints = Waypoints(state, self._link, self.waiting, self._allow_upload, lambda: self.may_fly_mission)
        self.parameters = Parameters(state, self._link, self.waiting)
        self.logs = DataflashLogs(state, self._link, self.waiting)
        self.mode_requests = ModeRequests(state, clock)
        self._requests = SharedTasks[Any]()  # REQUEST_MESSAGE, by message name

    def continues(self, before: BaseVehicle) -> None:
        """Take over from the object of the same vehicle, whose type has changed.

        Its jobs go on, and newer ones supersede them; a pause, and speeds that were asked for, remain.
        """
        self.authority, self.speeds, self.mode_requests = before.authority, before.speeds, before.mode_requests

    # -- state --------------------------------------------------------------------------------------------

    @property
    def next_mode(self) -> str:
        """The name of the last requested mode, until a heartbeat shows the outcome; else `mode`."""
        coming = self.mode_requests.on_their_way()
        return mode_name(self.state.vehicle_type, coming[-1]) if coming else self.mode

    @property
    def is_settled(self) -> bool:
        """Whether none of our mode switches may still be on its way."""
        return all(number == self.state.mode for number in self.mode_requests.on_their_way())

    # -- guards and waits ---------------------------------------------------------------------------------

    @property
    def arm_is_on_its_way(self) -> bool:
        """Whether our order to arm may still arm it."""
        may_come = self.arm_written.value is not False and self.clock() <= self.arm_arrives_by
        return self.state.armed is False and may_come

    @property
    def arm_arrives_by(self) -> float:
        """When (s) our last order to arm has arrived, and a heartbeat has shown it, or never will."""
        return self.arm_sent_at + max(HEARD_WITHIN, self.state.trip.deadline + 2 * HEARTBEAT_PERIOD)

    async def wait_for_heartbeat(self) -> None:
        """Wait for the next heartbeat: it shows what a pilot has done since the last one.

        It comes before a mode switch that nobody requests at that moment, and before "disarmed" counts as an outcome.

        Raises:
            TimedOut, LinkLost: none comes.
        """
        await self.waiting.heartbeat_after(self.clock())

    async def ask_heartbeat(self, seconds: float) -> None:
        """Ask for a heartbeat, and wait for one for so many s.

        Raises:
            TimedOut, LinkLost: none comes.
        """
        asked_at = self.clock()
        action = "answer with a heartbeat"
        await self.post(messages.request_message(messages.MESSAGE_IDS["HEARTBEAT"]).to(self.address, 0))
        await self.waiting.until({"HEARTBEAT"}, lambda: self.state.heard_since(asked_at) or None, seconds, action)

    @property
    def may_fly_mission(self) -> bool:
        """Whether it flies its mission, or a mode in which it does has been requested and not been shown yet."""
        return bool(self.state.armed) and (flies_mission(self.mode) or flies_mission(self.next_mode))

    async def until(
        self, mode: str, names: Iterable[str], done: Callable[[], T | None], timeout: float, action: str
    ) -> T:
        """Wait until `done` holds while the vehicle stays armed and in `mode`.

        Args:
            mode: the mode that the verb needs.
            names: messages after which `done` is looked at; heartbeats always are.
            done: looks at the state.
            timeout: in s.
            action: ends the sentence "vehicle 1 did not …".
        """

        def guarded() -> T | None:
            self.held_by(mode)
            return done()

        return await self.waiting.until({"HEARTBEAT", *names}, guarded, timeout, action)

    def inside(self, order: messages.Target | messages.MavCommand) -> Callable[[], None]:
        """The check that the vehicle stays in its envelope with this order; for `CommandAuthority.take`."""
        if isinstance(order, messages.MavCommand):
            message = order.to(self.address, 0)
        else:
            message = order.to(self.address, messages.NO_YAW)
        return lambda: self.guard.require(message)

    def require_route(self, places: Iterable[messages.GlobalTarget]) -> None:
        """Raise OutsideEnvelope unless the straight ways from here through those places stay in the envelope."""
        places = list(places)
        self.guard.require_reach((f"place {number} of the way", p.lat, p.lon) for number, p in enumerate(places, 1))
        if self.guard.in_force:
            self.guard.check.require_way(
                [[self.guard.check.here(), *(PathPoint(p.lat, p.lon, p.alt) for p in places)]]
            )

    async def know_for_airspace(self) -> None:
        """Ask for home if an envelope is in force and home is not known; who needs it is refused then."""
        if self.guard.check.spaces and self.state.home is None:
            with contextlib.suppress(UavApiError):
                await self.request("HOME_POSITION")

    async def _allow_upload(self, items: Sequence[MissionItem]) -> None:
        await self.guard.look_at_mission(items, from_here=False)
        self.guard.require_mission(items, from_here=False)

    @property
    def has_foreign_target(self) -> bool:
        """Whether the autopilot reports a target that another ground station gave it."""
        return False

    def repeat_nothing(self) -> None:
        """Stop sending a target again, whether the vehicle reports it or not."""

    def anothers(self) -> ModeChanged:
        """The error for a vehicle that is under way for somebody else."""
        moving = "driving" if self.guard.check.drives else "flying"
        return ModeChanged(f"the vehicle is {moving} in {self.mode}; `guided` takes it over")

    @property
    def is_in_own_mode(self) -> bool:
        """Whether it is in a mode that we chose or have commanded in."""
        return self.guard.ordered.at >= self.state.mode_since or self.mode_requests.chose_the_mode

    @property
    def is_protected(self) -> bool:
        """Whether it is being stopped at its envelope or before another vehicle, or was, and has been left so."""
        authority = self.authority
        stopped = authority.rank is Rank.PROTECT and self.mode in self.holding_modes and self.is_in_own_mode
        return authority.is_protected or stopped

    @property
    def obeys_us(self) -> bool:
        """Whether it is in a mode of ours, without a target of another station."""
        return self.is_in_own_mode and not self.has_foreign_target

    @property
    def may_be_a_failsafes(self) -> bool:
        """Whether a failsafe may fly it by now in a mode that it was in already, so that no switch tells of it."""
        return self.state.is_failing and self.mode in self.failsafe_modes

    @property
    def flies_for_us(self) -> bool:
        """Whether it flies by our command, and does not land, return or hold."""
        if not self.state.armed or self.stands or self.authority.commander is None:
            return False
        if self.mode in STOPPING_MODES or self.mode in self.holding_modes:
            return False
        moves = not self._may_land if flies_mission(self.mode) else self.mode in self.moving_modes
        return moves and self.obeys_us

    @property
    def _may_land(self) -> bool:
        """Whether in AUTO it lands or returns, or nobody knows."""
        return self.lands_by_mission or self.guard.lands_now(self.landing_items)

    @property
    def flies_unread_mission(self) -> bool:
        """Whether it flies a mission of which nobody knows the way, or where it lands."""
        return flies_mission(self.mode) and (self.guard.ordered.is_unread or self.landing_items is None)

    @property
    def glides(self) -> bool:
        """Whether it is a plane that comes down along the slope of a landing item of its mission."""
        item = self.state.field("MISSION_CURRENT", "seq")
        return bool(self.guard.check.circle) and flies_mission(self.mode) and item in (self.landing_items or ())

    def require_own_mode(self, since: float) -> None:
        """Raise ModeChanged if somebody else has switched its mode; `since`: the former `state.mode_since`."""
        if self.state.mode_since != since and not self.is_in_own_mode:
            raise ModeChanged(f"the pilot or a failsafe switched the vehicle to {self.mode} meanwhile")

    # -- sending ------------------------------------------------------------------------------------------

    def command(self, job: Job) -> Command:
        """The right of `job` to command the vehicle: all that moves it is sent by one."""
        return Command(self, job, self._sender, self._link)

    async def ask(self, order: messages.MavCommand) -> None:
        """Send an order that moves nothing: a question, an interval, a servo output. It needs no right.

        Raises:
            Rejected, TimedOut, Expired, LinkLost: as `CommandSender.send`.
        """
        await self._sender.send(order)

    async def post(
        self, message: Any, check: Callable[[], None] = no_check, *, lasts: float = QUESTION_LASTS
    ) -> None:
        """Send a message that moves nothing and has no answer, or whose answer the caller awaits.

        Args:
            message: a request, a parameter.
            check: raises if it may not be sent; called again where it is written if anything has changed.
            lasts: s until it is too old.

        Raises:
            Expired, LinkLost.
        """
        check()
        with permitted(Permit(lasts, check=check, system=self.state.system)):
            await self._link.send(message, self.state.system)

    async def limits(self) -> time_limits.FlightLimits:
        """Its speeds and heights, for deadlines; unknown ones are requested from the vehicle."""
        return time_limits.limits(await self.parameters.read(time_limits.WANTED), self.speeds.in_force)

    def allowed(self, expected: float, timeout: float | None) -> float:
        """Seconds that a verb may take: the client's `timeout`, or what the flight should need."""
        return timeout or time_limits.allowed(expected, self.state.time_ratio.ratio)

    async def request(self, name: str) -> Any:
        """Request a message of that name from the autopilot, and return it. Simultaneous callers share one request.

        Raises:
            Rejected: it has no such message.
            TimedOut, LinkLost.
        """
        return await self._requests.outcome(name, lambda: self._request(name))

    async def _request(self, name: str) -> Any:
        def from_autopilot(message: Any) -> Any:
            return message if message.get_srcComponent() == self.state.component else None

        seconds = self.state.trip.at_least(REPORT_TIMEOUT / 2)
        with self.waiting.expecting({name}, from_autopilot) as expected:
            await self.ask(messages.request_message(messages.MESSAGE_IDS[name]))
            with contextlib.suppress(TimedOut):  # it may be lost: it is asked for once more
                return await expected.within(seconds, f"report {name}")
            await self.ask(messages.request_message(messages.MESSAGE_IDS[name]))
            return await expected.within(seconds, f"report {name}, asked twice,")
