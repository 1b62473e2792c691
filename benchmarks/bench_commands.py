"""From a request to the first message for it on the wire, in a real MAVProxy: alone, and while others stream.

The vehicle is a peer of our own, which acknowledges at once and shows what it was told; the kernel notes when each
datagram arrived at its socket. A try begins when the client writes its request, to a connection that is open: one
that served the tries before, or a fresh one. Between tries the pilot takes the vehicle, which ends whatever flies it.
The yardstick is an aiohttp handler that writes a message from a plain asyncio loop, in a process of its own.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import random
import socket
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from commands_vehicle import MODES, SYSTEM, TIMEOUT, Key, Vehicle
from figures import machine, percentile, put_first, table
from http_clients import Client
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rig import harness

from tests.support.ports import free_port

MEDIAN_GOAL, WORST_GOAL = 1.0, 10.0  # ms, the latter at the 99th percentile
STREAMERS = 4
STREAM_PERIOD = 0.05  # s
SHOWN = 0.01  # s in which the API surely sees what the vehicle shows; else it answers 504, which costs time only
BARE = "bare aiohttp"
YARDSTICK = mavlink.MAV_CMD_USER_1  # the command that the bare server sends
KEPT, FRESH = "kept", "fresh"  # connections
ALONE, STREAMED = "alone", f"{STREAMERS} stream"


# -- the other processes ----------------------------------------------------------------------------------


def _run_bare(port: int, vehicle: int) -> None:
    from aiohttp import web  # noqa: PLC0415  the other processes need none

    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    encoder = mavlink.MAVLink(None, srcSystem=255, srcComponent=230)

    async def answer(request: web.Request) -> web.Response:
        number = float(request.query["number"])
        message = mavlink.MAVLink_command_long_message(SYSTEM, 1, YARDSTICK, 0, number, 0, 0, 0, 0, 0, 0)
        out.sendto(message.pack(encoder), ("127.0.0.1", vehicle))
        return web.json_response({"device": "uav", "id": "1", "result": "sent"})

    app = web.Application()
    app.router.add_get("/command", answer)
    web.run_app(app, host="127.0.0.1", port=port, print=None, access_log=None)


async def _stream(port: int, streaming: threading.Event) -> None:
    client = Client(port)
    await client.open()
    while True:
        if streaming.is_set():
            await client.ask("/movement/travel_at_ned", {"vx": 1, "vy": 0, "vz": 0})
        await asyncio.sleep(STREAM_PERIOD)


def _run_streams(port: int, streaming: Any) -> None:
    async def all_of_them() -> None:
        await asyncio.gather(*(_stream(port, streaming) for _ in range(STREAMERS)))

    asyncio.run(all_of_them())


class Connection:
    """A blocking HTTP connection: less stands between a write and its time than in asyncio."""

    def __init__(self, port: int) -> None:
        self._port = port
        self.socket = socket.create_connection(("127.0.0.1", port), TIMEOUT)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._file = self.socket.makefile("rb")

    def send(self, method: str, path: str, body: Any = None) -> float:
        """Write a request; when (s of time.time()), as late as is surely before its last byte is readable."""
        content = b"" if body is None else json.dumps(body).encode()
        head = f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{self._port}\r\nContent-Length: {len(content)}\r\n"
        kind = "" if body is None else "Content-Type: application/json\r\n"
        request = f"{head}{kind}\r\n".encode() + content
        before = time.time()
        self.socket.sendall(request)
        return before

    def answer(self) -> tuple[int, Any]:
        """The status and the body of what was asked last."""
        status = int(self._file.readline().split()[1])
        length = 0
        while (line := self._file.readline().strip()) != b"":
            name, _, value = line.partition(b":")
            if name.lower() == b"content-length":
                length = int(value)
        return status, json.loads(self._file.read(length))

    def ask(self, method: str, path: str, body: Any = None) -> tuple[int, Any]:
        """Write a request and read its answer."""
        self.send(method, path, body)
        return self.answer()

    def close(self) -> None:
        """Hang up."""
        self._file.close()
        self.socket.close()


# -- tries ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Verb:
    """What is asked, from which state, and what its first message is.

    Attributes:
        method, path: of the request.
        key: of its first message; `number` is the try's.
        body: of the request.
        mode, armed, landed: what the vehicle shows before.
    """

    method: str
    path: str
    key: Callable[[int], Key]
    body: Callable[[int], Any] = lambda _: None
    mode: str = "GUIDED"
    armed: bool = True
    landed: bool = False


def _switches_to(mode: str) -> Callable[[int], Key]:
    return lambda _: (mavlink.MAV_CMD_DO_SET_MODE, 1.0, float(MODES[mode]))


def _commands(command: int, first: float) -> Callable[[int], Key]:
    return lambda _: (command, first, 0.0)


def _beyond(number: int) -> float:
    """What tells a try's setpoint from those of the others, and of the streams."""
    return 2.0 + number % 1000 / 100


ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
VERBS = {
    "land": Verb("GET", "/command/land", _switches_to("LAND")),
    "rtl": Verb("GET", "/command/rtl", _switches_to("RTL")),
    "brake": Verb("GET", "/command/brake", _switches_to("BRAKE")),
    "stop": Verb("GET", "/movement/stop", _commands(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0)),
    "disarm, forced": Verb("GET", "/command/disarm?force=true", _commands(ARM, 0.0)),
    # Of a takeoff on the ground: it is paused before it is told to rest.
    "DELETE of a job": Verb("DELETE", "/jobs/{job}", _commands(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0), landed=True),
    "guided": Verb("GET", "/command/guided", _switches_to("GUIDED"), mode="LOITER"),
    "arm": Verb("GET", "/command/arm", _commands(ARM, 1.0), armed=False, landed=True),
    "takeoff": Verb("GET", "/command/takeoff", _commands(mavlink.MAV_CMD_NAV_TAKEOFF, 0.0), landed=True),
    "go_to_ned": Verb(
        "POST",
        "/movement/go_to_ned",
        lambda number: ("place", round(_beyond(number), 3)),
        lambda number: {"x": _beyond(number), "y": 0, "z": -10},
    ),
    "travel_at_ned": Verb(
        "POST",
        "/movement/travel_at_ned",
        lambda number: ("velocity", round(_beyond(number), 3)),
        lambda number: {"vx": _beyond(number), "vy": 0, "vz": 0},
    ),
}


STOPS = ("land", "rtl", "brake", "stop", "disarm, forced", "DELETE of a job")


class Bench:
    """One run: the vehicle, MAVProxy with the API, and what was measured (s)."""

    def __init__(self, vehicle: Vehicle, api: int, bare: int, streaming: Any, seed: int) -> None:
        self._vehicle, self._api, self._bare = vehicle, api, bare
        self._streaming = streaming
        self._random = random.Random(seed)
        self._kept = {port: Connection(port) for port in (api, bare)}
        self._watching = Connection(api)
        self._number = 0
        self.times: defaultdict[tuple[str, str, str], list[float]] = defaultdict(list)  # by load, connection, verb

    def round(self, load: str, verbs: dict[str, Verb]) -> None:
        """Each of the verbs once by each kind of connection."""
        if load == STREAMED:
            self._streaming.set()
        for connection in (KEPT, FRESH):
            self.times[load, connection, BARE].append(self._yardstick(connection))
            for name, verb in verbs.items():
                self.times[load, connection, name].append(self._try(verb, connection))
        self._streaming.clear()

    def _yardstick(self, kind: str) -> float:
        self._number += 1
        self._pause()
        with self._connection(self._bare, kind) as connection:
            sent = connection.send("GET", f"/command?number={self._number}")
            arrived = self._vehicle.arrival((YARDSTICK, float(self._number), 0.0), connection.socket)
            connection.answer()
        assert arrived is not None, "the yardstick sent nothing"
        return arrived - sent

    def _try(self, verb: Verb, kind: str) -> float:
        self._number += 1
        self._vehicle.show(verb.mode, verb.armed, verb.landed)
        self._until_shown(verb.mode, verb.armed, verb.landed)
        path = verb.path.format(job=self._climb()) if "{job}" in verb.path else verb.path
        with self._connection(self._api, kind) as connection:
            self._pause()
            self._vehicle.forget()
            sent = connection.send(verb.method, path, verb.body(self._number))
            arrived = self._vehicle.arrival(verb.key(self._number), connection.socket)
            time.sleep(SHOWN)
            self._vehicle.show("LOITER")  # the pilot's: whatever flies it ends
            self._until_shown("LOITER", True, False)
            status, body = connection.answer()
            assert status in (200, 409, 504), body
        if arrived is None:  # a stream's setpoint came before it was sent, and supersedes it
            assert body.get("code") == "superseded", (verb, body)
            return self._try(verb, kind)
        return arrived - sent

    def _climb(self) -> str:
        """The number of a job that takes off, which no stream supersedes."""
        status, body = self._watching.ask("GET", "/command/takeoff?wait=false")
        assert status == 202, body
        return str(body["job"])

    def _pause(self) -> None:
        """Begin at any moment of what else goes on."""
        time.sleep(self._random.uniform(0, STREAM_PERIOD))

    def _until_shown(self, mode: str, armed: bool, landed: bool) -> None:
        def shown() -> bool:
            info = self._watching.ask("GET", "/telemetry/status")[1]["info"]
            on_ground = info["landed_state"] == "on_ground"
            return bool(info["mode"] == mode and info["armed"] == armed and on_ground == landed)

        given_up_at = time.monotonic() + TIMEOUT
        while not shown():
            assert time.monotonic() < given_up_at, f"the API does not see that the vehicle is in {mode}"
            time.sleep(0.002)

    @contextlib.contextmanager
    def _connection(self, port: int, kind: str) -> Iterator[Connection]:
        if kind == KEPT:
            yield self._kept[port]
            return
        fresh = Connection(port)
        try:
            yield fresh
        finally:
            fresh.close()

    def close(self) -> None:
        """Hang up."""
        for connection in (*self._kept.values(), self._watching):
            connection.close()


def report(times: dict[tuple[str, str, str], list[float]]) -> str:
    """The table: median and 99th percentile in ms, and how many times the yardstick's they are."""
    columns = [(load, connection) for load in (ALONE, STREAMED) for connection in (KEPT, FRESH)]
    rows = []
    for verb in dict.fromkeys(verb for _, _, verb in times):
        row = [verb]
        for column in columns:
            took, yardstick = (
                [percentile(times[(*column, one)], share) for share in (0.5, 0.99)] for one in (verb, BARE)
            )
            row.append(" / ".join(f"{one * 1e3:.2f}" for one in took))
            row.append(" / ".join(f"{one / bare:.1f}" for one, bare in zip(took, yardstick, strict=True)))
        rows.append(row)
    headings = ["50 / 99 % in ms"]
    for load, connection in columns:
        headings += [f"{load}, {connection}", "times bare"]
    return table(headings, rows)


def verdict(times: dict[tuple[str, str, str], list[float]]) -> tuple[bool, str]:
    """Whether every verb is within the goals, and a sentence that says so."""
    ours = [took for (_, _, verb), took in times.items() if verb != BARE]
    medians = [percentile(took, 0.5) * 1e3 for took in ours]
    worst = [percentile(took, 0.99) * 1e3 for took in ours]
    in_time = max(medians) <= MEDIAN_GOAL and max(worst) <= WORST_GOAL
    reported = f"{len(ours)} cases: medians up to {max(medians):.2f} ms, 99th percentiles up to {max(worst):.2f} ms"
    return in_time, f"{reported} (goals: {MEDIAN_GOAL:g} and {WORST_GOAL:g} ms): {'reached' if in_time else 'missed'}"


@contextlib.contextmanager
def mavproxy(vehicle: Vehicle) -> Iterator[Any]:
    """A MAVProxy with our module, that flies the peer."""
    with tempfile.TemporaryDirectory(prefix="uavapi-bench-") as directory:
        made = harness.Rig(Path(directory), free_port())
        listening = free_port()
        command = [*harness.MAVPROXY, f"--master=udp:127.0.0.1:{listening}", "--cmd=set param_ftp 0"]
        vehicle.find(listening)
        try:
            made.mavproxy = made.start("mavproxy", [*command, harness.load(made.port, max_rate=100000)])
            made.wait_until_up()
            made.mavproxy.says("Received", timeout=TIMEOUT)  # the parameters
            yield made
        finally:
            made.stop()


def main() -> int:
    """Run, print, and say whether the goals were reached."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tries", type=int, default=20, help="of each verb, load and kind of connection")
    parser.add_argument("--seed", type=int, default=1, help="of the moments of the tries")
    parser.add_argument("--way", type=float, default=0.0, help="s that a message takes to the vehicle, and from it")
    parser.add_argument("--stops", action="store_true", help="only what stops the vehicle")
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    parser.add_argument("--strict", action="store_true", help="fail when a goal is not reached")
    options = parser.parse_args()
    print(f"commands: {machine()}")
    context = multiprocessing.get_context("spawn")
    streaming = context.Event()
    vehicle, bare = Vehicle(options.way), free_port()
    verbs = {name: verb for name, verb in VERBS.items() if name in STOPS or not options.stops}
    others = [context.Process(target=_run_bare, args=(bare, vehicle.port), daemon=True)]
    try:
        with mavproxy(vehicle) as made:
            others.append(context.Process(target=_run_streams, args=(made.port, streaming), daemon=True))
            for process in others:
                process.start()
            if options.first:
                put_first(made.mavproxy.pid)
            harness.eventually(lambda: _is_up(bare), what="the bare server's start")
            bench = Bench(vehicle, made.port, bare, streaming, options.seed)
            for _ in range(options.tries):
                bench.round(ALONE, verbs)
                bench.round(STREAMED, verbs)
            bench.close()
            others[-1].terminate()  # some of its requests have no answer yet
            others[-1].join(TIMEOUT)
    finally:
        for process in others:
            if process.is_alive():
                process.terminate()
        vehicle.close()
    print(report(bench.times))
    in_time, sentence = verdict(bench.times)
    print(sentence + "\n")
    return 1 if options.strict and not in_time else 0


def _is_up(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
        return True
    return False


if __name__ == "__main__":
    sys.exit(main())
