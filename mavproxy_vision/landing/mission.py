"""The whole mission: take off, fly to a place, and land there, with or without a tag."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE
from mavproxy_uavapi.core.link.messages import GlobalTarget
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_vision.landing.descent import Descent
from mavproxy_vision.landing.executor import TagFlight
from mavproxy_vision.landing.plan import landable


@dataclass(frozen=True)
class MissionPlan:
    """The place and kind of the landing.

    Attributes:
        alt: m above home.
        north, east: m from home; None with lat and lon.
        lat, lon: degrees; None with north and east.
        tag: id to land on; None for the settings' main tag.
        on_tag: whether to land on a tag.
        method: the landing method.
    """

    alt: float = 5.0
    north: float | None = None
    east: float | None = None
    lat: float | None = None
    lon: float | None = None
    tag: int | None = None
    on_tag: bool = True
    method: str = "velocity"

    def place(self, home: tuple[float, float]) -> tuple[float, float]:
        """Latitude and longitude (degrees); `home` is latitude and longitude of home.

        Raises:
            Invalid: neither metres nor degrees are given.
        """
        if self.lat is not None and self.lon is not None:
            return self.lat, self.lon
        if self.north is None or self.east is None:
            raise Invalid("a mission needs north and east, or lat and long")
        lat, lon = home
        longitude = lon + self.east / (METRES_PER_DEGREE * math.cos(math.radians(lat)))
        return lat + self.north / METRES_PER_DEGREE, (longitude + 180.0) % 360.0 - 180.0


async def _require_inside(vehicle: Copter, plan: MissionPlan, grounded: bool) -> None:
    """Raise OutsideEnvelope unless the climb and the way there stay in the envelope."""
    home = await vehicle.home()
    destination = plan.place(home.place)
    climb = [GlobalTarget(*vehicle.position().place, plan.alt)] if grounded else []
    vehicle.require_route([*climb, GlobalTarget(*destination, plan.alt)])


async def fly(flight: TagFlight, plan: MissionPlan, descent_method: Callable[[TagFlight], Descent]) -> None:
    """Arm, take off, fly there, land; done when disarmed there.

    A vehicle that already flies in GUIDED starts from its position.

    Raises:
        LandingFailed: not landed on the tag; the setting `on_failure` was applied.
        UavApiError: as the copter's verbs.
    """
    vehicle, job = flight.vehicle, flight.job
    grounded = not vehicle.state.armed or vehicle.state.landed is not False
    if plan.on_tag:
        flight.tracker.require_camera()
        landable(flight.tracker.settings, plan.tag)
        await descent_method(flight).prepare()
    if not grounded:
        vehicle.require_guided_flight()
    if vehicle.guard.in_force:
        await _require_inside(vehicle, plan, grounded)
    await flight.take_over()
    if grounded:
        await vehicle.arm(job)
        await vehicle.takeoff(job, plan.alt)
    home = await vehicle.home()
    lat, lon = plan.place(home.place)
    vehicle.held_by("GUIDED")
    if flight.tracker.settings.mission_speed:
        await vehicle.set_speed(job, "ground", flight.tracker.settings.mission_speed)
    await vehicle.go_to(job, GlobalTarget(lat, lon, plan.alt), wait=True)
    vehicle.held_by("GUIDED")
    if plan.on_tag:
        await flight.land(plan.tag, plan.method, descent_method)
    else:
        await flight.wait_for_heartbeat()
        await flight.fly_by("LAND", vehicle.land)
