"""A client of the HTTP API: asyncio, typed.

async with connect("http://127.0.0.1:8000") as drone:
    await drone.arm()
    await drone.takeoff(10)
    await drone.go_to(drone.position + Ned(10, 0, 0))
    await drone.land()
"""

from mavproxy_uavapi.client.drone import Drone, connect
from mavproxy_uavapi.client.errors import Unreachable
from mavproxy_uavapi.client.fleet import Fleet, connect_fleet
from mavproxy_uavapi.client.logs import Log
from mavproxy_uavapi.client.places import Ned, Position
from mavproxy_uavapi.core.errors import UavApiError

__all__ = ["Drone", "Fleet", "Log", "Ned", "Position", "UavApiError", "Unreachable", "connect", "connect_fleet"]
