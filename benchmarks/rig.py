"""What the benchmarks share: real processes, a tap on the vehicle's link, cheap HTTP clients, and numbers.

The processes are those of the end-to-end tests.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import multiprocessing
import os
import selectors
import socket
import struct
import sys
import tempfile
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
BACKLOG = 1 << 16
SO_TIMESTAMPNS = 35  # Linux's: the kernel says when a datagram arrived, however late we read it
TOO_MANY = 429
MAVLINK2 = 0xFD
SIGNED = 1  # incompatibility flag: 13 bytes of signature follow


sys.path.insert(0, str(ROOT))  # for `tests.support`, whose processes these are

from tests.support import processes as harness  # noqa: E402
from tests.support.ports import free_port  # noqa: E402

# The harness gives each worker of pytest-xdist ports of its own: ours must not be those of a test run.
os.environ.setdefault("PYTEST_XDIST_WORKER", f"gw{10 + os.getpid() % 15}")


@contextlib.contextmanager
def rig(*, outs: tuple[str, ...] = (), streamrate: int = 4, **settings: Any) -> Iterator[tuple[Any, Tap]]:
    """The embedded vehicle, a tap, and a MAVProxy with our module behind it.

    Args:
        outs: MAVProxy's `--out` addresses.
        streamrate: Hz that MAVProxy asks for.
        settings: of our module.
    """
    with tempfile.TemporaryDirectory(prefix="uavapi-bench-") as directory:
        made = harness.Rig(Path(directory), free_port())
        tap = None
        try:
            instance = harness.start_embedded(made, speedup=1)
            tap = Tap(5760 + 10 * instance)
            command = [*harness.MAVPROXY, f"--master=tcp:127.0.0.1:{tap.port}", f"--streamrate={streamrate}"]
            command += [f"--out={out}" for out in outs]
            made.mavproxy = made.start("mavproxy", [*command, harness.load(made.port, **settings)])
            made.wait_until_up()
            yield made, tap
        finally:
            made.stop()
            if tap is not None:
                tap.close()


def fly(rig: Any, alt: float = 10.0) -> None:
    """Get it into the air, in GUIDED; its estimator settles at ten times the speed, the rest is at speed 1.

    Armed and on the ground it disarms after 10 s of its own, which a busy machine may need for a request.
    """
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=10))
    harness.eventually(lambda: rig.status()["ready_to_arm"], 120, "getting ready to arm")
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=1))
    rig.in_the_air(alt)


# -- the tap ----------------------------------------------------------------------------------------------


class Frames:
    """Cuts a byte stream into MAVLink 2 frames."""

    def __init__(self) -> None:
        self._bytes = b""

    def cut(self, data: bytes) -> list[bytes]:
        """The frames that `data` completes."""
        self._bytes += data
        frames = []
        while True:
            start = self._bytes.find(MAVLINK2)
            if start < 0 or len(self._bytes) < start + 3:
                return frames
            end = start + 12 + self._bytes[start + 1] + (13 if self._bytes[start + 2] & SIGNED else 0)
            if len(self._bytes) < end:
                return frames
            frames.append(self._bytes[start:end])
            self._bytes = self._bytes[end:]


def message_id(frame: bytes) -> int:
    """A MAVLink 2 frame's message number."""
    return int.from_bytes(frame[7:10], "little")


class Tap:
    """Stands between a vehicle and MAVProxy, passes all on, and tells its listeners each frame and its time.

    Args:
        vehicle: the vehicle's TCP port.

    Attributes:
        from_vehicle, to_vehicle: called in the tap's thread with the time (s, of time.time) and the frame.
    """

    def __init__(self, vehicle: int) -> None:
        self._vehicle = vehicle
        self._selector = selectors.DefaultSelector()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._selector.register(self._listening, selectors.EVENT_READ, self._accept)
        self._wake, self._woken = socket.socketpair()
        self._selector.register(self._woken, selectors.EVENT_READ, None)
        self.from_vehicle: Callable[[float, bytes], None] = lambda _at, _frame: None
        self.to_vehicle: Callable[[float, bytes], None] = lambda _at, _frame: None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def watch(self, sock: socket.socket, read: Callable[[], None]) -> None:
        """Have the tap's thread read a further socket."""
        self._selector.register(sock, selectors.EVENT_READ, read)

    def _run(self) -> None:
        while True:
            for key, _ in self._selector.select():
                if key.data is None:
                    return
                key.data()

    def _accept(self) -> None:
        near, _ = self._listening.accept()
        far = socket.create_connection(("127.0.0.1", self._vehicle))
        for one in (near, far):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._pour(far, near, "from_vehicle")
        self._pour(near, far, "to_vehicle")

    def _pour(self, source: socket.socket, sink: socket.socket, listener: str) -> None:
        frames = Frames()

        def read() -> None:
            try:
                data = source.recv(BACKLOG)
            except OSError:
                data = b""
            if not data:
                self._selector.unregister(source)
                with contextlib.suppress(OSError):
                    sink.shutdown(socket.SHUT_WR)
                source.close()
                return
            at = time.time()
            with contextlib.suppress(OSError):
                sink.sendall(data)
            for frame in frames.cut(data):
                getattr(self, listener)(at, frame)

        self._selector.register(source, selectors.EVENT_READ, read)

    def close(self) -> None:
        """End the thread and close everything."""
        self._wake.send(b"\0")
        self._thread.join()
        for key in list(self._selector.get_map().values()):
            key.fileobj.close()  # type: ignore[union-attr]
        self._selector.close()
        self._wake.close()


class Forwarding:
    """Delays between a tap and MAVProxy's `--out`: the same bytes, seen on both sides."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.bind(("127.0.0.1", 0))
        self.port = int(self._socket.getsockname()[1])
        self._sent: defaultdict[bytes, deque[float]] = defaultdict(deque)
        self.delays: list[tuple[float, float]] = []  # at (s), delay (s)

    def attach(self, tap: Tap) -> None:
        """Begin to listen on both sides."""
        tap.from_vehicle = lambda at, frame: self._sent[frame].append(at)
        tap.watch(self._socket, self._read)

    def _read(self) -> None:
        data, ancillary, _, _ = self._socket.recvmsg(BACKLOG, 64)
        seconds, nanoseconds = struct.unpack("ll", ancillary[0][2][:16])
        sent = self._sent.get(data)
        if sent:
            at = sent.popleft()
            self.delays.append((at, seconds + nanoseconds / 1e9 - at))

    def between(self, start: float, end: float) -> list[float]:
        """The delays (s) of what the vehicle sent from `start` to `end`."""
        return [delay for at, delay in list(self.delays) if start <= at < end]

    def lost(self, start: float, end: float) -> int:
        """How many of the vehicle's messages of that time never came out."""
        return sum(start <= at < end for waiting in list(self._sent.values()) for at in list(waiting))


# -- HTTP clients -----------------------------------------------------------------------------------------


class Client:
    """One keep-alive connection that costs as little as an HTTP client in Python can.

    Args:
        port: where to, on the loopback.
        headers: whole lines that every request has.
    """

    def __init__(self, port: int, headers: str = "") -> None:
        self._port = port
        self._host = f"Host: 127.0.0.1:{port}\r\n{headers}".encode()

    async def open(self) -> None:
        """Connect."""
        self._reader, self._writer = await asyncio.open_connection("127.0.0.1", self._port)

    async def ask(self, path: str, body: Any = None) -> tuple[int, bytes]:
        """One request; its status and body. With `body`, a POST of that as JSON."""
        content = b"" if body is None else json.dumps(body).encode()
        method = b"GET " if body is None else b"POST "
        head = b"" if body is None else b"Content-Type: application/json\r\nContent-Length: %d\r\n" % len(content)
        self._writer.write(method + path.encode() + b" HTTP/1.1\r\n" + self._host + head + b"\r\n" + content)
        answer = await self._reader.readuntil(b"\r\n\r\n")
        length = int(answer.lower().partition(b"content-length:")[2].partition(b"\r")[0] or 0)
        return int(answer[9:12]), await self._reader.readexactly(length)

    def close(self) -> None:
        """Hang up."""
        self._writer.close()


async def poll(port: int, path: str, seconds: float, times: list[float]) -> None:
    """Read `path` again and again on one connection; notes how long (s) each answer took.

    An answer that says "too many" is no read, and no reason for this client to pause.
    """
    client = Client(port)
    await client.open()
    end = time.monotonic() + seconds
    while (before := time.monotonic()) < end:
        status, body = await client.ask(path)
        assert status in (200, TOO_MANY), body
        if status != TOO_MANY:
            times.append(time.monotonic() - before)
    client.close()


async def wait_in_vain(port: int, target: dict[str, float]) -> None:
    """A client of a verb that goes so far away that it will not arrive."""
    client = Client(port)
    await client.open()
    try:
        answer = await client.ask("/movement/go_to_ned_wait", target)
        raise AssertionError(f"a waiting verb ended: {answer}")
    finally:
        client.close()


async def listen(port: int) -> None:
    """A telemetry stream's client, by Server-Sent Events, which reads all that comes."""
    client = Client(port)
    await client.open()
    client._writer.write(b"GET /telemetry/stream HTTP/1.1\r\n" + client._host + b"\r\n")
    try:
        while await client._reader.read(BACKLOG):
            pass
    finally:
        client.close()


FAR_AWAY = {"x": 50_000, "y": 0, "z": -10}


async def _load(port: int, *, path: str, seconds: float, pollers: int, waiting: int, streams: int) -> list[float]:
    others = [asyncio.ensure_future(wait_in_vain(port, FAR_AWAY)) for _ in range(waiting)]
    others += [asyncio.ensure_future(listen(port)) for _ in range(streams)]
    times: list[float] = []
    if waiting:
        await asyncio.sleep(0.3)  # until they all wait
    if pollers:
        await asyncio.gather(*(poll(port, path, seconds, times) for _ in range(pollers)))
    else:
        await asyncio.sleep(seconds)
    for task in others:
        assert not task.done(), task.exception()
        task.cancel()
    await asyncio.gather(*others, return_exceptions=True)
    return times


def _run_load(pipe: Any) -> None:
    while (job := pipe.recv()) is not None:
        pipe.send(asyncio.run(_load(**job)))


def _run_bare(port: int) -> None:
    from aiohttp import web  # noqa: PLC0415  the other processes need none

    body = {"device": "uav", "id": "1", "result": "Success", "info": {"position": {"lat": -35.3, "lon": 149.1}}}

    async def answer(_: web.Request) -> web.Response:
        return web.json_response(body)

    app = web.Application()
    app.router.add_get("/telemetry/gps", answer)
    web.run_app(app, host="127.0.0.1", port=port, print=None, access_log=None)


class Clients:
    """HTTP clients in a process of their own."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_run_load, args=(theirs,), daemon=True)
        self._process.start()

    def begin(
        self,
        port: int,
        seconds: float,
        *,
        path: str = "/telemetry/gps",
        pollers: int = 0,
        waiting: int = 0,
        streams: int = 0,
    ) -> None:
        """Start: `pollers` read `path` as fast as they can, `waiting` wait for a verb, `streams` listen."""
        job = {"port": port, "path": path, "seconds": seconds, "pollers": pollers}
        self._pipe.send({**job, "waiting": waiting, "streams": streams})

    def end(self) -> list[float]:
        """Wait until they are done; how long (s) each answer to a poller took."""
        times: list[float] = self._pipe.recv()
        return times

    def close(self) -> None:
        """End the process."""
        self._pipe.send(None)
        self._process.join(10)


class Bare:
    """An aiohttp server with nothing behind it, in a process of its own: what HTTP in Python costs here."""

    def __init__(self) -> None:
        self.port = free_port()
        self._process = multiprocessing.get_context("spawn").Process(target=_run_bare, args=(self.port,), daemon=True)
        self._process.start()
        harness.eventually(self._is_up, what="the bare server's start")

    def _is_up(self) -> bool:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1):
            return True
        return False

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join(10)


# -- the machine ----------------------------------------------------------------------------------------


def put_first(*pids: int) -> None:
    """Let the sessions of these processes, and ours, run before the machine's other work, all alike.

    Needs root and Linux's scheduling by session (autogroup).

    Raises:
        OSError: it has neither.
    """
    for pid in (os.getpid(), *pids):
        Path(f"/proc/{pid}/autogroup").write_text("-15", encoding="ascii")


# -- numbers ----------------------------------------------------------------------------------------------


def percentile(values: list[float], share: float) -> float:
    """The value below which that share of `values` lies; NaN of nothing."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)] if ordered else math.nan


def jitter(values: list[float]) -> float:
    """Mean difference between one value and the next (as in RFC 3550); NaN of nothing."""
    steps = [abs(after - before) for before, after in zip(values, values[1:], strict=False)]
    return sum(steps) / len(steps) if steps else math.nan


def cpu_seconds(pid: int) -> float:
    """What a process has used of all cores so far, its threads included."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def machine() -> str:
    """The machine and how busy others keep it."""
    load = ", ".join(f"{one:.1f}" for one in os.getloadavg())
    return f"{os.cpu_count()} cores, load average {load} (1, 5, 15 min) before the run"


def table(headings: list[str], rows: list[list[str]]) -> str:
    """Aligned columns."""
    widths = [max(len(row[column]) for row in [headings, *rows]) for column in range(len(headings))]
    lines = [
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in [headings, *rows]
    ]
    return "\n".join(lines)
