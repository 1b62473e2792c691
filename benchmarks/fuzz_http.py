"""Broken HTTP and nonsense at the port: no 500, no traceback, no reader who has to wait.

    python benchmarks/fuzz_http.py --minutes 10 [--seed N] [--first]

Real processes: the embedded vehicle, a MAVProxy, and two fuzzers beside a reader of telemetry. schemathesis makes
what is HTTP, from /openapi.json; a generator of our own breaks what is: it takes requests apart, joins them wrongly,
in pieces, at the wrong moment. It fails when an answer is a defect of ours, when MAVProxy's log has a
traceback, when the reader waits for longer than a second, or when the port is dead at the end.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import random
import re
import sys
import time
from collections import Counter
from typing import Any

import requests
from figures import machine, percentile, put_first, table
from http_clients import Client
from rig import harness, rig
from soak_notes import Notes, look_for_bad_words

FUZZERS = 12
STALLED = 1.0  # s that a reader may wait
LOST = 0.05  # share of the requests that may find no link, as after a reboot
READ_EVERY = 0.02  # s
HEARD = 0.3  # s that an answer is waited for; a verb that flies goes on
OURS = {"rejected", "tool_failed"}  # codes of a 500 that is not our fault
STATUS = re.compile(rb"HTTP/1\.[01] (\d{3}) ")

METHODS = (
    "GET", "POST", "DELETE", "HEAD", "OPTIONS", "CONNECT", "TRACE", "PUT", "PRI", "get", "G\x00T", "A" * 300, "",
)  # fmt: skip
PATHS = (
    "/telemetry/gps", "/telemetry/message/ATTITUDE", "/telemetry/message/%00%ff", "/telemetry/stream?rate=nan",
    "/jobs", "/jobs/-1", "/jobs/9" * 20, "/command/arm?timeout=1e400", "/command/takeoff?alt=%F0%9F%9A%81",
    "/movement/drive", "/movement/go_to_ned", "/movement/stop?wait=maybe", "/mission/upload-script",
    "/mission/waypoints", "/mission/start", "/mission/execute-script", "/mission/scripts/..%2f..%2fetc%2fpasswd",
    "/mission/scripts/\xff/log?follow=1", "/docs", "/docs/..%2f..%2fsetup.py", "/openapi.json",
    "/peripherical/servo_output", "/peripherical/take_photo?command=%00", "/%", "/%zz?%zz=%zz", "//", "*",
    "http://127.0.0.1/jobs", "127.0.0.1:80", "/" + "a" * 9000, "/?" + "a&" * 3000, "", "/\udcff", "/command/land#",
    "/vision/status", "/gradys/readings",
)  # fmt: skip
VERSIONS = (
    "HTTP/1.1", "HTTP/1.0", "HTTP/0.9", "HTTP/2.0", "HTTP/1.9", "HTTP/1.1 ", "http/1.1", "HTTP/99999999999.1", "",
)  # fmt: skip
HEADERS = (
    "Host: 127.0.0.1", "Host: localhost", "Host:", "Host: [::1", "Host: \xff", "Host: evil.example",
    "Host: 127.0.0.1:99999999", "Content-Length: 5", "Content-Length: -1", "Content-Length: 99999999999999999999",
    "Content-Length: 0x10", "Content-Length: 5, 5", "Transfer-Encoding: chunked",
    "Transfer-Encoding: gzip, chunked", "Transfer-Encoding: \xff", "Content-Encoding: gzip", "Content-Encoding: br",
    "Content-Encoding: \xff", "Content-Type: application/json", "Content-Type: application/json; charset=utf-7",
    "Content-Type: application/json; charset=\xff", "Content-Type: application/json; charset=undefined",
    "Content-Type: multipart/form-data", "Content-Type: ;;==\"", "Content-Type: multipart/form-data; boundary=b",
    "Content-Type: multipart/form-data; boundary=" + "b" * 200, "Content-Type: multipart/form-data; boundary=\xff",
    "Content-Type: application/x-www-form-urlencoded; charset=idna", "Authorization: Bearer \xff",
    "Authorization: \xff\xfe", "Authorization: Bearer " + "t" * 7000, "Authorization:", "Origin: http://127.0.0.1",
    "Origin: null", "Origin: \xff", "Referer: http://[", "Referer: \xff", "Referer:", "Sec-Fetch-Site: same-origin",
    "Sec-Fetch-Site: \xff", "Accept: text/html", "Accept: \xff", "User-Agent: Mozilla/\xff", "Upgrade: websocket",
    "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Key: \xff", "Sec-WebSocket-Protocol: \xff",
    "Sec-WebSocket-Extensions: permessage-deflate; x=\xff", "Upgrade: h2c", "HTTP2-Settings: AAMAAABkAAQAAP__",
    "Expect: 100-continue", "Expect: \xff", "Prefer: respond-async", "Prefer: \xff", "Range: bytes=-1",
    "If-Modified-Since: \xff", "If-None-Match: \xff", "Cookie: \xff=\xff; ;;=", "X-Forwarded-For: \xff",
    "Connection: close", "Connection: keep-alive, close", "Keep-Alive: timeout=-1", " folded", "No colon",
    ": no name", "X\x00: null", "X: a\x00b", "X: \x1b[31m", "X: " + "a" * 8000, "Te: trailers", "Trailer: Host",
)  # fmt: skip
BODIES = (
    b"", b"{", b"hello", b'{"x": 1, "y": 2, "z": -3}', b'{"x": NaN, "y": 1e999, "z": null}', b"[" * 3000,
    b"\xff\xfe\x00", b"5\r\nhello\r\n0\r\n\r\n", b"ffffffffffffffff\r\n", b"-1\r\n\r\n",
    b"5;x=\xff\r\nhello\r\n0\r\nX: \xff\r\n\r\n",
    b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.py"\r\n\r\nprint(1)\r\n--b--\r\n',
    b'--b\r\nContent-Disposition: form-data; name="file"; filename="\xff/../\x00.py"\r\n\r\nx\r\n--b--\r\n',
    b"--b\r\nContent-Type: multipart/mixed; boundary=c\r\n\r\n--c\r\n\r\nx\r\n--c--\r\n--b--\r\n", b"--b\r\n\r\n",
    b"--b--",
    b'--b\r\nContent-Disposition: form-data; name="file"; filename="a"\r\nContent-Transfer-Encoding: base64\r\n\r\n!',
    b'{"script_name": "../../etc/passwd"}', b'{"script_name": "a", "args": ["\\u0000"]}', b'"\\ud800"',
    b"QGC WPL 110\n\xff", b'{"channel": 9, "pwm": 1e308}', b"\x81\xfe\xff\xff\x00\x00\x00\x00",
    b"\x88\x80\x00\x00\x00\x00", b"a" * 20000,
)  # fmt: skip
WILD = (
    b"\r\n", b"\n", b"\r", b"\x00", b"\xff", b" ", b"\t", b":", b"%00", b"HTTP/1.1", b"0\r\n\r\n",
    b"\x16\x03\x01\x02",
)  # fmt: skip


class Broken:
    """Makes broken conversations. Pure, but for its dice."""

    def __init__(self, dice: random.Random) -> None:
        self._dice = dice

    def conversation(self) -> list[bytes]:
        """One to four requests, broken, and in pieces."""
        data = bytearray(b"".join(self._request() for _ in range(self._dice.choice((1, 1, 1, 2, 4)))))
        for _ in range(self._dice.choice((0, 0, 0, 1, 3, 10))):
            self._damage(data)
        cuts = sorted(self._dice.randrange(len(data) + 1) for _ in range(self._dice.choice((0, 0, 1, 3))))
        return [bytes(data[start:end]) for start, end in zip([0, *cuts], [*cuts, len(data)], strict=True)]

    def _request(self) -> bytes:
        dice = self._dice
        sane = dice.random() < 0.6
        method = dice.choice(METHODS[:3] if sane else METHODS)
        version = "HTTP/1.1" if sane or dice.random() < 0.5 else dice.choice(VERSIONS)
        headers = [] if dice.random() < 0.05 else ["Host: 127.0.0.1"]
        headers += dice.choices(HEADERS, k=dice.choice((0, 1, 2, 3, 6)) if sane else dice.choice((0, 5, 20, 200)))
        body = dice.choice(BODIES)
        if sane and dice.random() < 0.7:
            headers.append(f"Content-Length: {len(body)}")
        end = "\r\n" if sane else dice.choice(("\r\n", "\n", "\r\n\r\n"))
        head = end.join([f"{method} {dice.choice(PATHS)} {version}", *headers, "", ""])
        return head.encode("latin-1", "replace") + body

    def _damage(self, data: bytearray) -> None:
        if not data:
            return
        at = self._dice.randrange(len(data))
        way = self._dice.randrange(4)
        if way == 0:
            data[at] = self._dice.randrange(256)
        elif way == 1:
            data[at:at] = self._dice.choice(WILD)
        elif way == 2:
            del data[at : at + self._dice.randrange(1, 30)]
        else:
            data[at:at] = data[at : at + self._dice.randrange(1, 300)]


class Fuzzing:
    """The broken half, and the reader beside it."""

    def __init__(self, port: int, dice: random.Random, notes: Notes) -> None:
        self._port, self._broken, self._dice, self._notes = port, Broken(dice), dice, notes
        self.statuses: Counter[str] = Counter()
        self.waits: list[float] = []

    async def run(self, seconds: float) -> None:
        """For so long."""
        end = time.monotonic() + seconds
        await asyncio.gather(self._read(end), *(self._fuzz(end) for _ in range(FUZZERS)))

    async def _read(self, end: float) -> None:
        client = Client(self._port)
        await client.open()
        while (before := time.monotonic()) < end:
            status, body = await client.ask("/telemetry/status")  # which asks the vehicle for nothing
            self.waits.append(time.monotonic() - before)
            if status not in (200, 503):
                self._notes.fail(f"the reader was answered {status} {body!r}")
            await asyncio.sleep(READ_EVERY)
        client.close()

    async def _fuzz(self, end: float) -> None:
        while time.monotonic() < end:
            pieces = self._broken.conversation()
            heard = b""
            with contextlib.suppress(OSError):
                heard = await self._talk(pieces)
            self._judge(pieces, heard)

    async def _talk(self, pieces: list[bytes]) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        heard = bytearray()
        try:
            for piece in pieces:
                writer.write(piece)
                await asyncio.sleep(self._dice.choice((0, 0, 0.01)))
            if self._dice.random() < 0.3:
                writer.write_eof()
            with contextlib.suppress(asyncio.TimeoutError):
                while data := await asyncio.wait_for(reader.read(1 << 16), HEARD):
                    heard += data
                    if len(heard) > 1 << 20:
                        break
        finally:
            writer.transport.abort()
        return bytes(heard)

    def _judge(self, pieces: list[bytes], heard: bytes) -> None:
        statuses = STATUS.findall(heard[:4096]) or [b"no answer"]
        self.statuses.update(status.decode() for status in statuses)
        if b"500" in statuses and not any(f'"code": "{code}"'.encode() in heard for code in OURS):
            self._notes.fail(f"{pieces!r:.3000}\n    was answered\n    {heard[:1000]!r}")


def _run_schemathesis(port: int, seconds: float, seed: int, pipe: Any) -> None:
    import schemathesis  # noqa: PLC0415  the other process needs none
    from hypothesis import HealthCheck, Phase, given, settings  # noqa: PLC0415
    from hypothesis import seed as seeded  # noqa: PLC0415
    from hypothesis.errors import Unsatisfiable  # noqa: PLC0415

    url = f"http://127.0.0.1:{port}"
    schema = schemathesis.openapi.from_url(f"{url}/openapi.json")
    operations = [result.ok() for result in schema.get_all_operations()]
    end, statuses, failures, lost = time.monotonic() + seconds, Counter[str](), list[str](), list[bool]()
    rounds = settings(
        database=None,
        deadline=None,
        max_examples=15,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate],
    )

    def ask(case: Any) -> None:
        if time.monotonic() > end:
            return
        session_request = requests.Request(**case.as_transport_kwargs(url)).prepare()
        session_request.headers["Prefer"] = "respond-async"
        with requests.Session() as session:
            try:
                answer = session.send(session_request, timeout=20, stream=True)
            except (requests.ConnectionError, requests.Timeout) as error:
                failures.append(f"{session_request.method} {session_request.url}: {error}")
                return
            statuses[str(answer.status_code)] += 1
            lost.append(answer.status_code == 503 and json.loads(answer.text).get("code") == "link_lost")
            if answer.status_code == 500 and json.loads(answer.text).get("code") not in OURS:
                failures.append(
                    f"{session_request.method} {session_request.url} {session_request.body!r}: {answer.text}"
                )

    while time.monotonic() < end:
        for operation in operations:
            for mode in schemathesis.GenerationMode:
                seed += 1
                if time.monotonic() < end:
                    with contextlib.suppress(Unsatisfiable):  # of what has no parameters nothing wrong can be made
                        seeded(seed)(rounds(given(case=operation.as_strategy(generation_mode=mode))(ask)))()
    if sum(lost) > LOST * len(lost):
        failures.append(f"{sum(lost)} of {len(lost)} requests found no link: what is seen is little")
    pipe.send((statuses, failures))


def fuzz(made: Any, seconds: float, seed: int, notes: Notes) -> None:
    """Both fuzzers, for so long."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_run_schemathesis, args=(made.port, seconds, seed, theirs), daemon=True)
    process.start()
    fuzzing = Fuzzing(made.port, random.Random(seed), notes)
    asyncio.run(fuzzing.run(seconds))
    statuses, failures = ours.recv() if ours.poll(120) else (Counter(), ["schemathesis did not end"])
    process.join(10)
    for failure in failures[:20]:
        notes.fail(f"schemathesis: {failure}")
    for name, counts in (("broken HTTP", fuzzing.statuses), ("schemathesis", statuses)):
        print(f"  {name}: {sum(counts.values())} answers; " + ", ".join(f"{k} {v}" for k, v in counts.most_common()))
    waits = [f"{1000 * percentile(fuzzing.waits, share):.0f}" for share in (0.5, 0.99, 1.0)]
    print(table(["a reader's wait, ms", "count", "50 %", "99 %", "most"], [["", str(len(fuzzing.waits)), *waits]]))
    if max(fuzzing.waits) > STALLED:
        notes.fail(f"a reader waited for {max(fuzzing.waits):.2f} s")


def main() -> int:
    """Run, print what was seen, and say whether all was well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--first", action="store_true", help="run before the machine's other work (root)")
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    options = parser.parse_args()
    print(f"fuzz: {options.minutes:g} min, seed {options.seed}; {machine()}", flush=True)
    notes = Notes()
    with rig(max_jobs=10000, scripts_path="scripts", script_logs="script_logs") as (made, _tap):
        if options.first:
            put_first(*(process.pid for process in made.processes))
        fuzz(made, options.minutes * 60, options.seed, notes)
        harness.eventually(lambda: made.get("/telemetry/status", timeout=10).status_code == 200, 30, "an answer")
        look_for_bad_words(made.mavproxy.output(), notes)
    print(f"{len(notes.failures)} failures" if notes.failures else "all is well")
    return 1 if notes.failures else 0


if __name__ == "__main__":
    sys.exit(main())
