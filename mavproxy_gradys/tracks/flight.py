"""Flies a track: a job that uses the copter's own verbs, with all their checks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from mavproxy_gradys.tracks.formats import TrackWaypoint
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Invalid, NotSupported
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.link.messages import GlobalTarget
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

VERB = "/mission/fly-track"
TOLERANCE = 1.0  # m
REACH = 10_000.0  # m; the largest distance of a waypoint from the vehicle's position at the start
LARGEST_REACH = 100_000.0  # m
TRANSIT = 10.0  # m above home; the lowest altitude on the way to a first waypoint that is not near
LOWEST_TRANSIT = 2.0  # m
HIGHEST_TAKEOFF = 500.0  # m above home, as for `takeoff`
NEAR = 5.0  # m


class TrackFlight:
    """The flight of a track.

    Attributes:
        leg: number of the present leg, from 1; 0 before the first.
        stage: `arming`, `taking off`, `approaching`, `flying`, `returning`, `done`.

    Args:
        copter: the vehicle.
        places: the waypoints.
        transit: m above home; the lowest altitude on the way to a first waypoint that is not near.
    """

    def __init__(self, copter: Copter, places: Sequence[TrackWaypoint], transit: float = TRANSIT) -> None:
        self.copter = copter
        self.places = list(places)
        self.transit = transit
        self.leg = 0
        self.stage = "arming"
        self.job: Job | None = None

    async def fly(self, job: Job) -> str:
        """Take off if necessary, fly every leg, return and land; returns the result text.

        Raises:
            UavApiError: as the verbs `arm`, `takeoff`, `go_to` and `rtl`; nothing more is sent then.
        """
        self.job = job
        self._enter("arming")
        if self.copter.state.armed is False or self.copter.state.landed:
            await self.copter.arm(job)
            self._enter("taking off")
            await self.copter.takeoff(job, min(self._approach_height(), HIGHEST_TAKEOFF))
        await self._approach(job)
        for place in self.places:
            self.leg += 1
            self._enter("flying")
            await self._go_to(job, place.lat, place.lon, place.alt)
        self._enter("returning")
        await self.copter.wait_for_heartbeat()  # a pilot may have taken it since the last heartbeat
        self.copter.held_by("GUIDED")
        await self.copter.rtl(job)
        self._enter("done")
        return self.result

    @property
    def result(self) -> str:
        """The result text of a success."""
        return f"Flew {len(self.places)} legs and landed at home"

    async def _approach(self, job: Job) -> None:
        """Fly above the first waypoint: a recording begins on the ground, and there may be trees on the way."""
        if self._is_near():
            return
        self._enter("approaching")
        here, first = self.copter.position(), self.places[0]
        height = max(self._approach_height(), self.copter.height)
        if height - self.copter.height > TOLERANCE:
            await self._go_to(job, *here.place, height)
        await self._go_to(job, first.lat, first.lon, height)

    async def _go_to(self, job: Job, lat: float, lon: float, alt: float) -> None:
        await self.copter.go_to(job, GlobalTarget(lat, lon, alt), wait=True, tolerance=TOLERANCE)

    def _approach_height(self) -> float:
        """The height (m above home) of the flight to the first waypoint."""
        first = self.places[0].alt
        return first if self._is_near() else max(first, self.transit)

    def _is_near(self) -> bool:
        return distance_to(self.copter, self.places[0]) <= NEAR

    def _enter(self, stage: str) -> None:
        self.stage = stage
        if self.job is not None:
            self.job.stage = {"stage": stage, "leg": self.leg, "legs": len(self.places)}

    @property
    def running(self) -> bool:
        """Whether it is in flight."""
        return self.job is not None and self.job.running

    def report(self) -> dict[str, Any]:
        """The report for the status."""
        job = self.job
        state = "waiting" if job is None else "running" if job.running else "failed" if job.error else "done"
        return {
            "vehicle": self.copter.state.system,
            "job": None if job is None else job.id,
            "state": state,
            "error": str(job.error) if job is not None and job.error else None,
            "stage": self.stage,
            "leg": self.leg,
            "legs": len(self.places),
            **({} if job is None else job.progress),
        }


def flight_of(
    vehicle: Vehicle, places: Sequence[TrackWaypoint], reach: float, transit: float = TRANSIT
) -> TrackFlight:
    """A flight through those waypoints; they are checked before anything is sent.

    Args:
        vehicle: the vehicle.
        places: the waypoints.
        reach: the largest distance (m) of a waypoint from the vehicle.
        transit: as for `TrackFlight`.

    Raises:
        NotSupported: the vehicle is not a copter.
        Invalid: a waypoint is farther away.
        OutsideEnvelope: a leg leaves the envelope.
        Stale: the vehicle does not report its position.
    """
    if not isinstance(vehicle, Copter):
        raise NotSupported(f"a {vehicle.kind} does not fly tracks")
    for number, place in enumerate(places, 1):
        metres = distance_to(vehicle, place)
        if not metres <= reach:
            raise Invalid(f"waypoint {number} of the track is {metres:.0f} m away; `reach` is {reach:g} m", "track")
    vehicle.require_route([GlobalTarget(place.lat, place.lon, place.alt) for place in places])
    return TrackFlight(vehicle, places, transit)


def distance_to(vehicle: Vehicle, place: TrackWaypoint) -> float:
    """Horizontal metres from a vehicle to a waypoint.

    Raises:
        Stale: the vehicle does not report its position.
    """
    return math.hypot(*offset(*vehicle.position().place, place.lat, place.lon))
