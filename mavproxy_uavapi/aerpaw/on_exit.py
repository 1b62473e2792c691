"""Applies `--on-exit`: what a vehicle does when its script has ended or failed."""

from __future__ import annotations

import logging

from mavproxy_uavapi.aerpaw.vehicle import Vehicle
from mavproxy_uavapi.client.drone import Drone
from mavproxy_uavapi.client.places import Ned
from mavproxy_uavapi.core.errors import UavApiError

log = logging.getLogger("aerpawlib")

GUIDED = "GUIDED"
SWITCHES = (
    "/command/set_mode",
    "/command/land",
    "/command/rtl",
    "/command/brake",
    "/movement/stop",
    "/mission/start",
)
HOLD_DURATION = 1.0  # s of zero velocities; afterwards it stays there in GUIDED


async def apply_policy(vehicle: Vehicle, policy: str, why: str = "the script has ended") -> bool:
    """Apply `policy` (rtl, land, hold, nothing) to an armed vehicle that the script has commanded.

    In another mode than GUIDED the pilot has the vehicle, or it is landing, so nothing is done; nor where another
    client has superseded the script, or its switch is on its way: either may be why the script has ended. A vehicle
    on the ground is disarmed.

    Returns:
        Whether it succeeded.
    """
    if policy == "nothing" or not vehicle.has_commanded:
        return True
    try:
        return await vehicle.run_last(lambda drone: _apply(vehicle, drone, policy, why))
    except (UavApiError, OSError) as error:
        log.error("%s, and %s failed: %s", why, policy, error)
        return False


async def _apply(vehicle: Vehicle, drone: Drone, policy: str, why: str) -> bool:
    status = await drone.status()
    if not status.armed:
        return True
    if status.mode != GUIDED:
        log.warning("%s; the vehicle is in %s, so nothing is done", why, status.mode)
        return True
    if vehicle.is_superseded:
        log.warning("%s; another client has the vehicle, so nothing is done", why)
        return True
    command = await drone.command()
    if command is not None and command.verb in SWITCHES:
        log.warning("%s; %s has the vehicle, so nothing is done", why, command.verb)
        return True
    if vehicle.hovers and status.landed_state == "on_ground":
        log.warning("%s; the vehicle is disarmed", why)
        await drone.disarm()
        return True
    log.warning("%s while the vehicle moves: %s", why, policy)
    if policy == "rtl":
        await drone.rtl(outlive=True)
    elif not vehicle.hovers:
        await drone.stop()
    elif policy == "land":
        await drone.land(outlive=True)
    else:
        await drone.travel(Ned(), HOLD_DURATION)
    return True
