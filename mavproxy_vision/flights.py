"""The flights of this module as jobs: begun at the prompt or by HTTP, one at a time for a vehicle."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from mavproxy_uavapi.errors import Aborted, NotSupported, UavApiError
from mavproxy_uavapi.host.state import VehicleState
from mavproxy_uavapi.vehicle.copter import Copter
from mavproxy_uavapi.vehicle.geodesy import METRES_PER_DEGREE
from mavproxy_uavapi.vehicle.jobs import CONSOLE, Job
from mavproxy_vision import mission
from mavproxy_vision.flight import Flight
from mavproxy_vision.mission import Errand
from mavproxy_vision.report import Report
from mavproxy_vision.track import Track
from mavproxy_vision.vision import Vision

Verb = Callable[[Job], Awaitable[None]]


class Flights:
    """What is in flight, and what the last flight told. All methods belong to the asyncio thread.

    Args:
        vision: the eye.
        directory: where tracks and plots go.
    """

    def __init__(self, vision: Vision, directory: Callable[[], Path]) -> None:
        self.vision = vision
        self.report: Report | None = None
        self._directory = directory
        self._flight: Flight | None = None
        self._ends: set[asyncio.Task[None]] = set()

    def copter(self) -> Copter:
        """The vehicle. Raises NoVehicle, LinkLost, NotSupported."""
        return copter_of(self.vision.vehicle())

    # -- verbs, to be run as jobs ----------------------------------------------------------------------------

    def landing(self, copter: Copter, number: int | None, method: str) -> Verb:
        """Land on a tag from here."""
        return self._verb("land", copter, lambda flight: flight.land(number, method))

    def searching(self, copter: Copter, number: int | None, leash: float | None) -> Verb:
        """Find a tag from here."""
        return self._verb("search", copter, lambda flight: flight.search(number, leash))

    def errand(self, copter: Copter, errand: Errand) -> Verb:
        """A whole mission, with its track."""

        async def fly(flight: Flight) -> None:
            track = Track()

            def follow(state: VehicleState, message: Any, _now: float) -> None:
                if state is copter.state and message.get_type() == "GLOBAL_POSITION_INT":
                    track.add(message)

            self.vision.host.listeners.append(follow)
            try:
                await mission.fly(flight, errand)
            finally:
                self.vision.host.listeners.remove(follow)
                track.target = await self._target(flight, errand)
                await self._keep(track, flight.report)

        return self._verb("mission", copter, fly)

    def _verb(self, name: str, copter: Copter, fly: Callable[[Flight], Awaitable[None]]) -> Verb:
        async def verb(job: Job) -> None:
            self.report = Report(name)
            flight = self._flight = Flight(self.vision, copter, job, self.report)
            try:
                await fly(flight)
            except asyncio.CancelledError:
                for message in flight.parting():
                    await copter.link.send(message, copter.state.system)
                raise
            except UavApiError as error:
                flight.report.reason = str(error)
                raise
            finally:
                if self._flight is flight:
                    self._flight = None

        return verb

    async def _target(self, flight: Flight, errand: Errand) -> tuple[float, float] | None:
        home = flight.vehicle.state.messages.get("HOME_POSITION")
        if errand.lat is not None and errand.lon is not None:
            return errand.lat, errand.lon
        if home is None or errand.north is None or errand.east is None or not flight.job.running:
            return None
        lat, lon = home.message.latitude / 1e7, home.message.longitude / 1e7
        return lat + errand.north / METRES_PER_DEGREE, lon + errand.east / METRES_PER_DEGREE / math.cos(
            math.radians(lat)
        )

    async def _keep(self, track: Track, report: Report) -> None:
        """Write track and plot; a disk that is full ends no flight."""
        base = self._directory().absolute() / time.strftime("vision_mission_%Y%m%d_%H%M%S")
        loop = asyncio.get_running_loop()
        try:
            await loop.run_in_executor(None, track.write, base.with_suffix(".csv"))
            report.track = str(base.with_suffix(".csv"))
            await loop.run_in_executor(None, track.plot, base.with_suffix(".png"))
            report.plot = str(base.with_suffix(".png"))
        except OSError as error:
            report.track = f"not written: {error.strerror}"

    @property
    def running(self) -> bool:
        """Whether a flight is under way."""
        return self._flight is not None and self._flight.job.running

    @property
    def phase(self) -> str:
        """What it is doing."""
        return self._flight.phase if self._flight is not None else "over"

    # -- from the prompt, and at the end ---------------------------------------------------------------------

    def begin(
        self, copter: Copter, verb: Verb, path: str, request: dict[str, Any], tell: Callable[[str], None]
    ) -> Job:
        """Start a flight that nobody awaits over the network; `tell` is called with one line at its end."""

        async def body(job: Job) -> str:
            await verb(job)
            return self.result()

        jobs = self.vision.host.jobs
        job = jobs.begin(copter.seat, path, request, body, client=CONSOLE, outlives_client=True)
        self._ends.add(task := asyncio.get_running_loop().create_task(self._tell_end(job, tell)))
        task.add_done_callback(self._ends.discard)
        return job

    async def _tell_end(self, job: Job, tell: Callable[[str], None]) -> None:
        try:
            tell(await job.outcome())
        except UavApiError as error:
            tell(str(error))

    def result(self) -> str:
        """One line about the flight that just ended well."""
        report = self.report
        if report is None:
            return "done"
        if report.verb == "search" and report.place is not None:
            north, east, _ = report.place
            return f"Found tag {report.tag} at {north:.2f} m north, {east:.2f} m east of the EKF origin"
        if report.tag is None:
            return "Landed"
        off = "" if report.touchdown_error is None else f", {report.touchdown_error:.2f} m off it"
        return f"Landed on tag {report.tag}{off}"

    def stop(self, reason: str) -> bool:
        """End the flight; the vehicle holds. Whether there was one."""
        flight = self._flight
        if flight is None or not flight.job.running:
            return False
        flight.job.abort(Aborted(reason))
        return True

    def abandon(self) -> list[tuple[Any, int]]:
        """End the flight without sending anything: what would be sent, and to which system."""
        flight = self._flight
        if flight is None or not flight.job.running:
            return []
        system = flight.vehicle.state.system
        last = [(message, system) for message in flight.parting()]
        flight.vehicle.seat.job = None  # so that its own end finds nothing more to send
        flight.job.abort(Aborted("vision was unloaded; the vehicle holds"))
        return last


def copter_of(vehicle: Any) -> Copter:
    """The vehicle, which must be a copter.

    Raises:
        NotSupported: it is another type.
    """
    if not isinstance(vehicle, Copter):
        raise NotSupported(f"a {vehicle.kind} cannot land on a tag")
    return vehicle
