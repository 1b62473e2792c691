"""A vehicle behind a scripted API, at real sockets and in real time: its host has threads of its own."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from aiohttp import WSMsgType, web

from mavproxy_uavapi.aerpaw.drone import Drone
from mavproxy_uavapi.aerpaw.rover import Rover

GUIDED, LOITER, LAND = 4, 5, 9
MODES = {GUIDED: "GUIDED", LOITER: "LOITER", LAND: "LAND"}
PLACE = (35.0, -78.0)
EVERY = 0.02  # s between two tellings


class FakeApi:
    """What a script's vehicle needs of the API.

    Attributes:
        armed, mode, alt, yaw, place: of the vehicle (m above home, degrees).
        requested: method, path and parameters of the verbs, as they came.
        refusals: by path, the status and body that a verb gets instead.
        takes: by path, s that a verb takes, or an event that it waits for; for ever with None.
        why_not: reasons why it cannot be armed.
        delays: by path, s until a request of that path reaches the verb, as on a slow machine.
        begun: paths of verbs in the order in which they took the vehicle.
        gone: paths of verbs whose client hung up.
    """

    def __init__(self) -> None:
        self.armed, self.mode, self.alt, self.yaw = False, LOITER, 0.0, 0.0
        self.place = PLACE
        self.requested: list[tuple[str, str, dict[str, Any]]] = []
        self.refusals: dict[str, tuple[int, dict[str, Any]]] = {}
        self.takes: dict[str, float | threading.Event | None] = {}
        self.delays: dict[str, float] = {}
        self.begun: list[str] = []
        self.gone: list[str] = []
        self.why_not: list[str] = []
        self.sending = True
        self.url = ""
        self._jobs: dict[str, dict[str, Any]] = {}
        self._failing: dict[str, asyncio.Event] = {}
        self._commander: dict[str, Any] | None = None
        self._loop = asyncio.new_event_loop()
        self._up = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._thread.start()
        assert self._up.wait(60)

    def stop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(60)
        self._loop.run_until_complete(self._runner.cleanup())
        self._loop.close()

    def verbs(self) -> list[str]:
        return [path for _, path, _ in self.requested]

    def last(self, path: str) -> dict[str, Any]:
        return [values for _, requested, values in self.requested if requested == path][-1]

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._serve())
        self._up.set()
        self._loop.run_forever()

    async def _serve(self) -> None:
        app = web.Application()
        app.router.add_get("/telemetry/status", self._status)
        app.router.add_get("/telemetry/home_info", self._home)
        app.router.add_get("/telemetry/stream", self._stream)
        app.router.add_get("/authority", self._authority)
        app.router.add_get("/jobs/{id}", self._job)
        app.router.add_delete("/jobs/{id}", self._job)
        app.router.add_route("*", "/{path:.*}", self._verb)
        self._runner = web.AppRunner(app, handler_cancellation=True, shutdown_timeout=0.1)
        await self._runner.setup()
        site = web.TCPSite(self._runner, "127.0.0.1", 0)
        await site.start()
        self.url = f"http://127.0.0.1:{self._runner.addresses[0][1]}"

    async def _status(self, _: web.Request) -> web.Response:
        info = {
            "vehicle_type": "copter",
            "mode": MODES[self.mode],
            "armed": self.armed,
            "landed_state": "in_air" if self.alt > 0 else "on_ground",
            "link": {"alive": True},
            "ekf_ok": True,
            "ready_to_arm": not self.why_not,
            "why_not": self.why_not,
        }
        return web.json_response({"id": "7", "result": "success", "info": info})

    async def _home(self, _: web.Request) -> web.Response:
        return web.json_response({"id": "7", "lat": PLACE[0], "lon": PLACE[1], "altitude": 90.5})

    async def _stream(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse()
        await socket.prepare(request)
        reading = asyncio.ensure_future(socket.receive())
        while not (reading.done() and reading.result().type in (WSMsgType.CLOSE, WSMsgType.CLOSED)):
            if self.sending:
                for name, fields in self._messages().items():
                    await socket.send_str(json.dumps({"name": name, "component": 1, "fields": fields}))
            await asyncio.sleep(EVERY)
        return socket

    def _messages(self) -> dict[str, dict[str, Any]]:
        lat, lon = (round(degrees * 1e7) for degrees in self.place)
        place = {"lat": lat, "lon": lon, "relative_alt": round(self.alt * 1000), "vx": 150, "vy": 0, "vz": 0}
        battery = {"voltage_battery": 12600, "current_battery": 150, "battery_remaining": 88}
        return {
            "HEARTBEAT": {"type": 2, "autopilot": 3, "base_mode": 128 * self.armed, "custom_mode": self.mode},
            "GLOBAL_POSITION_INT": {**place, "hdg": round(self.yaw * 100)},
            "ATTITUDE": {"roll": 0.1, "pitch": -0.2, "yaw": 0.3},
            "SYS_STATUS": battery,
            "GPS_RAW_INT": {"fix_type": 6, "satellites_visible": 11},
        }

    async def _verb(self, request: web.Request) -> web.Response:
        path = request.path
        values = {**request.query, **(await request.json() if request.can_read_body else {})}
        self.requested.append((request.method, path, values))
        await asyncio.sleep(self.delays.get(path, 0.0))
        if path in self.refusals:
            status, body = self.refusals[path]
            return web.json_response(body, status=status)
        number = str(len(self._jobs) + 1)
        job = {"job": number, "verb": path, "request": values, "state": "running", "error": None}
        self._jobs[number] = job
        if values.get("wait") == "false":
            takes = self.takes.get(path, 0.0)
            self._loop.call_later(takes if isinstance(takes, float) else 0.0, self._obey, job)
            return web.json_response({"id": "7", "job": number}, status=202)
        self.begun.append(path)
        self._commander = job
        working = asyncio.ensure_future(self._work(self.takes.get(path, 0.0)))
        failing = asyncio.ensure_future(self._failing.setdefault(path, asyncio.Event()).wait())
        try:
            await asyncio.wait({working, failing}, return_when=asyncio.FIRST_COMPLETED)
        except asyncio.CancelledError:
            self.gone.append(path)
            raise
        finally:
            working.cancel()
            failing.cancel()
        if failing.done():
            status, body = self.refusals[path]
            return web.json_response(body, status=status)
        self._obey(job)
        return web.json_response({"id": "7", "result": "done"})

    def fail(self, path: str, status: int, body: dict[str, Any]) -> None:
        """End the running verb of that path with that answer, as the API does when the pilot has the vehicle."""
        self.refusals[path] = status, body
        self._loop.call_soon_threadsafe(self._failing[path].set)

    async def _work(self, takes: float | threading.Event | None) -> None:
        if isinstance(takes, threading.Event):
            while not takes.is_set():  # noqa: ASYNC110  the test's thread sets it
                await asyncio.sleep(EVERY)
        else:
            await asyncio.sleep(3600 if takes is None else takes)

    def _obey(self, job: dict[str, Any]) -> None:
        job["state"], path, values = "succeeded", job["verb"], job["request"]
        if path == "/command/arm":
            self.armed, self.mode = True, GUIDED
        elif path == "/command/set_mode":
            self.mode = GUIDED
        elif path == "/command/takeoff":
            self.alt = float(values["alt"])
        elif path in ("/command/land", "/command/rtl", "/command/disarm"):
            self.armed, self.alt, self.mode = False, 0.0, LAND
        elif path == "/movement/set_heading":
            self.yaw = float(values["heading"])

    async def _job(self, request: web.Request) -> web.Response:
        self.requested += [("DELETE", request.path, {})] if request.method == "DELETE" else []
        return web.json_response(self._jobs[request.match_info["id"]])

    async def _authority(self, _: web.Request) -> web.Response:
        return web.json_response({"id": "7", "vehicles": [{"vehicle": 7, "commanded_by": self._commander}]})


@pytest.fixture
def api() -> Iterator[FakeApi]:
    """The scripted API."""
    made = FakeApi()
    made.start()
    yield made
    made.stop()


@pytest.fixture
def vehicle(api: FakeApi) -> Iterator[Callable[[type[Any]], Any]]:
    """Makes vehicles of a type at that API."""
    made: list[Any] = []

    def make(kind: type[Any]) -> Any:
        made.append(kind(api.url))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def drone(vehicle: Callable[[type[Any]], Any]) -> Drone:
    """A Drone, on the ground."""
    return vehicle(Drone)


@pytest.fixture
def flying(api: FakeApi, drone: Drone) -> Drone:
    """A Drone, 10 m above home in GUIDED."""
    api.armed, api.mode, api.alt = True, GUIDED, 10.0
    drone._is_ours = True
    wait = threading.Event()
    while not (drone.armed and drone.position.alt == 10.0):
        wait.wait(EVERY)
    return drone


@pytest.fixture
def rover(api: FakeApi, vehicle: Callable[[type[Any]], Any]) -> Rover:
    """A Rover, armed in GUIDED."""
    api.armed, api.mode = True, GUIDED
    return vehicle(Rover)
