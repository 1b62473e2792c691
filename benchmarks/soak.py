"""A chaos run: random clients, faults, a pilot, module reloads; at the end nothing may be left over.

    python benchmarks/soak.py --minutes 10 [--seed N]

Real processes throughout: the embedded vehicle with its faults, a MAVProxy, and clients by TCP. It fails when a
request was not answered within its bound, when an answer names a defect of ours, when MAVProxy's log holds a
traceback, or when MAVProxy keeps jobs, threads, descriptors, child processes or memory.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import aiohttp
from rig import harness, machine, table

from tests.support.ports import free_port

SPEEDUP = 10
CLIENTS = 12
WARM_UP = 120.0  # s of chaos before memory counts
RSS_ALLOWED = 5.0  # MB
SLACK = 3.0  # s; a busy machine: the API itself ends a verb at its timeout
PATIENT = 60.0  # s for verbs without a deadline: an ack that says IN_PROGRESS may take 10 s each time
QUICK = 5.0  # s for reads; one that was never told is asked of the vehicle, for 2 s
QUIET = 90.0  # s in which everything must come to rest
BAD_WORDS = ("Traceback", "defect in", "defect of this program", "Task was destroyed", "never retrieved")
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


# -- what is noted ----------------------------------------------------------------------------------------


@dataclass
class Notes:
    """What happened: how often each kind of request ended how, how long it took, and what must not be."""

    outcomes: dict[str, Counter[str]] = field(default_factory=dict)
    slowest: dict[str, float] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    events: Counter[str] = field(default_factory=Counter)

    def answered(self, kind: str, outcome: str, seconds: float) -> None:
        """A request of that kind ended."""
        self.outcomes.setdefault(kind, Counter())[outcome] += 1
        self.slowest[kind] = max(self.slowest.get(kind, 0.0), seconds)

    def fail(self, what: str) -> None:
        """Something that must not be."""
        print(f"  FAILURE: {what}", flush=True)
        self.failures.append(what)

    def summary(self) -> str:
        """All as a table."""
        rows = []
        for kind, counts in sorted(self.outcomes.items()):
            reported = ", ".join(f"{outcome} {count}" for outcome, count in counts.most_common())
            rows.append([kind, str(sum(counts.values())), f"{self.slowest[kind]:.1f}", reported])
        happened = ", ".join(f"{name} {count}" for name, count in sorted(self.events.items()))
        return f"{table(['requests', 'count', 'slowest s', ''], rows)}\nmeanwhile: {happened}"


@dataclass(frozen=True)
class Usage:
    """What MAVProxy holds."""

    rss: float  # MB
    threads: int
    descriptors: int
    children: int

    @classmethod
    def of(cls, pid: int) -> Usage:
        """Of a process."""
        lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
        status = dict(line.split(":", 1) for line in lines)
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
        rss = int(status["VmRSS"].split()[0]) / 1024
        return cls(rss, int(status["Threads"]), len(os.listdir(f"/proc/{pid}/fd")), len(children))

    def __str__(self) -> str:
        return f"{self.rss:.1f} MB, {self.threads} threads, {self.descriptors} descriptors, {self.children} children"


# -- the clients ------------------------------------------------------------------------------------------


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
            ("POST", "/movement/go_to_ned", {"json": ned}, PATIENT),
            ("POST", "/movement/drive_wait", {"json": {"x": 5, "y": 5, "z": 0, "timeout": timeout}}, bounded),
            ("POST", "/movement/drive", {"json": {"x": 5, "y": -5, "z": 0}}, PATIENT),
            ("POST", "/movement/travel_at_ned", {"json": {"vx": 1, "vy": 1, "vz": 0, "duration": 20}}, PATIENT),
            ("GET", "/command/brake", {}, PATIENT),
            ("GET", "/command/guided", {}, PATIENT),
            ("GET", "/command/set_mode", {"params": {"mode": dice.choice(MODES)}}, PATIENT),
            ("GET", "/command/disarm", {}, PATIENT),
            ("GET", "/movement/set_heading", {"params": {"heading": dice.randrange(360)}}, PATIENT),
            ("GET", "/movement/set_yaw_rate", {"params": {"yaw_rate": 10}}, PATIENT),
            ("GET", "/movement/stop", {}, PATIENT),
            ("GET", "/movement/resume", {}, PATIENT),
            ("GET", "/command/set_ground_speed", {"params": {"new_v": 5}}, PATIENT),
            ("GET", "/command/set_home", {}, PATIENT),
            ("POST", "/peripherical/servo_output", {"json": {"channel": 9, "pwm": 1500}}, PATIENT),
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
            await self._ask("DELETE /jobs/N", "DELETE", f"/jobs/{number}", PATIENT)

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


# -- what happens to them ---------------------------------------------------------------------------------


class Trouble:
    """The vehicle's faults, a pilot at MAVProxy's prompt, and somebody who reloads the module."""

    def __init__(self, rig: Any, notes: Notes, dice: random.Random) -> None:
        self._rig, self._notes, self._dice = rig, notes, dice

    def _some_fault(self) -> dict[str, Any]:
        """A fault; its times are simulated ones, ten times as fast as ours."""
        dice = self._dice
        count = dice.randrange(1, 4)
        acks = {"command": "all", "count": count}
        return dice.choice(
            [
                {"name": "silence", "seconds": dice.choice((5, 20, 80)), "receiving": dice.random() < 0.5},
                {"name": "lose_acks", **acks},
                {"name": "delay_acks", **acks, "seconds": dice.uniform(1, 30)},
                {"name": "foreign_ack", **acks, "result": 0},
                {"name": "refuse", **acks, "result": dice.choice((1, 2, 4)), "text": "PreArm: soaked"},
                {"name": "in_progress", **acks, "seconds": dice.uniform(1, 30)},
                {"name": "freeze_gps", "seconds": dice.uniform(1, 50)},
                {"name": "pilot_mode", "mode": dice.choice(("LOITER", "ALT_HOLD", "LAND", "GUIDED"))},
                {"name": "pilot_disarm"},
                {"name": "ekf_bad", "seconds": dice.uniform(1, 50)},
                {"name": "reboot"},
            ]
        )

    async def faults(self) -> None:
        """A fault every second or so, and relief now and then."""
        while True:
            fault = self._some_fault()
            with contextlib.suppress(AssertionError):  # the vehicle refuses some modes at some times
                self._rig.control.fault(**fault)
                self._notes.events[fault["name"]] += 1
            await asyncio.sleep(self._dice.uniform(0.5, 5))
            if self._dice.random() < 0.4:
                self._rig.control.ask("clear")

    async def pilot(self) -> None:
        """Somebody at the prompt."""
        lines = [f"mode {mode}" for mode in MODES] + ["uavapi status", "uavapi log 3", "uavapi config", "uavapi x"]
        while True:
            self._rig.mavproxy.type(self._dice.choice(lines))
            self._notes.events["lines typed"] += 1
            await asyncio.sleep(self._dice.uniform(1, 8))

    async def reloads(self) -> None:
        """Somebody who reloads, unloads, loads, stops, starts and sets."""
        ways = [("module reload uavapi",), ("module unload uavapi", "module load uavapi")]
        ways += [("uavapi stop", "uavapi start"), ("uavapi set max_age 4", "uavapi set max_age 5")]
        while True:
            await asyncio.sleep(self._dice.uniform(5, 25))
            way = self._dice.choice(ways)
            for line in way:
                self._rig.mavproxy.type(line)
                await asyncio.sleep(self._dice.uniform(0.5, 2))
            self._notes.events[way[0]] += 1


class Soak:
    """The run: warm up, measure, chaos, measure."""

    def __init__(self, rig: Any, notes: Notes, seed: int) -> None:
        self._rig, self._notes = rig, notes
        self._dice = random.Random(seed)

    async def run(self, seconds: float) -> None:
        """All of it."""
        print(f"  at the start: {self._usage()}", flush=True)
        await self._chaos(WARM_UP)
        before = await self._at_rest()
        print(f"  warm: {before}", flush=True)
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            await self._chaos(min(left, 60.0))
            print(f"  {left:4.0f} s to go: {self._usage()}, {len(self._notes.failures)} failures", flush=True)
        after = await self._at_rest()
        print(f"  at the end: {after}", flush=True)
        self._compare(before, after)

    def _usage(self) -> Usage:
        return Usage.of(self._rig.mavproxy.pid)

    async def _chaos(self, seconds: float) -> None:
        for line in ("module load uavapi", "uavapi start"):  # whoever reloads may have been stopped half-way
            self._rig.mavproxy.type(line)
        trouble = Trouble(self._rig, self._notes, self._dice)
        troubles = [asyncio.ensure_future(one()) for one in (trouble.faults, trouble.pilot, trouble.reloads)]
        await Clients(self._rig.port, self._notes, self._dice).run(seconds)
        for task in troubles:
            if task.done():
                task.result()
            task.cancel()
        await asyncio.gather(*troubles, return_exceptions=True)

    async def _at_rest(self) -> Usage:
        """What MAVProxy holds when nobody asks for anything: faults over, module freshly loaded, no job running."""
        self._rig.control.ask("clear")
        self._rig.mavproxy.ask("module unload uavapi", "module uavapi", QUIET)
        self._rig.mavproxy.ask("module load uavapi", "listening on", QUIET)
        with contextlib.suppress(AssertionError):
            harness.eventually(lambda: self._running() == [], QUIET, "the end of all jobs")
        if self._running() != []:
            self._notes.fail(f"jobs are left over: {self._running()}")
        await asyncio.sleep(12)  # idle connections and slow headers run into their time limits
        return self._usage()

    def _running(self) -> list[dict[str, Any]] | None:
        try:
            jobs = self._rig.ok(self._rig.get("/jobs"))["jobs"]
        except OSError:  # nobody listens
            return None
        return [job for job in jobs if job["state"] == "running"]

    def _compare(self, before: Usage, after: Usage) -> None:
        if after.rss > before.rss + RSS_ALLOWED:
            self._notes.fail(f"memory grew by {after.rss - before.rss:.1f} MB")
        for name in ("threads", "descriptors", "children"):
            if getattr(after, name) > getattr(before, name):
                self._notes.fail(f"{name}: {getattr(before, name)} before, {getattr(after, name)} after")


def start(directory: Path) -> Any:
    """The vehicle, and a MAVProxy whose module finds its port in the environment, however it is loaded."""
    rig = harness.Rig(directory, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=SPEEDUP)
        command = harness.mavproxy_command(instance, "--cmd=module load uavapi")
        environment = {"UAVAPI_PORT": str(rig.port), "UAVAPI_MAX_RATE": "5000"}
        rig.mavproxy = rig.start("mavproxy", command, environment)
        rig.wait_until_up()
    except BaseException:
        rig.stop()
        raise
    return rig


def main() -> int:
    """Run, print a summary, and say whether all was well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    parser.add_argument("--keep", type=Path, help="a new folder, which keeps MAVProxy's log")
    options = parser.parse_args()
    if options.keep is not None and options.keep.exists():
        parser.error(f"{options.keep} is there already")
    print(f"soak: {options.minutes:g} min, seed {options.seed}; {machine()}", flush=True)
    notes = Notes()
    with tempfile.TemporaryDirectory(prefix="uavapi-soak-") as temporary:
        directory = options.keep or Path(temporary)
        directory.mkdir(parents=True, exist_ok=options.keep is None)
        rig = start(directory)
        try:
            asyncio.run(Soak(rig, notes, options.seed).run(options.minutes * 60))
            if rig.mavproxy.popen.poll() is not None:
                notes.fail("MAVProxy ended")
        finally:
            rig.stop()
            look_for_bad_words(rig.mavproxy.output(), notes)
            print(notes.summary())
    print(f"{len(notes.failures)} failures" if notes.failures else "all is well")
    return 1 if notes.failures else 0


def look_for_bad_words(log: str, notes: Notes) -> None:
    """What no log may hold; of several alike the first one is told in full."""
    lines = log.splitlines()
    seen: Counter[str] = Counter()
    for number, line in enumerate(lines):
        if not any(word in line for word in BAD_WORDS):
            continue
        last = next((one for one in lines[number + 1 :] if one[:1].isalpha() and not one.startswith("During")), "")
        seen[last] += 1
        if seen[last] == 1:
            notes.fail("in MAVProxy's log:\n    " + "\n    ".join(lines[max(number - 1, 0) : number + 40]))
    for last, count in seen.items():
        print(f"  {count} x {last}")


if __name__ == "__main__":
    sys.exit(main())
