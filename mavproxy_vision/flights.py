"""The flights of this module as jobs: begun at the prompt or by HTTP, one at a time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import cv2

from mavproxy_uavapi.errors import Aborted, NotSupported, UavApiError
from mavproxy_uavapi.host.state import VehicleState
from mavproxy_uavapi.vehicle.copter import Copter
from mavproxy_uavapi.vehicle.jobs import CONSOLE, Job
from mavproxy_vision import mission
from mavproxy_vision.descent import Descent, PrecisionDescent
from mavproxy_vision.flight import Flight
from mavproxy_vision.mission import Errand
from mavproxy_vision.plnd import PrecisionLanding
from mavproxy_vision.report import Report
from mavproxy_vision.track import Track
from mavproxy_vision.vision import Vision

TIDY_EVERY = 1.0  # s between two tries to give parameters back


class Sortie:
    """A flight that is asked for: the body of a job, and what it tells of itself.

    Args:
        flights: to which it belongs.
        copter: what flies.
        name: the verb, for the report.
        fly: flies it.
    """

    def __init__(self, flights: Flights, copter: Copter, name: str, fly: Callable[[Flight], Awaitable[None]]) -> None:
        self._flights, self._copter, self._fly = flights, copter, fly
        self.report = Report(name)
        self.begun = False

    async def __call__(self, job: Job) -> None:
        """Fly it, as that job."""
        self.begun = True
        flight = Flight(self._flights.vision, self._copter, job, self.report, self._flights.succeed)
        try:
            await self._fly(flight)
        except UavApiError as error:
            self.report.reason = str(error)
            raise
        except BaseException:  # ended from outside, or a defect of ours: the vehicle is not left flying
            for message in flight.parting():
                await self._copter.link.send(message, self._copter.state.system)
            raise
        finally:
            self._flights.over(flight)

    def result(self) -> str:
        """One line about the flight, which ended well."""
        return self.report.line()


class ErrandSortie(Sortie):
    """A whole mission, with its track.

    Args:
        flights: to which it belongs.
        copter: what flies.
        errand: where to.
    """

    def __init__(self, flights: Flights, copter: Copter, errand: Errand) -> None:
        way_down = flights.way_down(errand.method)
        super().__init__(flights, copter, "mission", lambda flight: mission.fly(flight, errand, way_down))
        self._errand, self._track = errand, Track()

    async def __call__(self, job: Job) -> None:
        """Fly it, and write down its track when it is over."""
        listeners = self._flights.vision.host.listeners
        listeners.append(self._follow)
        try:
            await super().__call__(job)
        finally:
            listeners.remove(self._follow)
            home = self._copter.state.messages.get("HOME_POSITION")
            if home is not None:
                where = home.message.latitude / 1e7, home.message.longitude / 1e7
                self._track.target = self._errand.place(where)
            await self._flights.keep(self._track, self.report)

    def _follow(self, state: VehicleState, message: Any, _now: float) -> None:
        if state is self._copter.state and message.get_type() == "GLOBAL_POSITION_INT":
            self._track.add(message)


class Flights:
    """What is in flight, and what the last flight told. All methods belong to the asyncio thread.

    Attributes:
        report: of the flight under way, or the last one.

    Args:
        vision: the eye.
        directory: where tracks and plots go.
    """

    def __init__(self, vision: Vision, directory: Callable[[], Path]) -> None:
        self.vision = vision
        self.report: Report | None = None
        self._directory = directory
        self._flight: Flight | None = None
        self._plnd: dict[int, PrecisionLanding] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def copter(self) -> Copter:
        """MAVProxy's current vehicle. Raises NoVehicle, LinkLost, NotSupported."""
        return copter_of(self.vision.host.hangar.commandable())

    # -- flights, to be run as jobs --------------------------------------------------------------------------

    def landing(self, copter: Copter, number: int | None, method: str) -> Sortie:
        """Land on a tag from here."""
        way_down = self.way_down(method)
        return Sortie(self, copter, "land", lambda flight: flight.land(number, method, way_down))

    def searching(self, copter: Copter, number: int | None, leash: float | None) -> Sortie:
        """Find a tag from here."""
        return Sortie(self, copter, "search", lambda flight: flight.search(number, leash))

    def errand(self, copter: Copter, errand: Errand) -> Sortie:
        """A whole mission, with its track."""
        return ErrandSortie(self, copter, errand)

    def way_down(self, method: str) -> Callable[[Flight], Descent]:
        """What descends by that method."""
        if method != "landing_target":
            return Descent

        def by_plnd(flight: Flight) -> Descent:
            vehicle = flight.vehicle
            plnd = self._plnd.get(vehicle.state.system)
            if plnd is None or plnd.vehicle is not vehicle:
                plnd = self._plnd[vehicle.state.system] = PrecisionLanding(vehicle)
            return PrecisionDescent(flight, plnd)

        return by_plnd

    async def succeed(self, flight: Flight) -> None:
        """Make it the flight under way, and await the end of the one before."""
        before, self._flight = self._flight, flight
        self.report = flight.report
        if before is not None and before is not flight:
            before.job.abort(
                Aborted(f"{flight.job.verb} took over")
            )  # of another vehicle; ours lost its seat already
            await before.ended.wait()

    def over(self, flight: Flight) -> None:
        """It has sent its last message."""
        if self._flight is flight:
            self._flight = None
        flight.ended.set()
        if flight.plnd is not None and flight.plnd.before:
            self._do(self._tidy(flight.plnd))

    async def keep(self, track: Track, report: Report) -> None:
        """Write track and plot; what cannot be written is said in the report."""
        loop = asyncio.get_running_loop()
        try:
            base = self._directory().absolute() / time.strftime("vision_mission_%Y%m%d_%H%M%S")
            await loop.run_in_executor(None, track.write, base.with_suffix(".csv"))
            report.track = str(base.with_suffix(".csv"))
            await loop.run_in_executor(None, track.plot, base.with_suffix(".png"))
            report.plot = str(base.with_suffix(".png"))
        except OSError as error:
            report.track = f"not written: {error.strerror}"
        except (
            RuntimeError,
            ValueError,
            cv2.error,
        ) as error:  # a `~user` that is none, a name with a null, no encoder
            report.track = f"not written: {error}"

    @property
    def running(self) -> bool:
        """Whether a flight is under way."""
        return self._flight is not None and self._flight.job.running

    @property
    def phase(self) -> str:
        """What it is doing."""
        return self._flight.phase if self._flight is not None else "over"

    # -- parameters that are still to be given back ----------------------------------------------------------

    def _do(self, work: Any) -> None:
        self._tasks.add(task := asyncio.get_running_loop().create_task(work))
        task.add_done_callback(self._tasks.discard)

    async def _tidy(self, plnd: PrecisionLanding) -> None:
        """Give parameters back as soon as the vehicle hears us, and no flight needs them."""
        while plnd.before:
            await asyncio.sleep(TIDY_EVERY)
            if self._flight is not None or not self.vision.host.is_alive(plnd.vehicle.state):
                continue
            try:
                await plnd.give_back()
            except UavApiError:
                continue  # at the next turn; what it had is not forgotten

    # -- from the prompt, and at the end ---------------------------------------------------------------------

    def begin(
        self, copter: Copter, sortie: Sortie, path: str, request: dict[str, Any], tell: Callable[[str], None]
    ) -> Job:
        """Start a flight that nobody awaits over the network; `tell` is called with one line at its end."""

        async def body(job: Job) -> str:
            await sortie(job)
            return sortie.result()

        jobs = self.vision.host.jobs
        job = jobs.begin(copter.seat, path, request, body, client=CONSOLE, outlives_client=True)
        self._do(self._tell_end(job, tell))
        return job

    async def _tell_end(self, job: Job, tell: Callable[[str], None]) -> None:
        try:
            tell(await job.outcome())
        except UavApiError as error:
            tell(str(error))

    def stop(self, reason: str) -> bool:
        """End the flight; a vehicle that is ours holds. Whether there was one."""
        flight = self._flight
        if flight is None or not flight.job.running:
            return False
        flight.job.abort(_ended(flight, reason))
        return True

    def abandon(self) -> list[tuple[Any, int]]:
        """End all without sending anything: what would be sent, and to which system."""
        last: list[tuple[Any, int]] = []
        flight, self._flight = self._flight, None
        for task in self._tasks:
            task.cancel()
        for plnd in self._plnd.values():
            if plnd.before and (flight is None or flight.plnd is not plnd):
                last += [(message, plnd.vehicle.state.system) for message in plnd.remaining()]
        if flight is not None and flight.job.running:
            last += [(message, flight.vehicle.state.system) for message in flight.parting()]
            error = _ended(flight, "vision was unloaded")
            flight.vehicle.seat.job = None  # so that its own end finds nothing more to send
            flight.job.abort(error)
        for plnd in self._plnd.values():
            plnd.before.clear()
        return last


def _ended(flight: Flight, reason: str) -> Aborted:
    vehicle = flight.vehicle
    left = "the vehicle holds" if flight.is_ours else f"nothing was sent: the vehicle is in {vehicle.mode}"
    return Aborted(f"{reason}; {left}")


def copter_of(vehicle: Any) -> Copter:
    """The vehicle, which must be a copter.

    Raises:
        NotSupported: it is another type.
    """
    if not isinstance(vehicle, Copter):
        raise NotSupported(f"a {vehicle.kind} cannot land on a tag")
    return vehicle
