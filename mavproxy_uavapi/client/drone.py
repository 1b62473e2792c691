"""One vehicle behind an API: its verbs and its telemetry."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any, TypeVar

from mavproxy_uavapi.client.errors import Unreachable, error_of
from mavproxy_uavapi.client.http import Http
from mavproxy_uavapi.client.logs import Log
from mavproxy_uavapi.client.places import Ned, Position
from mavproxy_uavapi.client.readings import CommandingJob, Status, VehicleReadings
from mavproxy_uavapi.client.telemetry import Telemetry
from mavproxy_uavapi.core.errors import LinkLost, NoVehicle, UavApiError
from mavproxy_uavapi.core.timeout import kept, wait_with_timeout

T = TypeVar("T")

MAX_AGE = 5.0  # s
SILENT = 20.0  # s without a heartbeat after which an answer is no longer awaited; the API itself gives up earlier
ANSWER_TIMEOUT = 5.0  # s for the first answer of an API
POLL_PERIOD = 0.2  # s between requests for the state of a job
ABORT_TIMEOUT = 5.0  # s that a cancelled landing waits for the vehicle to stop
TURN_TOLERANCE = 5.0  # degrees
SHOWN_WITHIN = 2.0  # s until the stream must show the effect that a verb's answer reports
LONGEST_TRAVEL = 3600.0  # s for which the API repeats a velocity in one call


class Drone(VehicleReadings):
    """One vehicle. Its properties are its newest telemetry; they raise `Stale` if that is too old.

    Each verb returns when telemetry shows its effect, and otherwise raises the API's error (`UavApiError`). If its
    task is cancelled or its program dies, the verb ends on the vehicle, too: the vehicle stops and holds. Only a
    cancellation ends a landing or a return; if the program dies, it continues.

    Attributes:
        id: its MAVLink system id.
        telemetry: all messages from it.
    """

    def __init__(self, http: Http, system: int, telemetry: Telemetry) -> None:
        super().__init__(telemetry)
        self.id = system
        self._http = http

    # -- status ------------------------------------------------------------------------------------------

    async def status(self) -> Status:
        """Its status: whether it can be flown, and why not."""
        info = (await self._http.get("/telemetry/status"))["info"]
        return Status(
            kind=info["vehicle_type"],
            mode=info["mode"],
            armed=info["armed"],
            landed_state=info["landed_state"],
            link_alive=info["link"]["alive"],
            ekf_ok=info["ekf_ok"],
            ready_to_arm=info["ready_to_arm"],
            why_not=tuple(info["why_not"]),
        )

    async def home(self) -> tuple[Position, float]:
        """The home position, and its altitude in m AMSL.

        Raises:
            NotFound: it has no home yet.
        """
        body = await self._http.get("/telemetry/home_info")
        return Position(body["lat"], body["lon"], 0.0), float(body["altitude"])

    async def command(self) -> CommandingJob | None:
        """The job that commands it now; None if there is none."""
        vehicles = (await self._answer(self._http.get("/authority")))["vehicles"]
        commander = next((one["commanded_by"] for one in vehicles if one["vehicle"] == self.id), None)
        if commander is None:
            return None
        job = await self._answer(self._http.get(f"/jobs/{commander['job']}"))
        return CommandingJob(job["job"], job["verb"], job["request"])

    async def check(self, target: Position) -> None:
        """Ask whether it may go to a position now; nothing moves.

        Raises:
            OutsideEnvelope, TooNear, Busy, Stale: as `go_to` would.
        """
        await self._answer(self._http.get("/envelope/check", lat=target.lat, long=target.lon, alt=target.alt))

    # -- logs ---------------------------------------------------------------------------------------------

    async def logs(self) -> list[Log]:
        """The logs that it holds, oldest first.

        Raises:
            Busy: it is armed, or another program reads its logs.
        """
        body = await self._answer(self._http.get("/logs"))
        return [Log.of(report) for report in body["logs"]]

    async def download_log(self, log: Log, file: Path | str) -> Path:
        """Save a log in `file`, which may exist; returns its path.

        A log that the API's machine does not have yet is first transferred from the vehicle: some minutes for a long
        flight. If the task is cancelled, the transfer ends, and `file` is unchanged.

        Raises:
            Busy: it is armed, or another program reads its logs.
            NotFound: it does not have the log any more.
            OSError: `file` cannot be written.
        """
        if not log.downloaded:
            await self._answer(self._http.ask("POST", f"/logs/{log.id}/download", {}))
        target = Path(file)
        await self._http.save(f"/logs/{log.id}", target)
        return target

    # -- arming, takeoff, landing -------------------------------------------------------------------------

    async def arm(self, timeout: float | None = None) -> None:
        """Wait until it is ready, switch to GUIDED and arm."""
        await self._fly("GET", "/command/arm", {"timeout": timeout})
        await self._shows(lambda: self.armed)

    async def disarm(self, force: bool = False) -> None:
        """Disarm; in flight only with `force`: then it falls."""
        await self._command("/command/disarm", force=force)
        await self._shows(lambda: not self.armed)

    async def takeoff(self, alt: float, timeout: float | None = None) -> None:
        """Climb to `alt` m above home."""
        await self._fly("GET", "/command/takeoff", {"alt": alt, "timeout": timeout})

    async def land(self, timeout: float | None = None, *, outlive: bool = False) -> None:
        """Land where it is, and disarm; with `outlive` it goes on landing after a cancellation."""
        await self._fly_to_the_end("/command/land", timeout, outlive)
        await self._shows(lambda: not self.armed)

    async def rtl(self, timeout: float | None = None, *, outlive: bool = False) -> None:
        """Return to launch, land there and disarm; with `outlive` it goes on returning after a cancellation."""
        await self._fly_to_the_end("/command/rtl", timeout, outlive)
        await self._shows(lambda: not self.armed)

    # -- modes and speeds ---------------------------------------------------------------------------------

    async def brake(self) -> None:
        """Stop at once, in BRAKE."""
        await self._command("/command/brake")

    async def guided(self) -> None:
        """Switch to GUIDED, in which it accepts movements."""
        await self.set_mode("GUIDED")

    async def set_mode(self, mode: str) -> None:
        """Switch to any mode that it has."""
        await self._command("/command/set_mode", mode=mode)
        await self._shows(lambda: self.mode == mode.upper())

    async def set_speed(self, speed: float, kind: str = "ground") -> None:
        """Set the `kind` of speed (air, ground, climb, descent) to `speed` m/s."""
        await self._command(f"/command/set_{kind}_speed", new_v=speed)

    # -- movement -----------------------------------------------------------------------------------------

    async def go_to(
        self,
        target: Position,
        *,
        heading: float | None = None,
        look_at_target: bool = False,
        tolerance: float = 1.0,
        timeout: float | None = None,
    ) -> None:
        """Fly to a position; returns on arrival.

        Args:
            target: the position.
            heading: the direction to point on the way, degrees.
            look_at_target: whether to point in the direction of travel; `heading` overrides it.
            tolerance: m, horizontally and vertically.
            timeout: s that the flight may take.
        """
        body = {"lat": target.lat, "long": target.lon, "alt": target.alt}
        more = {"heading": heading, "look_at_target": look_at_target, "tolerance": tolerance, "timeout": timeout}
        await self._fly("POST", "/movement/go_to_gps_wait", body={**body, **more})

    async def go_to_ned(
        self,
        target: Ned,
        *,
        heading: float | None = None,
        look_at_target: bool = False,
        tolerance: float = 1.0,
        timeout: float | None = None,
    ) -> None:
        """As `go_to`, to a position in m from its EKF origin."""
        body = {"x": target.north, "y": target.east, "z": target.down}
        more = {"heading": heading, "look_at_target": look_at_target, "tolerance": tolerance, "timeout": timeout}
        await self._fly("POST", "/movement/go_to_ned_wait", body={**body, **more})

    async def travel(self, velocity: Ned, duration: float | None = None, *, heading: float | None = None) -> None:
        """Fly at a velocity for `duration` s on its clock, then stop; None means until the task is cancelled."""
        body = {"vx": velocity.north, "vy": velocity.east, "vz": velocity.down, "heading": heading}
        await self._travel("/movement/travel_at_ned", body, duration)

    async def travel_body(
        self,
        front: float,
        right: float,
        down: float = 0.0,
        duration: float | None = None,
        *,
        heading: float | None = None,
    ) -> None:
        """As `travel`, in the body's frame; the heading at the beginning counts."""
        body = {"front": front, "right": right, "down": down, "heading": heading}
        await self._travel("/movement/travel_at_body", body, duration)

    async def _travel(self, path: str, body: dict[str, Any], duration: float | None) -> None:
        while duration is None:
            await self._fly("POST", path, body={**body, "duration": LONGEST_TRAVEL})
        await self._fly("POST", path, body={**body, "duration": duration})

    async def turn_to(self, heading: float) -> None:
        """Turn to `heading` degrees clockwise from north, the shorter way round."""
        await self._fly("GET", "/movement/set_heading", {"heading": heading % 360.0})
        await self._shows(lambda: abs((self.heading - heading + 180.0) % 360.0 - 180.0) <= TURN_TOLERANCE)

    async def stop(self) -> None:
        """Hold still until `resume`."""
        await self._command("/movement/stop")

    async def resume(self) -> None:
        """Continue the movement that `stop` interrupted."""
        await self._command("/movement/resume")

    # -- requests -----------------------------------------------------------------------------------------

    async def _fly(
        self, method: str, path: str, query: dict[str, Any] | None = None, body: dict[str, Any] | None = None
    ) -> None:
        """Run a verb that ends when we hang up, as a cancellation does; then the vehicle stops."""
        await self._answer(self._http.ask(method, path, {**(query or {}), "on_disconnect": "hold"}, body))

    async def _command(self, path: str, **query: Any) -> None:
        """Run a short verb that goes on when we hang up."""
        await self._answer(self._http.get(path, **query))

    async def _fly_to_the_end(self, path: str, timeout: float | None, outlive: bool) -> None:
        """Run a verb that goes on when we hang up, so a cancellation must abort its job, unless `outlive`."""
        begun = asyncio.ensure_future(self._http.get(path, wait=False, timeout=timeout))
        try:
            number = (await self._answer(kept(begun)))["job"]
            job = await self._answer(self._ended(number))
        except asyncio.CancelledError:
            if not outlive:
                with contextlib.suppress(UavApiError, asyncio.TimeoutError):  # it has just ended, or stops slowly
                    await wait_with_timeout(ABORT_TIMEOUT, self._abort(begun))
            raise
        if job["error"] is not None:
            raise error_of(job["error"]["status"], job["error"])

    async def _ended(self, number: str) -> dict[str, Any]:
        """The job as the API reports it, once it has ended."""
        while True:
            job = await self._http.get(f"/jobs/{number}")
            if job["state"] != "running":
                return job
            await asyncio.sleep(POLL_PERIOD)

    async def _abort(self, begun: asyncio.Future[dict[str, Any]]) -> None:
        await self._http.ask("DELETE", f"/jobs/{(await begun)['job']}", {})

    async def _answer(self, answer: Awaitable[T]) -> T:
        """Wait for an answer. The API ends each wait itself, unless its machine or the network fails.

        Raises:
            LinkLost: no heartbeat arrives any more.
        """
        asking = asyncio.ensure_future(answer)
        try:
            while not (await asyncio.wait({asking}, timeout=1.0))[0]:
                silent_for = self.telemetry.age("HEARTBEAT") or 0.0
                if silent_for > SILENT:
                    raise LinkLost(f"no heartbeat of vehicle {self.id} has arrived for {silent_for:.0f} s")
        finally:
            asking.cancel()
        return asking.result()

    async def _shows(self, condition: Callable[[], bool]) -> None:
        """Wait until the stream, which may be later than the answer, shows it, too; the answer is the proof."""
        await self.telemetry.shows(condition, SHOWN_WITHIN)


@contextlib.asynccontextmanager
async def connect(
    url: str | None = None, token: str | None = None, *, timeout: float = 30.0, max_age: float = MAX_AGE
) -> AsyncIterator[Drone]:
    """Connect to a vehicle's API, and to its telemetry stream.

    Args:
        url: the API's address, `http://host:8000/vehicles/2` for one of several vehicles; by default the variable
            UAVAPI_URL, which an uploaded script has, or else `http://127.0.0.1:8000`.
        token: the API's token, if it needs one; by default the environment variable UAVAPI_TOKEN.
        timeout: s until the API must answer and a heartbeat must arrive.
        max_age: s after which properties raise `Stale`.

    Raises:
        Unreachable, NoVehicle, LinkLost: no connection within `timeout`.
        Unauthorized, Forbidden: the API refuses the client.
    """
    clock = asyncio.get_running_loop().time
    deadline = clock() + timeout
    url = url or os.environ.get("UAVAPI_URL") or "http://127.0.0.1:8000"
    async with Http(url, os.environ.get("UAVAPI_TOKEN", "") if token is None else token) as http:
        system = await _system(http, deadline)
        telemetry = Telemetry(http, system, max_age, clock)
        listening = asyncio.create_task(telemetry.run())
        drone = Drone(http, system, telemetry)
        try:
            if not await telemetry.shows(lambda: drone.is_connected, max(deadline - clock(), 1.0)):
                raise LinkLost(f"no heartbeat of vehicle {system} has arrived within {timeout:g} s")
            yield drone
        finally:
            listening.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await listening


async def _system(http: Http, deadline: float) -> int:
    """The vehicle's system id, as soon as the API knows it."""
    clock = asyncio.get_running_loop().time
    while True:
        try:
            return int((await wait_with_timeout(ANSWER_TIMEOUT, http.get("/telemetry/status")))["id"])
        except (Unreachable, NoVehicle, asyncio.TimeoutError) as error:
            if clock() > deadline:
                if isinstance(error, asyncio.TimeoutError):
                    raise Unreachable(f"{http.url} does not answer") from error
                raise
        await asyncio.sleep(POLL_PERIOD)
