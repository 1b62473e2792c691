"""Where a vehicle is, where that can be told at all. Pure: the clock is an argument."""

from __future__ import annotations

from dataclasses import dataclass

from pymavlink import mavutil

from mavproxy_gradys.errors import NoFix
from mavproxy_uavapi.core.errors import LinkLost, Stale
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState

mavlink = mavutil.mavlink

RECEIVERS = ("GPS_RAW_INT", "GPS2_RAW")


@dataclass(frozen=True)
class Position:
    """Where a vehicle is: degrees, m above home, and the age of that (s)."""

    lat: float
    lng: float
    alt: float
    age: float


def position_of(
    state: VehicleState, now: float, *, max_age: float, link_timeout: float, has_position: bool
) -> Position:
    """The vehicle's position, if there is one to tell.

    Args:
        state: the vehicle's.
        now: on the clock of arrivals (s).
        max_age: s after which a position is too old to be told as new.
        link_timeout: s without a heartbeat after which the link is lost.
        has_position: its estimator's word, for a vehicle without a satellite receiver.

    Raises:
        LinkLost, Stale, NoFix: there is none; the text says why.
    """
    silent_for = now - state.heartbeat_at
    if silent_for >= link_timeout:
        raise LinkLost.since(state.system, silent_for)
    received = state.messages.get("GLOBAL_POSITION_INT")
    if received is None:
        raise Stale(f"vehicle {state.system} has not told its position yet")
    age = now - received.at
    if age > max_age:
        raise Stale(f"the position of vehicle {state.system} is {age:.1f} s old")
    require_fix(state, now, max_age, has_position)
    told = received.message
    if not (told.lat or told.lon) or abs(told.lat) > 90e7 or abs(told.lon) > 180e7:
        raise NoFix(f"vehicle {state.system} does not know where it is")
    return Position(told.lat / 1e7, told.lon / 1e7, told.relative_alt / 1000, age)


def require_fix(state: VehicleState, now: float, max_age: float, has_position: bool) -> None:
    """Raises NoFix unless a receiver that tells has a 3D fix, or there is none and the estimator has a position."""
    ages = {name: state.age(name, now) for name in RECEIVERS}
    told = [state.field(name, "fix_type") for name, age in ages.items() if age is not None and age <= max_age]
    fixes = [fix for fix in told if fix not in (None, mavlink.GPS_FIX_TYPE_NO_GPS)]
    fixed = max(fixes) >= mavlink.GPS_FIX_TYPE_3D_FIX if fixes else has_position
    if not fixed:
        raise NoFix(f"vehicle {state.system} has no position fix")
