"""Flying a track: a job made of the copter's own verbs, and so by the rules of the air."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mavproxy_gradys.tracks import Waypoint
from mavproxy_uavapi.errors import Invalid, NotSupported
from mavproxy_uavapi.vehicle.copter import Copter
from mavproxy_uavapi.vehicle.geodesy import offset
from mavproxy_uavapi.vehicle.jobs import Job
from mavproxy_uavapi.vehicle.messages import GlobalTarget
from mavproxy_uavapi.vehicle.vehicle import Vehicle

VERB = "/mission/fly-track"
TOLERANCE = 1.0  # m


class Flight:
    """A track that is flown.

    Attributes:
        leg: number of the leg that is flown, from 1; 0 before the first.
        stage: `arming`, `taking off`, `flying`, `returning`, `done`.
    """

    def __init__(self, copter: Copter, places: Sequence[Waypoint], tolerance: float = TOLERANCE) -> None:
        self.copter = copter
        self.places = list(places)
        self.tolerance = tolerance
        self.leg = 0
        self.stage = "arming"
        self.job: Job | None = None

    async def fly(self, job: Job) -> str:
        """Take off if need be, fly every leg, return and land; the result's text.

        Raises:
            UavApiError: as the verbs `arm`, `takeoff`, `go_to` and `rtl`; nothing more is sent then.
        """
        self.job = job
        self._enter("arming")
        if self.copter.state.armed is False or self.copter.state.landed:
            await self.copter.arm(job)
            self._enter("taking off")
            await self.copter.takeoff(job, self.places[0].alt)
        for place in self.places:
            self.leg += 1
            self._enter("flying")
            target = GlobalTarget(place.lat, place.lon, place.alt)
            await self.copter.go_to(job, target, wait=True, tolerance=self.tolerance)
        self._enter("returning")
        await self.copter.rtl(job)
        self._enter("done")
        return f"Flew {len(self.places)} legs and landed at home"

    def _enter(self, stage: str) -> None:
        self.stage = stage
        if self.job is not None:
            self.job.stage = {"stage": stage, "leg": self.leg, "legs": len(self.places)}

    def report(self) -> dict[str, Any]:
        """What the status says."""
        job = self.job
        state = "waiting" if job is None else "running" if job.running else "failed" if job.error else "done"
        return {
            "job": None if job is None else job.id,
            "state": state,
            "error": str(job.error) if job is not None and job.error else None,
            "stage": self.stage,
            "leg": self.leg,
            "legs": len(self.places),
            **({} if job is None else job.progress),
        }


def flight_of(vehicle: Vehicle, places: Sequence[Waypoint], reach: float) -> Flight:
    """A flight through those places, looked at before anything is sent.

    Args:
        vehicle: who flies.
        places: where to.
        reach: m from here within which the places must lie.

    Raises:
        NotSupported: the vehicle is no copter.
        Invalid: a place lies farther away.
        Stale: the vehicle does not tell where it is.
    """
    if not isinstance(vehicle, Copter):
        raise NotSupported(f"a {vehicle.kind} does not fly tracks")
    here = vehicle.fresh("GLOBAL_POSITION_INT")
    for number, place in enumerate(places, 1):
        north, east = offset(here.lat / 1e7, here.lon / 1e7, place.lat, place.lon)
        away = float((north**2 + east**2) ** 0.5)
        if away > reach:
            raise Invalid(
                f"waypoint {number} of the track is {away:.0f} m away; `reach` is {reach:g} m", "body", "track"
            )
    return Flight(vehicle, places)
