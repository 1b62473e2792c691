"""What the tests of the verbs share: targets, and that a vehicle is left alone."""

from __future__ import annotations

from typing import Any

from mavproxy_uavapi.core.link.messages import NedTarget
from tests.support.virtual_time import FastLoop

FAR = NedTarget(200.0, 0.0, -20.0)
STILL = (0.0, 0.0, 0.0)


def nothing_more(loop: FastLoop, drone: Any) -> None:
    """Nothing but questions is sent for a long while."""
    before = len(drone.orders())
    loop.pass_time(30.0)
    assert drone.orders()[before:] == []


def place(drone: Any, north: float, east: float) -> tuple[float, float]:
    """Latitude and longitude (degrees) of a place so many m north and east of home."""
    lat, lon = drone.place((north, east))
    return lat / 1e7, lon / 1e7
