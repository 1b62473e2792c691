"""The whole mission: take off, fly to a place, land there, on the tag or without one."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mavproxy_uavapi.errors import Invalid
from mavproxy_uavapi.vehicle.geodesy import METRES_PER_DEGREE
from mavproxy_uavapi.vehicle.messages import GlobalTarget
from mavproxy_vision.flight import Flight


@dataclass(frozen=True)
class Errand:
    """Where to go.

    Attributes:
        alt: m above home.
        north, east: m from home; None with lat and lon.
        lat, lon: degrees; None with north and east.
        tag: id to land on; None for the settings' main tag.
        on_tag: whether to land on a tag at all.
        method: how to land on it.
    """

    alt: float = 5.0
    north: float | None = None
    east: float | None = None
    lat: float | None = None
    lon: float | None = None
    tag: int | None = None
    on_tag: bool = True
    method: str = "velocity"


async def fly(flight: Flight, errand: Errand) -> None:
    """Arm, take off, fly there, land; done when disarmed there.

    A vehicle that flies already in GUIDED goes there from where it is.

    Raises:
        LandingFailed: not landed on the tag; the settings' `on_failure` was done.
        UavApiError: as the copter's verbs.
    """
    vehicle, job = flight.vehicle, flight.job
    if errand.on_tag:
        flight.vision.require_camera()
    if not vehicle.state.armed or vehicle.state.landed is not False:
        await vehicle.arm(job)
        await vehicle.takeoff(job, errand.alt)
    place = await _place(flight, errand)
    vehicle.held_by("GUIDED")
    await vehicle.go_to(job, place, wait=True)
    vehicle.held_by("GUIDED")
    if errand.on_tag:
        await flight.land(errand.tag, errand.method)
    else:
        await vehicle.land(job)


async def _place(flight: Flight, errand: Errand) -> GlobalTarget:
    if errand.lat is not None and errand.lon is not None:
        return GlobalTarget(errand.lat, errand.lon, errand.alt)
    if errand.north is None or errand.east is None:
        raise Invalid("a mission needs north and east, or lat and long", "body")
    home = await flight.vehicle.home()
    lat, lon = home.latitude / 1e7, home.longitude / 1e7
    north = errand.north / METRES_PER_DEGREE
    east = errand.east / (METRES_PER_DEGREE * math.cos(math.radians(lat)))
    return GlobalTarget(lat + north, lon + east, errand.alt)
