"""The position of a vehicle, if it is known. Pure: the clock is an argument."""

from __future__ import annotations

from dataclasses import dataclass

from pymavlink import mavutil

from mavproxy_gradys.errors import NoFix
from mavproxy_uavapi.core.errors import LinkLost, Stale
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

mavlink = mavutil.mavlink

RECEIVERS = ("GPS_RAW_INT", "GPS2_RAW")


@dataclass(frozen=True)
class VehiclePosition:
    """A vehicle's position: degrees, m above home, and its age (s)."""

    lat: float
    lng: float
    alt: float
    age: float


def position_of(
    state: VehicleState, now: float, *, max_age: float, link_timeout: float, has_position: bool
) -> VehiclePosition:
    """The vehicle's position, if it is known.

    Args:
        state: the vehicle's state.
        now: s, on the clock of arrivals.
        max_age: s after which a position is too old to be sent as new.
        link_timeout: s without a heartbeat after which the link is lost.
        has_position: whether the estimator has a position, for a vehicle without a satellite receiver.

    Raises:
        LinkLost, Stale, NoFix: there is no position; the text gives the reason.
    """
    silent_for = now - state.heartbeat_at
    if silent_for >= link_timeout:
        raise LinkLost.since(state.system, silent_for)
    received = state.messages.get("GLOBAL_POSITION_INT")
    if received is None:
        raise Stale(f"vehicle {state.system} has not reported its position yet")
    age = now - received.at
    if age > max_age:
        raise Stale(f"the position of vehicle {state.system} is {age:.1f} s old")
    require_fix(state, now, max_age, has_position)
    here = GlobalPosition.of(received.message)
    if not any(here.place) or abs(here.lat) > 90 or abs(here.lon) > 180:
        raise NoFix(f"vehicle {state.system} does not know where it is")
    return VehiclePosition(here.lat, here.lon, here.alt, age)


def require_fix(state: VehicleState, now: float, max_age: float, has_position: bool) -> None:
    """Raise NoFix unless a receiver reports a 3D fix, or without a receiver the estimator has a position."""
    ages = {name: state.age(name, now) for name in RECEIVERS}
    fix_types = [state.field(name, "fix_type") for name, age in ages.items() if age is not None and age <= max_age]
    fixes = [fix for fix in fix_types if fix not in (None, mavlink.GPS_FIX_TYPE_NO_GPS)]
    fixed = max(fixes) >= mavlink.GPS_FIX_TYPE_3D_FIX if fixes else has_position
    if not fixed:
        raise NoFix(f"vehicle {state.system} has no position fix")
