"""One vehicle behind an API: its verbs, and what it tells."""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from mavproxy_uavapi.client.errors import Unreachable, error_of
from mavproxy_uavapi.client.http import Http
from mavproxy_uavapi.client.places import Ned, Position
from mavproxy_uavapi.client.telemetry import Telemetry
from mavproxy_uavapi.core.errors import LinkLost, NoVehicle, Stale, UavApiError
from mavproxy_uavapi.core.mavlink.flight_modes import mode_name
from mavproxy_uavapi.core.timeout import wait_with_timeout

T = TypeVar("T")

MAX_AGE = 5.0  # s
SILENT = 20.0  # s without a heartbeat after which nobody waits for an answer; the API itself gives up before that
ANSWER_TIMEOUT = 5.0  # s for the first answer of an API
LOOK_EVERY = 0.2  # s between looks at a job that outlives its client
ABORT_TIMEOUT = 5.0  # s that a cancelled landing waits for the vehicle to stop
TURNED = 5.0  # degrees
SHOWN = 2.0  # s in which the stream shows what a verb's answer has told already
KEPT = 3600.0  # s; as long as the API repeats a velocity for one call
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
UNKNOWN_HEADING = 65535


@dataclass(frozen=True)
class Attitude:
    """Roll, pitch and yaw in rad; yaw clockwise from north."""

    roll: float
    pitch: float
    yaw: float


@dataclass(frozen=True)
class Battery:
    """V, A and %; None where the vehicle does not know."""

    voltage: float | None
    current: float | None
    level: int | None


@dataclass(frozen=True)
class Gps:
    """The receiver's fix (3: 3-D and better) and how many satellites it sees."""

    fix_type: int
    satellites: int | None


@dataclass(frozen=True)
class Status:
    """What the API says of the vehicle: see /telemetry/status."""

    kind: str
    mode: str
    armed: bool | None
    landed_state: str
    link_alive: bool
    ekf_ok: bool
    ready_to_arm: bool
    why_not: tuple[str, ...]


def _scaled(value: float | None, divisor: float) -> float | None:
    return None if value is None else value / divisor


class Drone:
    """One vehicle. Its properties are what it last told; they raise `Stale` when that is too old.

    Each verb is done when telemetry shows it, and raises what the API answers otherwise (`UavApiError`). A verb whose
    task is cancelled, or whose program dies, ends on the vehicle too: it stops and holds. A landing or a return ends
    by a cancellation only; when the program dies it goes on.

    Attributes:
        id: its MAVLink system id.
        telemetry: all messages that it tells.
    """

    def __init__(self, http: Http, system: int, telemetry: Telemetry) -> None:
        self.id = system
        self.telemetry = telemetry
        self._http = http

    # -- what it tells ------------------------------------------------------------------------------------

    @property
    def position(self) -> Position:
        """Where it is."""
        here = self.telemetry.fields("GLOBAL_POSITION_INT")
        return Position(here["lat"] / 1e7, here["lon"] / 1e7, here["relative_alt"] / 1000.0)

    @property
    def velocity(self) -> Ned:
        """m/s north, east, down."""
        here = self.telemetry.fields("GLOBAL_POSITION_INT")
        return Ned(here["vx"] / 100.0, here["vy"] / 100.0, here["vz"] / 100.0)

    @property
    def ned(self) -> Ned:
        """Where it is, m from its EKF origin."""
        here = self.telemetry.fields("LOCAL_POSITION_NED")
        return Ned(here["x"], here["y"], here["z"])

    @property
    def heading(self) -> float:
        """Degrees clockwise from north, from 0 to less than 360."""
        heading = self.telemetry.fields("GLOBAL_POSITION_INT")["hdg"]
        if heading in (None, UNKNOWN_HEADING):
            return math.degrees(self.attitude.yaw) % 360.0
        return float(heading) / 100.0 % 360.0

    @property
    def attitude(self) -> Attitude:
        """How it lies in the air."""
        told = self.telemetry.fields("ATTITUDE")
        return Attitude(told["roll"], told["pitch"], told["yaw"])

    @property
    def armed(self) -> bool:
        """Whether its motors may turn."""
        return bool(self.telemetry.fields("HEARTBEAT")["base_mode"] & ARMED)

    @property
    def mode(self) -> str:
        """The name of its flight mode."""
        beat = self.telemetry.fields("HEARTBEAT")
        return mode_name(beat["type"], beat["custom_mode"])

    @property
    def battery(self) -> Battery:
        """The battery that its autopilot watches."""
        told = self.telemetry.fields("SYS_STATUS")
        voltage, current = _scaled(told["voltage_battery"], 1000.0), _scaled(told["current_battery"], 100.0)
        return Battery(voltage, current, told["battery_remaining"])

    @property
    def gps(self) -> Gps:
        """Its first receiver."""
        told = self.telemetry.fields("GPS_RAW_INT")
        return Gps(told["fix_type"], told["satellites_visible"])

    @property
    def is_connected(self) -> bool:
        """Whether its heartbeats come."""
        try:
            self.telemetry.fields("HEARTBEAT")
        except Stale:
            return False
        return True

    async def status(self) -> Status:
        """Whether it can be flown, and why not."""
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
        """Home, and its altitude in m AMSL.

        Raises:
            NotFound: it has none yet.
        """
        told = await self._http.get("/telemetry/home_info")
        return Position(told["lat"], told["lon"], 0.0), float(told["altitude"])

    # -- up and down --------------------------------------------------------------------------------------

    async def arm(self, timeout: float | None = None) -> None:
        """Wait until it is ready, switch to GUIDED and arm."""
        await self._fly("GET", "/command/arm", {"timeout": timeout})
        await self._shows(lambda: self.armed)

    async def disarm(self, force: bool = False) -> None:
        """Disarm; in flight only with `force`: it falls."""
        await self._command("/command/disarm", force=force)
        await self._shows(lambda: not self.armed)

    async def takeoff(self, alt: float, timeout: float | None = None) -> None:
        """Climb to `alt` m above home."""
        await self._fly("GET", "/command/takeoff", {"alt": alt, "timeout": timeout})

    async def land(self, timeout: float | None = None, *, outlive: bool = False) -> None:
        """Land where it is, and disarm; with `outlive` a cancellation leaves it landing."""
        await self._outliving("/command/land", timeout, outlive)
        await self._shows(lambda: not self.armed)

    async def rtl(self, timeout: float | None = None, *, outlive: bool = False) -> None:
        """Return to launch, land there and disarm; with `outlive` a cancellation leaves it returning."""
        await self._outliving("/command/rtl", timeout, outlive)
        await self._shows(lambda: not self.armed)

    # -- modes and speeds ---------------------------------------------------------------------------------

    async def brake(self) -> None:
        """Stop at once, in BRAKE."""
        await self._command("/command/brake")

    async def guided(self) -> None:
        """Switch to GUIDED, in which it takes movements."""
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
        """Fly to a place; done on arrival.

        Args:
            target: where to.
            heading: degrees to point to on the way.
            look_at_target: point to where it goes; `heading` is stronger.
            tolerance: m, horizontally and vertically.
            timeout: s that it may take.
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
        """As `go_to`, to a place in m from its EKF origin."""
        body = {"x": target.north, "y": target.east, "z": target.down}
        more = {"heading": heading, "look_at_target": look_at_target, "tolerance": tolerance, "timeout": timeout}
        await self._fly("POST", "/movement/go_to_ned_wait", body={**body, **more})

    async def travel(self, velocity: Ned, duration: float | None = None, *, heading: float | None = None) -> None:
        """Fly at a velocity for `duration` s of its clock, then stop; without one until the task is cancelled."""
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
        """As `travel`, by the heading that it has at the beginning."""
        body = {"front": front, "right": right, "down": down, "heading": heading}
        await self._travel("/movement/travel_at_body", body, duration)

    async def _travel(self, path: str, body: dict[str, Any], duration: float | None) -> None:
        while duration is None:
            await self._fly("POST", path, body={**body, "duration": KEPT})
        await self._fly("POST", path, body={**body, "duration": duration})

    async def turn_to(self, heading: float) -> None:
        """Turn to `heading` degrees clockwise from north, the shorter way round."""
        await self._fly("GET", "/movement/set_heading", {"heading": heading % 360.0})
        await self._shows(lambda: abs((self.heading - heading + 180.0) % 360.0 - 180.0) <= TURNED)

    async def stop(self) -> None:
        """Hold still until `resume`."""
        await self._command("/movement/stop")

    async def resume(self) -> None:
        """Go on with what `stop` interrupted."""
        await self._command("/movement/resume")

    # -- how it is asked ----------------------------------------------------------------------------------

    async def _fly(
        self, method: str, path: str, query: dict[str, Any] | None = None, body: dict[str, Any] | None = None
    ) -> None:
        """A verb that ends when we hang up, which a cancellation does; the vehicle stops then."""
        await self._heard(self._http.ask(method, path, {**(query or {}), "on_disconnect": "hold"}, body))

    async def _command(self, path: str, **query: Any) -> None:
        """A verb that goes on when we hang up, and is short."""
        await self._heard(self._http.get(path, **query))

    async def _outliving(self, path: str, timeout: float | None, outlive: bool) -> None:
        """A verb that goes on when we hang up: a cancellation has to say so."""
        begun = asyncio.ensure_future(self._http.get(path, wait=False, timeout=timeout))
        try:
            job = (await self._heard(asyncio.shield(begun)))["job"]
            told = await self._heard(self._ended(job))
        except asyncio.CancelledError:
            if not outlive:
                with contextlib.suppress(UavApiError, asyncio.TimeoutError):  # it has just ended; it takes its time
                    await wait_with_timeout(ABORT_TIMEOUT, self._abort(begun))
            raise
        if told["error"] is not None:
            raise error_of(told["error"]["status"], told["error"])

    async def _ended(self, job: str) -> dict[str, Any]:
        """A job, once it has an outcome."""
        while True:
            told = await self._http.get(f"/jobs/{job}")
            if told["state"] != "running":
                return told
            await asyncio.sleep(LOOK_EVERY)

    async def _abort(self, begun: asyncio.Future[dict[str, Any]]) -> None:
        await self._http.ask("DELETE", f"/jobs/{(await begun)['job']}", {})

    async def _heard(self, answer: Awaitable[T]) -> T:
        """An answer; the API ends each wait itself, unless its machine or the network dies without a word.

        Raises:
            LinkLost: nothing is heard any more.
        """
        asking = asyncio.ensure_future(answer)
        try:
            while not (await asyncio.wait({asking}, timeout=1.0))[0]:
                silent_for = self.telemetry.age("HEARTBEAT") or 0.0
                if silent_for > SILENT:
                    raise LinkLost(f"nothing was heard of vehicle {self.id} or its API for {silent_for:.0f} s")
        finally:
            asking.cancel()
        return asking.result()

    async def _shows(self, condition: Callable[[], bool]) -> None:
        """The stream may come later than the answer; the answer is the proof."""
        await self.telemetry.shows(condition, SHOWN)


@contextlib.asynccontextmanager
async def connect(
    url: str, token: str | None = None, *, timeout: float = 30.0, max_age: float = MAX_AGE
) -> AsyncIterator[Drone]:
    """A vehicle's API, and the stream of what it tells.

    Args:
        url: of the API; `http://host:8000/vehicles/2` for one of several vehicles.
        token: where the API wants one; by default the environment's UAVAPI_TOKEN.
        timeout: s until the API must answer and the vehicle be heard.
        max_age: s after which properties raise `Stale`.

    Raises:
        Unreachable, NoVehicle, LinkLost: not within `timeout`.
        Unauthorized, Forbidden.
    """
    clock = asyncio.get_running_loop().time
    deadline = clock() + timeout
    async with Http(url, os.environ.get("UAVAPI_TOKEN", "") if token is None else token) as http:
        system = await _system(http, deadline)
        telemetry = Telemetry(http, system, max_age, clock)
        listening = asyncio.create_task(telemetry.run())
        drone = Drone(http, system, telemetry)
        try:
            if not await telemetry.shows(lambda: drone.is_connected, max(deadline - clock(), 1.0)):
                raise LinkLost(f"vehicle {system} was not heard within {timeout:g} s")
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
        await asyncio.sleep(LOOK_EVERY)
