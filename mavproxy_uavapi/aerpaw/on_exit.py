"""What a vehicle does when its script has ended, or died."""

from __future__ import annotations

import logging

from mavproxy_uavapi.aerpaw.vehicle import Vehicle
from mavproxy_uavapi.client.drone import Drone
from mavproxy_uavapi.client.places import Ned
from mavproxy_uavapi.core.errors import UavApiError

log = logging.getLogger("aerpawlib")

GUIDED = "GUIDED"
HELD_FOR = 1.0  # s of zero velocities; in GUIDED it stays where they end


async def see_to(vehicle: Vehicle, policy: str) -> bool:
    """Do as `policy` says (rtl, land, hold, nothing) with an armed vehicle that the script has commanded.

    In another mode than GUIDED it is its pilot's, or on its way down, and left alone; on the ground it is disarmed.

    Returns:
        Whether nothing is left to be done.
    """
    if policy == "nothing" or not vehicle.has_commanded:
        return True
    try:
        return await vehicle.run_last(lambda drone: _see_to(vehicle, drone, policy))
    except (UavApiError, OSError) as error:
        log.error("the script has ended, and %s failed: %s", policy, error)
        return False


async def _see_to(vehicle: Vehicle, drone: Drone, policy: str) -> bool:
    status = await drone.status()
    if not status.armed:
        return True
    if status.mode != GUIDED:
        log.warning("the script has ended; the vehicle is in %s, and is left alone", status.mode)
        return True
    if vehicle.hovers and status.landed_state == "on_ground":
        log.warning("the script has ended; the vehicle is disarmed")
        await drone.disarm()
        return True
    log.warning("the script has ended with the vehicle under way: %s", policy)
    if policy == "rtl":
        await drone.rtl(outlive=True)
    elif not vehicle.hovers:
        await drone.stop()
    elif policy == "land":
        await drone.land(outlive=True)
    else:
        await drone.travel(Ned(), HELD_FOR)
    return True
