"""State -> the fields of the form that the ground station takes. Pure: the clock is an argument.

Field names, order and units are the ground station's (http-contract, "The Gradys ground station"): lat and
lng in degrees, alt in m above home, speeds in m/s, heading in degrees. The station answers 500 to a field that
is no number, and passes NaN on as invalid JSON: what is unknown is left out, and without a position nothing is
said at all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from urllib.parse import urlencode

from pymavlink import mavutil

from mavproxy_gradys.errors import NoFix
from mavproxy_uavapi.core.errors import LinkLost, Stale
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState

mavlink = mavutil.mavlink

DEVICE = "uav"
LOCATION = 102  # the station's number for "where a vehicle is"
SPEED_DIGITS = 3  # more than a float of the link carries at these magnitudes
RECEIVERS = ("GPS_RAW_INT", "GPS2_RAW")


@dataclass(frozen=True)
class Position:
    """Where a vehicle is: degrees, m above home, and the age of that (s)."""

    lat: float
    lng: float
    alt: float
    age: float


def position(state: VehicleState, now: float, *, max_age: float, link_timeout: float, has_position: bool) -> Position:
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


def form(
    state: VehicleState, where: Position, now: float, *, seq: int, ip: str, ready: bool, max_age: float
) -> dict[str, str]:
    """The form's fields as text, in the order in which the station's own clients send them.

    Args:
        state, now, max_age: as `position`.
        where: what `position` gave.
        seq: number of this update; it advances when the station has acknowledged.
        ip: HOST:PORT/ of the API.
        ready: whether the vehicle is ready to be armed.
    """
    return {
        "id": str(state.system),
        "lat": str(where.lat),
        "lng": str(where.lng),
        "alt": str(where.alt),
        **motion(state, now, max_age),
        **battery(state, now, max_age),
        "ready_to_arm": str(ready),
        "device": DEVICE,
        "type": str(LOCATION),
        "seq": str(seq),
        "ip": ip,
    }


def motion(state: VehicleState, now: float, max_age: float) -> dict[str, str]:
    """ground_speed, air_speed, heading by VFR_HUD; without it, what GLOBAL_POSITION_INT knows of them."""
    age = state.age("VFR_HUD", now)
    if age is not None and age <= max_age:
        hud = state.messages["VFR_HUD"].message
        speeds = {"ground_speed": hud.groundspeed, "air_speed": hud.airspeed}
        known = {name: str(round(speed, SPEED_DIGITS)) for name, speed in speeds.items() if math.isfinite(speed)}
        return {**known, "heading": str(hud.heading)}
    told = state.messages["GLOBAL_POSITION_INT"].message
    found = {"ground_speed": str(round(math.hypot(told.vx, told.vy) / 100, SPEED_DIGITS))}
    if told.hdg != 65535:
        found["heading"] = str(round(told.hdg / 100))
    return found


def battery(state: VehicleState, now: float, max_age: float) -> dict[str, str]:
    """battery_percent by SYS_STATUS; none where the autopilot does not measure it, which MAVLink tells as -1."""
    age = state.age("SYS_STATUS", now)
    if age is None or age > max_age:
        return {}
    left = state.messages["SYS_STATUS"].message.battery_remaining
    return {} if left < 0 else {"battery_percent": str(left)}


def encode(fields: dict[str, str]) -> bytes:
    """The body, application/x-www-form-urlencoded."""
    return urlencode(fields).encode("ascii")
