"""What stream clients cost others, and what they get.

Reads of one client, while many streams are open that nobody reads; then how long messages take to clients that read.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import re
import socket
import sys
import time
from pathlib import Path
from typing import Any

from figures import cpu_seconds, machine, percentile, table
from http_clients import Client
from rig import rig

ALL = "/telemetry/stream"
NAMES = ("ATTITUDE", "HEARTBEAT", "GLOBAL_POSITION_INT", "VFR_HUD", "SYS_STATUS")


def unread(port: int, path: str, kernel: int = 4096) -> socket.socket:
    """A client that asks for a stream and reads nothing of it.

    Args:
        port: the API's.
        path: what it asks for.
        kernel: bytes that the kernel may keep for it.
    """
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, kernel)
    client.connect(("127.0.0.1", port))
    client.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
    return client


def resident(pid: int) -> float:
    """Memory of a process in MB."""
    words = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()
    return int(words[1]) * 4096 / 1e6


async def reads(port: int, seconds: float) -> list[float]:
    """Read `/telemetry/gps` ten times a second; how long (s) each took."""
    client, times = Client(port), []
    await client.open()
    end = time.monotonic() + seconds
    while (before := time.monotonic()) < end:
        await client.ask("/telemetry/gps")
        times.append(time.monotonic() - before)
        await asyncio.sleep(0.1)
    client.close()
    return times


def case(made: Any, paths: list[str], seconds: float) -> list[str]:
    """The numbers of one case: reads while clients have asked for `paths` and read nothing."""
    pid = made.mavproxy.pid
    with contextlib.ExitStack() as open_streams:
        for path in paths:
            open_streams.enter_context(unread(made.port, path))
        time.sleep(2.0)
        cpu, began = cpu_seconds(pid), time.monotonic()
        times = asyncio.run(reads(made.port, seconds))
        share = (cpu_seconds(pid) - cpu) / (time.monotonic() - began)
        memory = resident(pid)
    time.sleep(2.0)
    millis = [f"{percentile(times, one) * 1e3:.1f}" for one in (0.5, 0.99, 1.0)]
    return [*millis, f"{share * 100:.0f} %", f"{memory:.0f}"]


SIZES = ((100, 10), (20, 50))  # clients, and Hz of each
WATCHED = "/telemetry/stream?view=attitude&events=*&rate={}"
STAMPED = re.compile(rb'"time": ([0-9.]+)')


async def listen(port: int, rate: int, until: float) -> list[float]:
    """Read a stream until then (s since 1970); how long (s) after its arrival each message was here."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(f"GET {WATCHED.format(rate)} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
    delays, begun = [], time.time() + 2.0  # what was known before comes first
    while (now := time.time()) < until:
        data = await reader.read(65536)
        now = time.time()
        delays += [now - float(stamp) for stamp in STAMPED.findall(data) if now > begun]
    writer.close()
    return delays


async def all_listen(port: int, sizes: tuple[tuple[int, int], ...], seconds: float) -> list[list[float]]:
    """The delays of each size's clients together, all at once."""
    until = time.time() + 2.0 + seconds
    rates = [rate for count, rate in sizes for _ in range(count)]
    delays = await asyncio.gather(*(listen(port, rate, until) for rate in rates))
    return [[one for d, r in zip(delays, rates, strict=True) if r == rate for one in d] for _, rate in sizes]


def await_rate(made: Any, rate: float) -> None:
    """Wait until ATTITUDE comes so often (Hz): MAVProxy asks for its rate every 15 s."""
    before = None
    while True:
        count = made.get("/telemetry/message/ATTITUDE").json()["info"]["count"]
        if before is not None and count - before >= rate:
            return
        before = count
        time.sleep(1.0)


def delays(seconds: float) -> list[list[str]]:
    """A row for each size: how long messages take, while clients of all sizes listen."""
    rows = []
    with rig(streamrate=50) as (made, _):
        await_rate(made, 40)
        cpu, began = cpu_seconds(made.mavproxy.pid), time.monotonic()
        measured = asyncio.run(all_listen(made.port, SIZES, seconds))
        share = (cpu_seconds(made.mavproxy.pid) - cpu) / (time.monotonic() - began)
        for (count, rate), times in zip(SIZES, measured, strict=True):
            millis = [f"{percentile(times, one) * 1e3:.1f}" for one in (0.5, 0.99, 1.0)]
            rows.append([f"{count} at {rate} Hz", str(len(times)), *millis, f"{share * 100:.0f} %"])
    return rows


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each case")
    parser.add_argument("--delays", action="store_true", help="only these")
    parser.add_argument("--clients", type=int, nargs="*", default=[0, 100, 300])
    options = parser.parse_args()
    print(f"streams: {machine()}")
    head = ["clients, all at once", "messages", "p50 ms", "p99 ms", "most ms", "MAVProxy's CPU"]
    print(table(head, delays(options.seconds)))
    print()
    if options.delays:
        return 0
    rows = []
    with rig(streamrate=10) as (made, _):
        made.get("/telemetry/gps")  # the first one asks the vehicle for the message
        for count in options.clients:
            rows.append([f"{count} of all messages", *case(made, [ALL] * count, options.seconds)])
        different = [f"{ALL}?names={NAMES[n % 5]}&rate={n + 1}" for n in range(100)]
        rows.append(["100 with 100 filters", *case(made, different, options.seconds)])
        rows.append(["100 that match nothing", *case(made, [f"{ALL}?names=NONE"] * 100, options.seconds)])
    print(table(["unread streams", "read p50 ms", "p99 ms", "most ms", "MAVProxy's CPU", "MB"], rows))
    print()
    return 0


if __name__ == "__main__":
    sys.exit(main())
