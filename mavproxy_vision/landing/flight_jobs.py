"""This module's flights as jobs: started at the prompt or by HTTP, one at a time."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import cv2

from mavproxy_uavapi.core.control.jobs import CONSOLE, Ending, Job
from mavproxy_uavapi.core.errors import Aborted, NotSupported, UavApiError
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.oversight.endings import FIXED
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_vision.landing import mission
from mavproxy_vision.landing.descent import Descent, PrecisionDescent
from mavproxy_vision.landing.executor import TagFlight
from mavproxy_vision.landing.flight_log import FlightLog
from mavproxy_vision.landing.mission import MissionPlan
from mavproxy_vision.landing.precision_landing import PrecisionLanding
from mavproxy_vision.landing.report import Report
from mavproxy_vision.tracking.tracker import Tracker

TIDY_EVERY = 1.0  # s between two tries to restore parameters
TIDY_TRIES = 10
UNLOADED = "vision was unloaded"
log = logging.getLogger("vision")


class FlightTask:
    """A requested flight: the body of a job, and its report.

    Args:
        flights: the FlightJobs that it belongs to.
        copter: the vehicle.
        name: the verb, for the report.
        fly: flies it.
    """

    def __init__(
        self, flights: FlightJobs, copter: Copter, name: str, fly: Callable[[TagFlight], Awaitable[None]]
    ) -> None:
        self._flights, self._copter, self._fly = flights, copter, fly
        self.report = Report(name)
        self.begun = False

    async def __call__(self, job: Job) -> None:
        """Run the flight as that job.

        Raises:
            Aborted: the module was unloaded meanwhile.
        """
        flights = self._flights
        flights.require_loaded()
        self.begun = True
        flight = TagFlight(flights.tracker, self._copter, job, self.report, flights.replace_running_flight)
        flights.on_flight_begun(flight)
        try:
            await self._fly(flight)
        except UavApiError as error:
            self.report.reason = str(error)
            raise
        finally:
            flights.on_flight_ended(flight)

    def result(self) -> str:
        """One line about a flight that ended well."""
        return self.report.line()


class MissionTask(FlightTask):
    """A whole mission, with its track.

    Args:
        flights: the FlightJobs that it belongs to.
        copter: the vehicle.
        plan: the place and kind of the landing.
    """

    def __init__(self, flights: FlightJobs, copter: Copter, plan: MissionPlan) -> None:
        descent_method = flights.descent_method(plan.method)
        super().__init__(flights, copter, "mission", lambda flight: mission.fly(flight, plan, descent_method))
        self._mission, self._track = plan, FlightLog()

    async def __call__(self, job: Job) -> None:
        """Fly the mission, and write its track at its end."""
        listeners = self._flights.tracker.host.listeners
        listeners.append(self._follow)
        try:
            await super().__call__(job)
        finally:
            listeners.remove(self._follow)
            home = self._copter.state.home
            if home is not None:
                self._track.target = self._mission.place(home.place)
            await self._flights.keep(self._track, self.report)

    def _follow(self, state: VehicleState, message: Any, _now: float) -> None:
        if state is self._copter.state and message.get_type() == "GLOBAL_POSITION_INT":
            self._track.add(message)


class FlightJobs:
    """The running flights, and the report of the last one. All methods belong to the asyncio thread.

    Attributes:
        report: of the running flight, or the last one.

    Args:
        tracker: the detections, and the target's position.
        directory: the folder for tracks and plots.
    """

    def __init__(self, tracker: Tracker, directory: Callable[[], Path]) -> None:
        self.tracker = tracker
        self.report: Report | None = None
        self._directory = directory
        self._flight: TagFlight | None = None
        self._begun: set[TagFlight] = set()  # all that are not over, including those without a vehicle yet
        self._unfinished: set[TagFlight] = set()  # those of them that have taken over the vehicle
        self._precision_landings: dict[int, PrecisionLanding] = {}
        self._tidying: set[PrecisionLanding] = set()
        self._tasks = HeldTasks()
        self._unloaded = False
        tracker.host.closing_messages.append(self.closing_messages)

    def copter(self) -> Copter:
        """The vehicle that carries the camera. Raises NoVehicle, LinkLost, NotSupported."""
        return copter_of(self.tracker.host.registry.commandable(self.tracker.settings.vehicle))

    # -- flights, to be run as jobs --------------------------------------------------------------------------

    def landing(self, copter: Copter, number: int | None, method: str) -> FlightTask:
        """Land on a tag from here."""
        descent_method = self.descent_method(method)
        return FlightTask(self, copter, "land", lambda flight: flight.land(number, method, descent_method))

    def searching(self, copter: Copter, number: int | None, leash: float | None) -> FlightTask:
        """Find a tag from here."""
        return FlightTask(self, copter, "search", lambda flight: flight.search(number, leash))

    def mission(self, copter: Copter, plan: MissionPlan) -> FlightTask:
        """A whole mission, with its track."""
        return MissionTask(self, copter, plan)

    def descent_method(self, method: str) -> Callable[[TagFlight], Descent]:
        """The descent of that method."""
        if method != "landing_target":
            return Descent

        def by_precision_landing(flight: TagFlight) -> Descent:
            vehicle = flight.vehicle
            precision_landing = self._precision_landings.get(vehicle.state.system)
            if precision_landing is None or precision_landing.vehicle is not vehicle:
                precision_landing = self._precision_landings[vehicle.state.system] = PrecisionLanding(vehicle)
            return PrecisionDescent(flight, precision_landing)

        return by_precision_landing

    def require_loaded(self) -> None:
        """Raise Aborted once `abort_all` has ended everything."""
        if self._unloaded:
            raise Aborted(UNLOADED)

    def on_flight_begun(self, flight: TagFlight) -> None:
        """The flight is being prepared; it does not have the vehicle yet."""
        self._begun.add(flight)

    async def replace_running_flight(self, flight: TagFlight) -> None:
        """Make it the running flight, and await the end of the earlier ones."""
        before = self._unfinished - {flight}
        self._flight, self.report = flight, flight.report
        self._unfinished.add(flight)
        for earlier in before:
            if earlier.job.running:  # of another vehicle; on this one it is already superseded
                earlier.job.abort(Aborted(f"{flight.job.verb} took over"))
            await earlier.ended.wait()

    def on_flight_ended(self, flight: TagFlight) -> None:
        """The flight has sent its last message."""
        self._begun.discard(flight)
        self._unfinished.discard(flight)
        if self._flight is flight:
            self._flight = None
        flight.ended.set()
        landing = flight.precision_landing
        if landing is not None and not any(other.precision_landing is landing for other in self._unfinished):
            landing.in_use = False
            if landing.before and landing not in self._tidying:
                self._tasks.start(self._tidy(landing), "the return of parameters")
        self._leave_host()

    async def keep(self, track: FlightLog, report: Report) -> None:
        """Write track and plot; the report says if that fails."""
        loop = asyncio.get_running_loop()
        try:
            base = self._directory().absolute() / time.strftime("vision_mission_%Y%m%d_%H%M%S")
            await loop.run_in_executor(None, track.write, base.with_suffix(".csv"))
            report.track = str(base.with_suffix(".csv"))
            await loop.run_in_executor(None, track.plot, base.with_suffix(".png"))
            report.plot = str(base.with_suffix(".png"))
        except OSError as error:
            report.track = f"not written: {error.strerror}"
        except (RuntimeError, ValueError, cv2.error) as error:  # an unknown `~user`, a null in a name, no encoder
            report.track = f"not written: {error}"

    @property
    def running(self) -> bool:
        """Whether a flight is running."""
        return self._flight is not None and self._flight.job.running

    @property
    def systems(self) -> list[int]:
        """The system ids of the vehicles whose flights run or are being prepared."""
        return [flight.vehicle.state.system for flight in self._begun if flight.job.running]

    @property
    def phase(self) -> str:
        """Its present activity."""
        return self._flight.phase if self._flight is not None else "over"

    # -- parameters that are still to be given back ----------------------------------------------------------

    async def _tidy(self, landing: PrecisionLanding) -> None:
        """Restore parameters as soon as the vehicle hears us, and no flight needs them."""
        self._tidying.add(landing)
        tries = 0
        while landing.before and tries < TIDY_TRIES:
            if not landing.in_use and self.tracker.host.link_watch.is_alive(landing.vehicle.state):
                try:
                    await landing.give_back()
                except UavApiError as error:
                    tries += 1
                    if tries == TIDY_TRIES:
                        log.warning("vision: %s", error)
            await asyncio.sleep(TIDY_EVERY)
        self._tidying.discard(landing)
        self._leave_host()

    # -- from the prompt, and at the end ---------------------------------------------------------------------

    def begin(
        self, copter: Copter, task: FlightTask, path: str, request: dict[str, Any], report: Callable[[str], None]
    ) -> Job:
        """Start a flight without a network client; `report` is called with one line at its end."""

        async def body(job: Job) -> str:
            await task(job)
            return task.result()

        jobs = self.tracker.host.jobs
        job = jobs.begin(copter, path, request, body, client=CONSOLE, outlives_client=True)
        self._tasks.start(self._report_end(job, report), "a flight from the prompt")
        return job

    async def _report_end(self, job: Job, report: Callable[[str], None]) -> None:
        try:
            report(await job.outcome())
        except UavApiError as error:
            report(str(error))

    def stop(self, reason: str) -> str | None:
        """End all flights; a vehicle that is ours must hold. Returns what was done; None without a flight."""
        return self._end(reason, Ending.ABORTED)

    def abort_all(self) -> None:
        """End all flights, because the module is unloaded."""
        self._end(UNLOADED, Ending.UNLOADED)
        self._unloaded = True
        self._leave_host()

    def _leave_host(self) -> None:
        """Leave the host's closing messages when nothing flies and all parameters are restored."""
        sources = self.tracker.host.closing_messages
        if self._unloaded and not self._begun and not self.closing_messages() and self.closing_messages in sources:
            sources.remove(self.closing_messages)

    def _end(self, reason: str, ending: Ending) -> str | None:
        """End running flights and those in preparation; the outcome of the running ones has precedence."""
        outcome = None
        for flight in sorted(self._begun, key=lambda one: one is not self._flight):
            if flight.job.running:
                error = _ended(self.tracker, flight, reason, ending)
                outcome = outcome or str(error)
                flight.job.abort(error, ending)
        return outcome

    def closing_messages(self) -> list[tuple[Any, int]]:
        """The messages that restore the remaining parameters, and the systems that they go to."""
        return [
            (message, landing.vehicle.state.system)
            for landing in self._precision_landings.values()
            for message in landing.remaining()
        ]


def _ended(tracker: Tracker, flight: TagFlight, reason: str, ending: Ending) -> Aborted:
    vehicle = flight.vehicle
    holds = flight.commands and tracker.host.endings.what_follows(vehicle, FIXED[ending], flight.job.modes)
    outcome = "the vehicle is commanded to hold" if holds else f"the vehicle is left alone: it is in {vehicle.mode}"
    return Aborted(f"{reason}; {outcome}")


def copter_of(vehicle: Any) -> Copter:
    """The vehicle, which must be a copter.

    Raises:
        NotSupported: it is another type.
    """
    if not isinstance(vehicle, Copter):
        raise NotSupported(f"a {vehicle.kind} cannot land on a tag")
    return vehicle
