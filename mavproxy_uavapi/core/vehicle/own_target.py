"""Which setpoint a vehicle flies in GUIDED: our newest one, or another station's. Pure: the clock is an argument."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from mavproxy_uavapi.core.errors import Superseded
from mavproxy_uavapi.core.geodesy import moved, offset
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle import setpoint_in_force
from mavproxy_uavapi.core.vehicle.messages import GlobalTarget, NedTarget, Target, VelocityTarget

TARGET_SHOWN = 2.0  # s after a setpoint, until which telemetry does not count
LATEST = 8.0  # s after a setpoint, until which a slow link or a busy MAVProxy may still report those before it
SAME_PLACE = 2.0  # m on each axis: reported targets within this are the same
SAME_SPEED = 0.5  # m/s: reported velocities within this are the same
SAME_MOMENT = 3.0  # s between two messages, in which a vehicle does not change its velocity much
NEAR_EXPECTED = 10.0  # m on each axis: our target in the local frame, whose origin the autopilot does not tell

Reported = GlobalTarget | VelocityTarget


class OwnTarget:
    """Our newest setpoint, and whether the autopilot reports it.

    Attributes:
        newest: the setpoint; None before the first.
        sent_at: when it was sent (s).

    Args:
        state: the vehicle's state.
        clock: monotonic seconds.
    """

    def __init__(self, state: VehicleState, clock: Callable[[], float]) -> None:
        self.newest: Target | None = None
        self.sent_at = 0.0
        self._state, self._clock = state, clock
        self._shown: GlobalTarget | None = None  # our target as the autopilot reports it
        self._expected: GlobalTarget | None = None  # where it will report our target in the local frame, about
        self._earlier: deque[tuple[float, Reported]] = deque()  # what it flew before, and when that was replaced (s)

    def sent(self, target: Target) -> None:
        """Remember the setpoint that went out last."""
        self._replace(setpoint_in_force.shown(self._state, self._state.mode_since))
        self._replace(self.newest if isinstance(self.newest, VelocityTarget) else self._shown or self._expected)
        self.newest, self.sent_at = target, self._clock()
        self._shown = target if isinstance(target, GlobalTarget) else None
        self._expected = place_of(target, self._state) if isinstance(target, NedTarget) else None

    def _replace(self, target: Reported | None) -> None:
        """Remember what may still be reported though a newer setpoint is on its way."""
        now = self._clock()
        while self._earlier and now >= self._earlier[0][0] + LATEST:
            self._earlier.popleft()
        if self._earlier and _are_alike(self._earlier[-1][1], target):
            self._earlier.pop()  # many clients repeat their setpoint
        if target is not None:
            self._earlier.append((now, target))

    def require(self) -> None:
        """Raise Superseded if the autopilot reports another target than ours, or a velocity."""
        reported = self._reported()
        if reported is None:
            return
        if isinstance(reported, GlobalTarget) and self._is_ours(reported):
            return
        raise Superseded("another ground station gave the vehicle another target")

    @property
    def is_foreign(self) -> bool:
        """Whether the autopilot reports another target or velocity than the newest of ours."""
        reported = self._reported()
        if reported is None:
            return False
        if isinstance(reported, VelocityTarget):
            own = _speed(self.newest) if isinstance(self.newest, VelocityTarget) else 0.0
            return _speed(reported) > SAME_SPEED and abs(_speed(reported) - own) > SAME_SPEED
        if self.newest is None or isinstance(self.newest, VelocityTarget):
            return True
        return not self._is_ours(reported)

    def is_of_kind_in_force(self, target: Target) -> bool:
        """Whether the setpoint in force is known to be of the same kind as `target`: a place, or a velocity."""
        since = self._state.mode_since
        ours = self.newest if self.sent_at >= since else None
        before = setpoint_in_force.shown(self._state, max(self.sent_at, since)) or ours
        return before is not None and isinstance(before, VelocityTarget) == isinstance(target, VelocityTarget)

    def _reported(self) -> Reported | None:
        """The setpoint that the autopilot reports since ours must show; None without one."""
        reported = setpoint_in_force.shown(self._state, self.sent_at + TARGET_SHOWN)
        now = self._clock()
        is_late = any(now < at + LATEST and _are_alike(earlier, reported) for at, earlier in self._earlier)
        return None if is_late else reported

    def _is_ours(self, reported: GlobalTarget) -> bool:
        """Whether a reported target is our newest one; the first report that is near ours counts as ours."""
        if self._shown is None:
            if self._expected is not None and _apart(self._expected, reported) > NEAR_EXPECTED:
                return False
            self._shown = reported
        return _apart(self._shown, reported) <= SAME_PLACE


def place_of(target: NedTarget, state: VehicleState) -> GlobalTarget | None:
    """About where a target in the local frame is, by the vehicle's own place in both frames; None without these.

    The vehicle has moved between the two messages.
    """
    local, place = state.messages.get("LOCAL_POSITION_NED"), state.messages.get("GLOBAL_POSITION_INT")
    if local is None or place is None:
        return None
    here, there = local.message, place.message
    later = (there.time_boot_ms - here.time_boot_ms) / 1000.0  # s
    if abs(later) > SAME_MOMENT:
        return None
    north = target.x - here.x - later * here.vx
    east = target.y - here.y - later * here.vy
    down = target.z - here.z - later * here.vz
    lat, lon = moved(there.lat / 1e7, there.lon / 1e7, north, east)
    return GlobalTarget(lat, lon, there.relative_alt / 1000.0 - down)


def _are_alike(one: Reported, other: Reported | None) -> bool:
    """Whether two reports are of the same setpoint."""
    if isinstance(one, GlobalTarget) and isinstance(other, GlobalTarget):
        return _apart(one, other) <= SAME_PLACE
    if isinstance(one, VelocityTarget) and isinstance(other, VelocityTarget):
        return math.dist((one.vx, one.vy, one.vz), (other.vx, other.vy, other.vz)) <= SAME_SPEED
    return False


def _speed(velocity: VelocityTarget) -> float:
    return math.hypot(velocity.vx, velocity.vy, velocity.vz)


def _apart(one: GlobalTarget, other: GlobalTarget) -> float:
    """Metres between two places, on the axis where they are farther apart."""
    return max(*map(abs, offset(one.lat, one.lon, other.lat, other.lon)))
