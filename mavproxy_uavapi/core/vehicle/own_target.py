"""Which setpoint a vehicle flies in GUIDED: our newest one, or another station's. Pure: the clock is an argument."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Superseded, TimedOut
from mavproxy_uavapi.core.geodesy import moved, offset
from mavproxy_uavapi.core.link.messages import GlobalTarget, NedTarget, Target, VelocityTarget
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle import setpoint_in_force

mavlink = mavutil.mavlink

TARGET_SHOWN = 2.0  # s after a setpoint in which telemetry does not count
LATEST = 8.0  # s after a setpoint in which a slow link or a busy MAVProxy may still report older ones
SAME_PLACE = 2.0  # m on each axis: reported targets within this are the same
UNCHANGED = 1.0  # m, north, east and up: a target that is reported again differs by less
SAME_SPEED = 0.5  # m/s: reported velocities within this are the same
SAME_MOMENT = 3.0  # s between two messages, in which a vehicle does not change its velocity much
BEGUN_WITHIN = 3.0  # s from the switch to GUIDED to the heartbeat that shows it, at the most
NEAR = 10.0  # m on each axis between places that may be one: the origin of the local frame is not told

STANDSTILL = VelocityTarget(0, 0, 0)  # what GUIDED begins with, and what follows a velocity that is not repeated

ANOTHERS = "another ground station gave the vehicle another target"

Reported = GlobalTarget | VelocityTarget


class Before(NamedTuple):
    """The previous setpoint: when it was replaced (s), its target, and whether we sent it."""

    at: float
    target: Reported
    is_ours: bool


class OwnTarget:
    """Our newest setpoint, and whether the autopilot reports it.

    Attributes:
        newest: the setpoint; None before the first.
        sent_at: when it was sent (s).
        is_unshown: whether it is a place that the autopilot must report, and has not yet.

    Args:
        state: the vehicle's state.
        clock: monotonic seconds.
        begins_at_a_place: whether GUIDED begins with the place where the vehicle is, and reports it.
    """

    def __init__(self, state: VehicleState, clock: Callable[[], float], *, begins_at_a_place: bool = False) -> None:
        self.newest: Target | None = None
        self.sent_at = 0.0
        self.is_unshown = False
        self._state, self._clock, self._begins_at_a_place = state, clock, begins_at_a_place
        self._shown: GlobalTarget | None = None  # our target as the autopilot reports it
        self._expected: GlobalTarget | None = None  # where it will report our target in the local frame, about
        self._before: deque[Before] = deque()  # oldest first
        self._steered_by: object = None  # whose setpoint the newest is
        self._steered_since = 0.0  # s; since when he has sent velocities only
        self._place_before: Reported | None = None  # what was in force before them

    def sent(self, target: Target, sender: object = None, *, must_show: bool = False) -> None:
        """Remember the setpoint that went out last.

        Args:
            target: the setpoint.
            sender: whose it is.
            must_show: whether somebody watches until the autopilot reports it.
        """
        since = self._state.mode_since
        if not self._is_steered_by(sender):
            self._steered_since, self._steered_by = self._clock(), sender
            self._place_before = setpoint_in_force.shown(self._state, since) or self._own_before
        reported = setpoint_in_force.shown(self._state, since) or (STANDSTILL if self.sent_at < since else None)
        self._replace(reported, is_ours=reported is not None and self._is_known(reported))
        self._replace(self._own_before, is_ours=True)
        if isinstance(self.newest, VelocityTarget):
            self._replace(STANDSTILL, is_ours=True)  # what follows when the autopilot drops it
        is_same = target == self.newest and self._shown is not None
        self.newest, self.sent_at, self.is_unshown = target, self._clock(), must_show
        if not is_same:
            self._shown = target if isinstance(target, GlobalTarget) else None
            self._expected = place_of(target, self._state) if isinstance(target, NedTarget) else None

    def sent_again(self) -> None:
        """Note that the newest setpoint went out once more."""
        self.sent_at = self._clock()

    @property
    def _own_before(self) -> Reported | None:
        """The newest setpoint in the form in which the autopilot reports it; None if that is not known."""
        return self.newest if isinstance(self.newest, VelocityTarget) else self._shown or self._expected

    def _is_known(self, reported: Reported) -> bool:
        """Whether the setpoint in force is one of ours, or the standstill that GUIDED begins with."""
        ours = (self._own_before, STANDSTILL, *(target for _, target, is_ours in self._before if is_ours))
        return any(one is not None and _are_alike(one, reported) for one in ours)

    def _replace(self, target: Reported | None, *, is_ours: bool) -> None:
        """Remember a setpoint that may still be reported while a newer one is on its way."""
        now = self._clock()
        while self._before and now >= self._before[0].at + LATEST:
            self._before.popleft()
        if self._before and _are_alike(self._before[-1].target, target):
            self._before.pop()  # many clients repeat their setpoint
        if target is not None:
            self._before.append(Before(now, target, is_ours))

    def require(self) -> None:
        """Raise unless the autopilot flies to our target, as far as it reports one.

        Raises:
            Superseded: it reports another station's target, or a velocity.
            TimedOut: it still reports an older target of ours.
        """
        reported = self._reported()
        if self.flies_elsewhere:
            raise TimedOut(f"vehicle {self._state.system} does not take its new target: it reports an older one")
        if reported is None:
            return
        if isinstance(reported, GlobalTarget) and self._is_ours(reported):
            return
        raise Superseded(ANOTHERS)

    def _is_steered_by(self, sender: object) -> bool:
        return sender is self._steered_by and isinstance(self.newest, VelocityTarget)

    def require_steered_by(self, sender: object) -> None:
        """Raise Superseded if another station has given a target since that sender's velocities began.

        The next one of them hides it. So any report counts of a place that is not the one before them, and any
        acknowledgement of DO_REPOSITION, which no verb sends meanwhile.
        """
        if not self._is_steered_by(sender):
            return
        since = max(self._steered_since, self._state.mode_since) + TARGET_SHOWN
        reported = setpoint_in_force.shown(self._state, since)
        here = self._state.position
        if isinstance(reported, GlobalTarget) and here and _apart(GlobalTarget(*here.place, 0.0), reported) <= NEAR:
            self._place_before = reported  # a boat to which nothing has come for a while stays where it is
        acks = [ack for at, ack in self._state.acks if at > since and ack.command == mavlink.MAV_CMD_DO_REPOSITION]
        is_new = isinstance(reported, GlobalTarget) and not any(
            isinstance(one, GlobalTarget) and _apart(one, reported) <= NEAR
            for one in (self._place_before, *(target for _, target, _ in self._before))
        )
        if is_new or any(ack.result == mavlink.MAV_RESULT_ACCEPTED for ack in acks):
            raise Superseded(ANOTHERS)

    @property
    def is_foreign(self) -> bool:
        """Whether the autopilot reports another target or velocity than the newest of ours."""
        reported = self._reported()
        if reported is None:
            return False
        if isinstance(reported, VelocityTarget):
            own = _speed(self.newest) if isinstance(self.newest, VelocityTarget) else 0.0
            return _speed(reported) > SAME_SPEED and abs(_speed(reported) - own) > SAME_SPEED
        if self.sent_at < self._state.mode_since:
            return not self._is_where_it_began(reported)
        if self.newest is None or isinstance(self.newest, VelocityTarget):
            return True
        return not self._is_ours(reported)

    def _is_where_it_began(self, reported: GlobalTarget) -> bool:
        """Whether it is the place that GUIDED begins with: a plane circles there."""
        first, began = self._state.mode_target, self._state.mode_place
        if not self._begins_at_a_place or first is None or began is None:
            return False
        place, reach = setpoint_in_force.place_of(first, self._state), NEAR + BEGUN_WITHIN * began.speed
        if place is None or _apart(GlobalTarget(*began.place, began.alt), place) > reach:
            return False
        return _are_alike(place, reported)

    def is_of_kind_in_force(self, target: Target) -> bool:
        """Whether the setpoint in force is known to be of the same kind as `target`: a place, or a velocity."""
        since = self._state.mode_since
        ours = self.newest if self.sent_at >= since else None
        before = setpoint_in_force.shown(self._state, max(self.sent_at, since)) or ours
        return before is not None and isinstance(before, VelocityTarget) == isinstance(target, VelocityTarget)

    # -- whether it is shown ------------------------------------------------------------------------------

    def look(self) -> bool:
        """Whether the autopilot has reported our place since it was sent. Call it at each report."""
        own = self._shown or self._expected
        reported = setpoint_in_force.shown(self._state, self.sent_at + (0.0 if own else TARGET_SHOWN))
        if not self.is_unshown or not isinstance(reported, GlobalTarget):
            return not self.is_unshown
        if not self._is_older(reported, ours_only=False) and self._is_ours(reported):
            self._shown, self.is_unshown = reported, False
        return not self.is_unshown

    def is_replaced_since(self, since: float) -> bool | None:
        """Whether the setpoint that it has reported since `since` (s) is an older one of ours; None for no report."""
        reported = setpoint_in_force.shown(self._state, since)
        return None if reported is None else not self.look() and self._is_older(reported)

    def due(self, reported: Reported | None) -> Target | None:
        """The setpoint that should be in force: the reported one, or our newer place that is not reported yet."""
        is_replaced = reported is not None and not self.look() and self._is_older(reported)
        return self.newest if is_replaced else reported

    @property
    def flies_elsewhere(self) -> bool:
        """Whether, long after our place was sent, it still flies to another place of ours, or at our velocity."""
        reported, own = setpoint_in_force.shown(self._state, self.sent_at + LATEST), self._shown or self._expected
        if self.look() or reported is None or not self._is_older(reported):
            return False
        return isinstance(reported, VelocityTarget) or (own is not None and _apart(own, reported) > SAME_PLACE)

    def _is_older(self, reported: Reported, *, ours_only: bool = True) -> bool:
        """Whether it is the very target that was in force before ours, and not the same place as ours."""
        own = self._shown or self._expected
        return any(
            _is_unchanged(target, reported) and not (own is not None and _is_unchanged(target, own))
            for _, target, is_ours in self._before
            if is_ours or not ours_only
        )

    def _reported(self) -> Reported | None:
        """The setpoint that the autopilot reports since ours must show; None without one."""
        self.look()
        since = max(self.sent_at + TARGET_SHOWN, self._state.mode_since)
        reported = setpoint_in_force.shown(self._state, since)
        if reported is None or (self.is_unshown and self._is_older(reported)):
            return None
        now = self._clock()
        is_late = any(now < at + LATEST and _are_alike(target, reported) for at, target, _ in self._before)
        return None if is_late else reported

    def _is_ours(self, reported: GlobalTarget) -> bool:
        """Whether a reported target is our newest one; the first report that is near ours counts as ours."""
        if self._shown is None:
            if self._expected is not None and _apart(self._expected, reported) > NEAR:
                return False
            self._shown = reported
        return _apart(self._shown, reported) <= SAME_PLACE


def place_of(target: NedTarget, state: VehicleState) -> GlobalTarget | None:
    """Roughly where a local target is, from the vehicle's own place in both frames; None without these.

    The vehicle has moved between the two messages.
    """
    local, position = state.local_position, state.position
    if local is None or position is None:
        return None
    later = position.boot_time - local.boot_time
    if abs(later) > SAME_MOMENT:
        return None
    there, here = (target.x, target.y, target.z), (local.north, local.east, local.down)
    north, east, down = (to - at - later * speed for to, at, speed in zip(there, here, local.velocity, strict=True))
    return GlobalTarget(*moved(*position.place, north, east), position.alt - down)


def _are_alike(one: Reported, other: Reported | None) -> bool:
    """Whether two reports are of the same setpoint."""
    if isinstance(one, GlobalTarget) and isinstance(other, GlobalTarget):
        return _apart(one, other) <= SAME_PLACE
    if isinstance(one, VelocityTarget) and isinstance(other, VelocityTarget):
        return math.dist((one.vx, one.vy, one.vz), (other.vx, other.vy, other.vz)) <= SAME_SPEED
    return False


def _is_unchanged(one: Reported, other: Reported) -> bool:
    """Whether a report repeats a setpoint, as exactly as an autopilot does."""
    if isinstance(one, GlobalTarget) and isinstance(other, GlobalTarget):
        return max(_apart(one, other), abs(one.alt - other.alt)) <= UNCHANGED
    return _are_alike(one, other)


def _speed(velocity: VelocityTarget) -> float:
    return math.hypot(velocity.vx, velocity.vy, velocity.vz)


def _apart(one: GlobalTarget, other: GlobalTarget) -> float:
    """Metres between two places, on the axis where they are farther apart."""
    return max(*map(abs, offset(one.lat, one.lon, other.lat, other.lon)))
