"""Makes the form that the ground station takes from a vehicle's state. Pure: the clock is an argument.

Field names, order and units are those of the GrADyS ground station (its POST /update-info/): lat and lng in degrees,
alt in m above home, speeds in m/s, heading in degrees. The station answers 500 to a field that is not a number, and
passes NaN on as invalid JSON. So unknown fields are left out, and without a position nothing is sent.
"""

from __future__ import annotations

import math
from urllib.parse import urlencode

from mavproxy_gradys.position import VehiclePosition
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

DEVICE = "uav"
LOCATION = 102  # the station's type number of a position update
SPEED_DIGITS = 3  # a single-precision float has fewer at these magnitudes


def form(
    state: VehicleState, position: VehiclePosition, now: float, *, seq: int, ip: str, ready: bool, max_age: float
) -> dict[str, str]:
    """The form's fields as text, in the order in which the station's own clients send them.

    Args:
        state, now, max_age: as for `position_of`.
        position: the result of `position_of`.
        seq: number of this update; it advances when the station has acknowledged.
        ip: HOST:PORT/ of the API.
        ready: whether the vehicle is ready to arm.
    """
    return {
        "id": str(state.system),
        "lat": str(position.lat),
        "lng": str(position.lng),
        "alt": str(position.alt),
        **motion(state, now, max_age),
        **battery(state, now, max_age),
        "ready_to_arm": str(ready),
        "device": DEVICE,
        "type": str(LOCATION),
        "seq": str(seq),
        "ip": ip,
    }


def motion(state: VehicleState, now: float, max_age: float) -> dict[str, str]:
    """ground_speed, air_speed and heading from VFR_HUD; without it, those that GLOBAL_POSITION_INT has."""
    age = state.age("VFR_HUD", now)
    if age is not None and age <= max_age:
        hud = state.messages["VFR_HUD"].message
        speeds = {"ground_speed": hud.groundspeed, "air_speed": hud.airspeed}
        known = {name: str(round(speed, SPEED_DIGITS)) for name, speed in speeds.items() if math.isfinite(speed)}
        return {**known, "heading": str(hud.heading)}
    position = state.position
    if position is None:
        return {}
    fields = {"ground_speed": str(round(math.hypot(*position.velocity[:2]), SPEED_DIGITS))}
    if position.heading is not None:
        fields["heading"] = str(round(position.heading))
    return fields


def battery(state: VehicleState, now: float, max_age: float) -> dict[str, str]:
    """battery_percent from SYS_STATUS; none if the autopilot does not measure it (-1 in MAVLink)."""
    age = state.age("SYS_STATUS", now)
    if age is None or age > max_age:
        return {}
    left = state.messages["SYS_STATUS"].message.battery_remaining
    return {} if left < 0 else {"battery_percent": str(left)}


def encode(fields: dict[str, str]) -> bytes:
    """The body, application/x-www-form-urlencoded."""
    return urlencode(fields).encode("ascii")
