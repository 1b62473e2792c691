"""The clients of a soak: verbs, reads, streams, hang-ups, garbage and nonsense, at random."""

from __future__ import annotations

import asyncio
import contextlib
import json
import random
import time
from collections.abc import Awaitable, Callable
from typing import Any

import aiohttp
from soak_notes import Notes

CLIENTS = 12
SLACK = 3.0  # s; a busy machine: the API itself ends a verb at its timeout
VERB_TIMEOUT = 60.0  # s for verbs without a deadline: an ack that says IN_PROGRESS may take 10 s each time
QUICK = 5.0  # s for reads; one that was never told is asked of the vehicle, for 2 s
KNOWN = {200, 202, 400, 404, 405, 408, 409, 413, 422, 429, 503, 504}
READS = ("general", "gps", "gps_raw", "ned", "attitude", "sys_status", "sensor_status", "battery_info", "error_info")
READS += ("home_info", "compass", "status", "message/HEARTBEAT", "message/NO_SUCH")
MODES = ("LOITER", "GUIDED", "STABILIZE", "ALT_HOLD", "BRAKE", "LAND", "RTL", "AUTO")
GARBAGE = (
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200),  # a TLS client at a plain port
    b"GET /command/arm HTTP/1.1\r\nHost: 127.0.0.1\r\nX-A: ",  # and no more
    b"GET /telemetry/gps HTTP/9.9\r\n\r\n",
    b"POST /movement/drive HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100000\r\n\r\n{",
    b"POST /movement/drive HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\nZZ\r\n",
    b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n",
    b"\r\n" * 1000,
    b"GET /telemetry/stream HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\r\n",
)


class Clients:
    """Clients that do random things until they are told to stop."""

    def __init__(self, port: int, notes: Notes, dice: random.Random) -> None:
        self._port, self._notes, self._dice = port, notes, dice
        self._url = f"http://127.0.0.1:{port}"
        self._acts: list[tuple[Callable[[], Awaitable[None]], int]] = [
            (self._verb, 10),
            (self._read, 20),
            (self._job, 4),
            (self._hang_up, 4),
            (self._garbage, 2),
            (self._nonsense, 3),
            (self._listen, 1),
            (self._web_socket, 1),
        ]

    async def run(self, seconds: float) -> None:
        """All clients, for so long."""
        end = time.monotonic() + seconds
        timeout = aiohttp.ClientTimeout(total=None)
        connector = aiohttp.TCPConnector(limit=0)
        async with aiohttp.ClientSession(timeout=timeout, connector=connector) as self._session:
            await asyncio.gather(self._pilot(end), *(self._one(end) for _ in range(CLIENTS)))

    async def _one(self, end: float) -> None:
        acts, weights = zip(*self._acts, strict=True)
        while time.monotonic() < end:
            await self._dice.choices(acts, weights)[0]()
            await asyncio.sleep(self._dice.uniform(0, 0.1))

    async def _ask(self, kind: str, method: str, path: str, bound: float, **options: Any) -> dict[str, Any]:
        """One request, which must be answered within `bound` s; the body of the answer, or nothing."""
        before = time.monotonic()
        body: dict[str, Any] = {}
        try:
            status, body = await asyncio.wait_for(self._fetch(method, path, options), bound)
            outcome = f"{status} {body.get('code', '')}".strip()
            self._judge(path, status, body)
        except asyncio.TimeoutError:
            outcome = "NO ANSWER"
            self._notes.fail(f"{method} {path} {options}: no answer within {bound:g} s")
        except (aiohttp.ClientError, ConnectionError):
            outcome = "no connection"  # the module is being reloaded
        self._notes.answered(kind, outcome, time.monotonic() - before)
        return body

    async def _pilot(self, end: float) -> None:
        """The client that wants to fly, again and again, however often it is thwarted."""
        while time.monotonic() < end:
            await self._ask("to fly: arm", "GET", "/command/arm?timeout=15", 15 + SLACK)
            await self._ask("to fly: takeoff", "GET", "/command/takeoff?alt=10&timeout=15", 15 + SLACK)
            for _ in range(3):
                x, y = self._dice.uniform(-30, 30), self._dice.uniform(-30, 30)
                body = {"x": x, "y": y, "z": -10, "timeout": 15}
                path = "/movement/go_to_ned_wait"
                await self._ask("to fly: go_to_ned_wait", "POST", path, 15 + SLACK, json=body)
            await asyncio.sleep(0.2)

    async def _fetch(self, method: str, path: str, options: dict[str, Any]) -> tuple[int, dict[str, Any]]:
        async with self._session.request(method, self._url + path, **options) as answer:
            return answer.status, json.loads(await answer.text())

    def _judge(self, path: str, status: int, body: dict[str, Any]) -> None:
        rejected = status == 500 and body.get("code") == "rejected" and "defect" not in str(body)
        if status not in KNOWN and not rejected:
            self._notes.fail(f"{path} answered {status}: {body}")

    def _some_verb(self) -> tuple[str, str, dict[str, Any], float]:
        """A verb: its method, path, options and bound."""
        dice = self._dice
        timeout = dice.choice((2, 5, 15))
        ned = {"x": dice.uniform(-60, 60), "y": dice.uniform(-60, 60), "z": dice.uniform(-30, -5)}
        bounded = timeout + SLACK
        choices: list[tuple[str, str, dict[str, Any], float]] = [
            ("GET", "/command/arm", {"params": {"timeout": timeout}}, bounded),
            ("GET", "/command/takeoff", {"params": {"alt": 10, "timeout": timeout}}, bounded),
            ("GET", "/command/land", {"params": {"timeout": timeout}}, bounded),
            ("GET", "/command/rtl", {"params": {"timeout": timeout}}, bounded),
            ("POST", "/movement/go_to_ned_wait", {"json": {**ned, "timeout": timeout}}, bounded),
            ("POST", "/movement/go_to_ned", {"json": ned}, VERB_TIMEOUT),
            ("POST", "/movement/drive_wait", {"json": {"x": 5, "y": 5, "z": 0, "timeout": timeout}}, bounded),
            ("POST", "/movement/drive", {"json": {"x": 5, "y": -5, "z": 0}}, VERB_TIMEOUT),
            ("POST", "/movement/travel_at_ned", {"json": {"vx": 1, "vy": 1, "vz": 0, "duration": 20}}, VERB_TIMEOUT),
            ("GET", "/command/brake", {}, VERB_TIMEOUT),
            ("GET", "/command/guided", {}, VERB_TIMEOUT),
            ("GET", "/command/set_mode", {"params": {"mode": dice.choice(MODES)}}, VERB_TIMEOUT),
            ("GET", "/command/disarm", {}, VERB_TIMEOUT),
            ("GET", "/movement/set_heading", {"params": {"heading": dice.randrange(360)}}, VERB_TIMEOUT),
            ("GET", "/movement/set_yaw_rate", {"params": {"yaw_rate": 10}}, VERB_TIMEOUT),
            ("GET", "/movement/stop", {}, VERB_TIMEOUT),
            ("GET", "/movement/resume", {}, VERB_TIMEOUT),
            ("GET", "/command/set_ground_speed", {"params": {"new_v": 5}}, VERB_TIMEOUT),
            ("GET", "/command/set_home", {}, VERB_TIMEOUT),
            ("POST", "/peripherical/servo_output", {"json": {"channel": 9, "pwm": 1500}}, VERB_TIMEOUT),
        ]
        # Those that take the vehicle from one another come less often, so that something is seen of each.
        return dice.choice(choices[:13] if dice.random() < 0.25 else choices[13:])

    async def _verb(self) -> None:
        method, path, options, bound = self._some_verb()
        await self._ask(path, method, path, bound, **options)

    async def _read(self) -> None:
        name = self._dice.choice(READS)
        # Home is asked of the vehicle, up to four times, and an ack must not be all that comes.
        await self._ask("reads", "GET", f"/telemetry/{name}", QUICK + 10 if name == "home_info" else QUICK)

    async def _job(self) -> None:
        """A verb whose number is taken, looked at, and perhaps aborted."""
        method, path, options, bound = self._some_verb()
        body = await self._ask("with wait=false", method, f"{path}?wait=false", bound, **options)
        number = body.get("job")
        if number is None:
            return
        await asyncio.sleep(self._dice.uniform(0, 1))
        await self._ask("GET /jobs/N", "GET", f"/jobs/{number}", QUICK)
        if self._dice.random() < 0.7:
            await self._ask("DELETE /jobs/N", "DELETE", f"/jobs/{number}", VERB_TIMEOUT)

    async def _hang_up(self) -> None:
        """A verb whose client goes away."""
        method, path, options, _ = self._some_verb()
        requested = asyncio.ensure_future(self._session.request(method, self._url + path, **options))
        await asyncio.sleep(self._dice.uniform(0, 0.5))
        requested.cancel()
        with contextlib.suppress(asyncio.CancelledError, aiohttp.ClientError, ConnectionError):
            (await requested).close()
        self._notes.events["hang-ups"] += 1

    async def _garbage(self) -> None:
        """Bytes that are no HTTP, or not all of it."""
        with contextlib.suppress(ConnectionError):
            reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
            writer.write(self._dice.choice([*GARBAGE, self._dice.randbytes(500)]))
            with contextlib.suppress(asyncio.TimeoutError, ConnectionError):
                await asyncio.wait_for(reader.read(1000), self._dice.uniform(0, 2))
            writer.close()
        self._notes.events["garbage"] += 1

    async def _nonsense(self) -> None:
        """HTTP as it should be, with parameters that are not."""
        bodies: list[dict[str, Any]] = [
            {"data": b"{" * 5000},
            {"data": b"\xff\xfe"},
            {"json": [1, 2, 3]},
            {"json": {"x": "NaN", "y": 1e308, "z": None}},
            {"data": b'{"x": NaN, "y": Infinity, "z": -1e999}'},
        ]
        await self._ask("nonsense", "POST", "/movement/go_to_ned_wait", QUICK, **self._dice.choice(bodies))

    async def _listen(self) -> None:
        """A stream's client that hears for a while."""
        with contextlib.suppress(aiohttp.ClientError, ConnectionError):
            async with self._session.get(self._url + "/telemetry/stream") as answer:
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(answer.content.readexactly(10_000_000), self._dice.uniform(0, 5))
        self._notes.events["streams"] += 1

    async def _web_socket(self) -> None:
        """The same by WebSocket, which may not read what it gets."""
        with contextlib.suppress(aiohttp.ClientError, ConnectionError):
            async with self._session.ws_connect(self._url + "/telemetry/stream?names=ATTITUDE") as socket:
                if self._dice.random() < 0.5:
                    with contextlib.suppress(asyncio.TimeoutError):
                        await socket.receive(self._dice.uniform(0, 3))
                else:
                    await asyncio.sleep(self._dice.uniform(0, 3))
        self._notes.events["WebSockets"] += 1
