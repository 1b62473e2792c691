"""The setpoint in GUIDED as the autopilot reports it: others may have sent it a newer one than ours.

POSITION_TARGET_GLOBAL_INT reports a position; ArduCopter sends it only while it flies to one.
POSITION_TARGET_LOCAL_NED reports a velocity. Its position is not used: during a takeoff, and until the first setpoint
after it, that position is outdated.
"""

from __future__ import annotations

import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import TimedOut
from mavproxy_uavapi.core.geodesy import from_deg_e7
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.link.message_waiter import MessageWaiter
from mavproxy_uavapi.core.link.messages import (
    MESSAGE_IDS,
    POSITION_IGNORED,
    VELOCITY_IGNORED,
    GlobalTarget,
    VelocityTarget,
    request_message,
)
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState, is_finite

mavlink = mavutil.mavlink

PLACE, MOTION = "POSITION_TARGET_GLOBAL_INT", "POSITION_TARGET_LOCAL_NED"
TIMEOUT = 1.0  # s for the first of the two; more on a slow link
LATER = 0.5  # s for the second


async def ask(
    state: VehicleState, waiting: MessageWaiter, post: Callable[[Any], Awaitable[None]]
) -> GlobalTarget | VelocityTarget | None:
    """Ask for the setpoint in force; None without an answer, or if it is neither a position nor a velocity.

    Raises:
        LinkLost: its heartbeats stopped.
    """

    def from_autopilot(message: Any) -> Any:
        return message if message.get_srcComponent() == state.component else None

    address = Address(state.system, state.component)
    with waiting.expecting({MOTION}, from_autopilot) as motion, waiting.expecting({PLACE}, from_autopilot) as place:
        for name in (PLACE, MOTION):
            await post(request_message(MESSAGE_IDS[name]).to(address, 0))
        with contextlib.suppress(TimedOut):
            velocity = velocity_of(await motion.within(state.trip.at_least(TIMEOUT), f"report {MOTION}"))
            return velocity or place_of(await place.within(LATER, f"report {PLACE}"), state)
    return None


def velocity_of(message: Any) -> VelocityTarget | None:
    """The velocity of a POSITION_TARGET_LOCAL_NED that has nothing else."""
    mask = message.type_mask & (POSITION_IGNORED | VELOCITY_IGNORED)
    if mask != POSITION_IGNORED or message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED or not is_finite(message):
        return None
    return VelocityTarget(message.vx, message.vy, message.vz)


def place_of(message: Any, state: VehicleState) -> GlobalTarget | None:
    """The place of a POSITION_TARGET_GLOBAL_INT, above home; None where home's altitude is not known."""
    here = state.position
    if here is None or message.coordinate_frame != mavlink.MAV_FRAME_GLOBAL or not is_finite(message):
        return None
    return GlobalTarget(from_deg_e7(message.lat_int), from_deg_e7(message.lon_int), message.alt - here.home_msl)


def shown(state: VehicleState, since: float) -> GlobalTarget | VelocityTarget | None:
    """The setpoint that the autopilot has reported since `since` (s) without a request."""
    place, motion = state.messages.get(PLACE), state.messages.get(MOTION)
    if place is not None and place.at > since and (motion is None or place.at >= motion.at or not _moves(motion)):
        return place_of(place.message, state)
    return velocity_of(motion.message) if motion is not None and motion.at > since else None


def _moves(motion: Any) -> bool:
    return velocity_of(motion.message) is not None
