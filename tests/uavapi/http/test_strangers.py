"""What strangers send to a real port of the API, and what it costs the one who has the token."""

from __future__ import annotations

import asyncio
import fcntl
import gzip
import ipaddress
import json
import logging
import os
import resource
import socket
import ssl
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.http import listener
from mavproxy_uavapi.http.app import ApiServer
from mavproxy_uavapi.http.call import BODY_TIMEOUT
from mavproxy_uavapi.http.listener import SHARE
from mavproxy_uavapi.http.routes import ROUTES
from mavproxy_uavapi.http.streaming import MOST_OPEN
from mavproxy_uavapi.scripts.manager import Scripts
from mavproxy_uavapi.settings import ApiModuleSettings

TOKEN = "a-long-and-secret-word"
OWNER = f"Authorization: Bearer {TOKEN}\r\n"
MOST = 200
RESERVE = 16


class Wire:
    """A connection to the API, as bytes."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    def send(self, method: str, path: str, *headers: str, body: bytes = b"", host: str = "127.0.0.1") -> None:
        """A request; `headers` are whole lines, and `body` is sent as it is."""
        lines = [f"{method} {path} HTTP/1.1", f"Host: {host}", *(header.rstrip("\r\n") for header in headers)]
        self.writer.write("\r\n".join([*lines, "", ""]).encode("latin-1") + body)

    async def answer(self) -> Any:
        """The next answer: `status`, `head` and `body`; None when the connection has ended."""
        try:
            head = (await self.reader.readuntil(b"\r\n\r\n")).decode("latin-1")
        except (asyncio.IncompleteReadError, ConnectionError):
            return None
        length = int(head.lower().partition("content-length:")[2].partition("\r")[0] or 0)
        text = (await self.reader.readexactly(length)).decode()
        body = json.loads(text) if text.startswith(("{", "[")) else text
        return SimpleNamespace(status=int(head.split()[1]), head=head, body=body)

    async def ask(self, method: str, path: str, *headers: str, **given: Any) -> Any:
        """A request and its answer."""
        self.send(method, path, *headers, **given)
        return await self.answer()

    async def ended(self) -> bool:
        """Wait for the connection's end; whether nothing came before it."""
        try:
            return await self.reader.read() == b""
        except ConnectionError:
            return True


class Port:
    """A server that listens, and connections to it."""

    def __init__(self, loop: Any, server: ApiServer, port: int) -> None:
        self.loop, self.server, self.port = loop, server, port
        self._wires: list[Wire] = []

    async def connect(self, source: str = "127.0.0.1") -> Wire:
        wire = Wire(*await asyncio.open_connection("127.0.0.1", self.port, local_addr=(source, 0)))
        self._wires.append(wire)
        return wire

    async def ask(self, method: str, path: str, *headers: str, **given: Any) -> Any:
        """A request on a connection of its own, and its answer."""
        wire = await self.connect()
        answer = await wire.ask(method, path, *headers, **given)
        wire.writer.close()
        return answer

    def run(self, act: Callable[[], Any]) -> Any:
        return self.loop.run(act())

    async def settled(self) -> None:
        """Wait until the server has seen what the sockets hold."""
        for _ in range(50):
            await asyncio.sleep(0)
            await self.loop.run_in_executor(None, time.sleep, 0.001)

    async def close(self) -> None:
        for wire in self._wires:
            wire.writer.transport.abort()
        await self.server.stop()
        await asyncio.sleep(0)


@pytest.fixture
def idle_strangers(port: Port) -> Iterator[Callable[[int], list[socket.socket]]]:
    """Opens so many connections that say nothing; their own ends take none of the low descriptors."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(limits[1], 8192), limits[1]))
    clients: list[socket.socket] = []

    def connect(count: int) -> list[socket.socket]:
        for _ in range(count):
            with socket.socket() as low:
                clients.append(socket.socket(fileno=fcntl.fcntl(low, fcntl.F_DUPFD, 2000)))
            clients[-1].setblocking(False)
            clients[-1].connect_ex(("127.0.0.1", port.port))
        return clients

    yield connect
    for client in clients:
        client.close()
    resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.fixture
def port(loop: Any, service: Any, tmp_path: Path) -> Iterator[Port]:
    """The API with a token, on a real port of the loopback."""
    loop.patience = 0.002
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = int(probe.getsockname()[1])
    given = {"port": free, "token": TOKEN, "scripts_path": str(tmp_path / "scripts")}
    service.settings = ApiModuleSettings(given, environ={}).snapshot()
    service.scripts = Scripts(service.host, service.settings)
    server = ApiServer(service)
    loop.run(server.start())
    port = Port(loop, server, free)
    yield port
    loop.run(port.close())


# -- connections ------------------------------------------------------------------------------------------


def test_1100_idle_connections_leave_the_owner_in_and_the_cap_as_it_is(
    drone: Any, port: Port, idle_strangers: Any
) -> None:
    async def act() -> tuple[int, int]:
        for _ in range(11):
            idle_strangers(100)
            await port.settled()
        answer = await port.ask("GET", "/telemetry/gps", OWNER)
        return answer.status, len(port.server.filenos()) - 1

    status, connections = port.run(act)
    assert status == 200
    assert connections <= MOST


def test_strangers_leave_a_reserve_to_those_who_pass_the_door(drone: Any, port: Port) -> None:
    async def act() -> tuple[list[int], int]:
        strangers = [await port.connect() for _ in range(MOST)]
        await port.settled()
        owners = [await port.connect() for _ in range(RESERVE)]
        statuses = [(await owner.ask("GET", "/telemetry/gps", OWNER)).status for owner in owners]
        again = [(await owner.ask("GET", "/telemetry/gps", OWNER)).status for owner in owners]
        assert sum(not stranger.reader.at_eof() for stranger in strangers) >= MOST - 2 * RESERVE
        return [*statuses, *again], len(port.server.filenos()) - 1

    statuses, connections = port.run(act)
    assert set(statuses) == {200}
    assert connections <= MOST


def test_descriptors_are_left_and_the_log_has_a_line_rather_than_tracebacks(
    drone: Any, port: Port, idle_strangers: Any, caplog: pytest.LogCaptureFixture
) -> None:
    async def act() -> tuple[int, int]:
        owner = await port.connect()
        await owner.ask("GET", "/telemetry/gps", OWNER)
        idle_strangers(180)
        limit = 128 + sum(int(fd) < 2000 for fd in os.listdir("/proc/self/fd"))
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
        await port.settled()
        spare = [os.dup(0) for _ in range(20)]  # as MAVProxy does to connect again
        for fd in spare:
            os.close(fd)
        return max(spare), (await owner.ask("GET", "/telemetry/gps", OWNER)).status

    highest, status = port.run(act)
    assert highest < 1024 and status == 200
    assert [record for record in caplog.records if record.exc_info] == []
    assert len(caplog.records) <= 5


def test_idle_connection_is_closed_after_30_s_and_a_stream_is_not(drone: Any, port: Port, loop: Any) -> None:
    async def act() -> tuple[float, float]:
        idle, stream = await port.connect(), await port.connect()
        stream.send("GET", "/telemetry/stream", OWNER)
        await stream.reader.readuntil(b"\r\n\r\n")
        assert (await idle.ask("GET", "/telemetry/gps", OWNER)).status == 200
        began = loop.time()
        assert await idle.ended()
        closed = loop.time() - began
        await asyncio.sleep(60)
        assert not stream.reader.at_eof()
        return closed, began

    closed, _ = port.run(act)
    assert 29 <= closed <= 31


def test_streams_of_one_address_leave_most_to_others(
    drone: Any, port: Port, service: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stream takes a connection, so that the share of connections is one of streams too."""
    far = "127.0.0.2"  # stands for another computer
    addresses = {far: ipaddress.ip_address("10.0.0.5")}
    monkeypatch.setattr(listener, "address_of", lambda remote: addresses.get(remote, ipaddress.ip_address(remote)))
    upgrade = ("Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13")
    kinds = (OWNER,), (OWNER, *upgrade, "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==")

    async def status_of_stream(source: str, *headers: str) -> int | None:
        wire = await port.connect(source)
        wire.send("GET", "/telemetry/stream", *headers)
        try:
            return int((await wire.reader.readuntil(b"\r\n")).split()[1])
        except (asyncio.IncompleteReadError, ConnectionError):
            return None

    async def act() -> tuple[list[int | None], list[int | None], int]:
        theirs = [await status_of_stream(far, *kinds[number % 2]) for number in range(2 * SHARE)]
        ours = [await status_of_stream("127.0.0.1", *kinds[number % 2]) for number in range(MOST_OPEN - SHARE + 1)]
        return theirs, ours, service.streams.count

    theirs, ours, count = port.run(act)
    assert theirs == [200, 101] * (SHARE // 2) + [None] * SHARE
    assert ours == [200, 101] * ((MOST_OPEN - SHARE) // 2) + [429]
    assert count == MOST_OPEN


@pytest.mark.parametrize("drop", ["G", "\r\n", "\x00"])
def test_connection_that_sends_a_byte_every_29_s_is_closed(drone: Any, port: Port, loop: Any, drop: str) -> None:
    async def act() -> float:
        wire = await port.connect()
        assert (await wire.ask("GET", "/telemetry/gps", OWNER)).status == 200
        began = loop.time()
        end = loop.create_task(wire.ended())
        while not end.done() and loop.time() - began < 300:
            wire.writer.write(drop.encode())
            await asyncio.wait({end}, timeout=29)
        return loop.time() - began

    assert port.run(act) <= 58


@pytest.mark.needs("openssl")
def test_tls_handshake_that_stops_half_way_is_given_up_and_holds_up_nobody(
    drone: Any, service: Any, loop: Any, tmp_path: Path
) -> None:
    key, cert = str(tmp_path / "key.pem"), str(tmp_path / "cert.pem")
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost"]
    subprocess.run([*command, "-keyout", key, "-out", cert], check=True, capture_output=True)
    loop.patience = 0.02
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = int(probe.getsockname()[1])
    given = {"port": free, "certfile": cert, "keyfile": key}
    service.settings = ApiModuleSettings(given, environ={}).snapshot()
    server = ApiServer(service)
    port = Port(loop, server, free)

    async def act() -> tuple[int, float, int]:
        await server.start()
        silent, half = await port.connect(), await port.connect()
        half.writer.write(b"\x16\x03\x01\x02\x00\x01\x00")
        began = loop.time()
        trusting = ssl.create_default_context(cafile=cert)
        trusting.check_hostname = False
        owner = Wire(*await asyncio.open_connection("127.0.0.1", free, ssl=trusting))
        status = (await owner.ask("GET", "/telemetry/gps")).status
        owner.writer.transport.abort()
        assert await half.ended() and await silent.ended()
        seconds = loop.time() - began
        await asyncio.sleep(1)
        return status, seconds, len(server.filenos())

    status, seconds, descriptors = port.run(act)
    loop.run(port.close())
    assert status == 200
    assert 9 <= seconds <= 12
    assert descriptors == 1


# -- the door comes first -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "value", ["Bearer \xff", "Bearer \xff\xfe\x80", "\xff", "Bearer", "Bearer ", " ", "Basic \xe4"]
)
def test_bad_authorization_is_401_and_no_traceback(port: Port, caplog: pytest.LogCaptureFixture, value: str) -> None:
    answer = port.run(lambda: port.ask("GET", "/jobs", f"Authorization: {value}"))
    assert (answer.status, answer.body["code"]) == (401, "unauthorized")
    assert [record for record in caplog.records if record.exc_info] == []


def test_body_of_a_stranger_is_not_sent_for_nor_waited_for(drone: Any, port: Port, loop: Any) -> None:
    async def act() -> tuple[Any, float]:
        began = loop.time()
        wire = await port.connect()
        wire.send("POST", "/movement/drive", "Content-Length: 100000", "Expect: 100-continue")
        answer = await wire.answer()
        await wire.ended()
        return answer, loop.time() - began

    answer, seconds = port.run(act)
    assert answer.status == 401
    assert "connection: close" in answer.head.lower()
    assert seconds < 2


def test_body_of_the_owner_is_sent_for(flying: Any, port: Port) -> None:
    async def act() -> tuple[Any, Any]:
        wire = await port.connect()
        body = b'{"x": 1, "y": 2, "z": 0}'
        wire.send(
            "POST", "/movement/drive", OWNER, "Content-Type: application/json", f"Content-Length: {len(body)}",
            "Expect: 100-continue",
        )  # fmt: skip
        asked = await wire.answer()
        wire.writer.write(body)
        return asked, await wire.answer()

    asked, answer = port.run(act)
    assert (asked.status, answer.status) == (100, 200)


def test_unknown_expectation_is_417(flying: Any, port: Port) -> None:
    answer = port.run(lambda: port.ask("GET", "/jobs", OWNER, "Expect: a miracle"))
    assert (answer.status, answer.body["code"]) == (417, "bad_request")


@pytest.mark.parametrize(("who", "status"), [("X-Token: none", 401), (OWNER, 404)], ids=["stranger", "owner"])
@pytest.mark.parametrize("expected", ["100-continue", "\xff"])
@pytest.mark.parametrize(("method", "path"), [("OPTIONS", "*"), ("OPTIONS", "/no/such"), ("CONNECT", "127.0.0.1:80")])
def test_expectation_on_a_path_of_nobodys_is_answered_behind_the_door(
    flying: Any,
    port: Port,
    caplog: pytest.LogCaptureFixture,
    method: str,
    path: str,
    expected: str,
    who: str,
    status: int,
) -> None:
    answer = port.run(lambda: port.ask(method, path, who, f"Expect: {expected}"))
    assert answer.status == status
    assert [record for record in caplog.records if record.exc_info] == []


@pytest.mark.parametrize(("who", "status"), [("", 401), (OWNER, 415)], ids=["stranger", "owner"])
@pytest.mark.parametrize("path", ["/movement/drive", "/mission/upload-script", "/mission/waypoints", "/no/such"])
def test_compressed_body_is_refused_without_inflating_it(
    flying: Any, port: Port, who: str, status: int, path: str
) -> None:
    bomb = gzip.compress(bytes(300_000_000), 1)

    async def act() -> Any:
        wire = await port.connect()
        headers = ["Content-Encoding: gzip", "Content-Type: application/json", f"Content-Length: {len(bomb)}"]
        wire.send("POST", path, *([who] if who else []), *headers, body=bomb)
        answer = await wire.answer()
        await wire.ended()
        return answer

    used = time.process_time()
    answer = port.run(act)
    assert time.process_time() - used < 0.3  # s; to inflate it takes more
    assert answer.status == (404 if who and path == "/no/such" else status)


def test_connection_that_fails_at_the_door_after_it_has_passed_is_closed(flying: Any, port: Port) -> None:
    async def act() -> list[Any]:
        wire = await port.connect()
        wire.send("GET", "/jobs", OWNER)
        wire.send("GET", "/command/land")  # pipelined
        wire.send("GET", "/command/land", OWNER)
        return [await wire.answer() for _ in range(3)]

    passed, refused, nothing = port.run(act)
    assert (passed.status, refused.status) == (200, 401)
    assert nothing is None
    assert flying.orders() == []


def test_upgrade_to_nowhere_is_an_ordinary_request(drone: Any, port: Port) -> None:
    async def act() -> list[Any]:
        wire = await port.connect()
        upgrade = ("Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: x")
        answers = [await wire.ask("GET", "/telemetry/gps", OWNER, *upgrade)]
        return [*answers, await port.ask("GET", "/telemetry/stream", *upgrade), await port.ask("GET", "/jobs", OWNER)]

    assert [answer.status for answer in port.run(act)] == [200, 401, 200]


def test_stranger_cannot_make_the_server_swallow_an_endless_body(drone: Any, port: Port, loop: Any) -> None:
    async def act() -> int:
        wire = await port.connect()
        wire.send("POST", "/movement/drive", "Transfer-Encoding: chunked")
        sent = 0
        try:
            while sent < 100_000_000:
                wire.writer.write(b"100000\r\n" + bytes(0x100000) + b"\r\n")
                sent += 0x100000
                await wire.writer.drain()
        except ConnectionError:
            return sent
        return sent

    assert port.run(act) < 20_000_000


# -- rates --------------------------------------------------------------------------------------------------


def test_flood_of_refused_requests_takes_nothing_from_the_owner_at_the_same_address(flying: Any, port: Port) -> None:
    async def act() -> tuple[list[int], list[int]]:
        floods = [(await port.ask("GET", "/command/arm")).status for _ in range(1200)]
        brakes = [(await port.ask("GET", "/command/brake", OWNER)).status for _ in range(20)]
        return floods, brakes

    floods, brakes = port.run(act)
    assert 429 not in brakes and brakes.count(200) == 20
    assert set(floods) <= {401, 429}


def test_stranger_who_asks_too_often_is_answered_late(drone: Any, port: Port, loop: Any) -> None:
    async def act() -> tuple[list[int], float]:
        began = loop.time()
        statuses = [(await port.ask("GET", "/jobs")).status for _ in range(60)]
        return statuses, loop.time() - began

    statuses, seconds = port.run(act)
    assert statuses[:20] == [401] * 20
    assert 429 in statuses
    assert seconds > 1.0


def test_reader_of_the_documentation_needs_no_token_and_has_a_strangers_rate(drone: Any, port: Port) -> None:
    statuses = [port.run(lambda: port.ask("GET", "/docs")).status for _ in range(30)]
    assert statuses[:15] == [200] * 15
    assert 429 in statuses
    assert port.run(lambda: port.ask("GET", "/docs", OWNER)).status == 200


# -- bodies -------------------------------------------------------------------------------------------------

FORM = "Content-Type: multipart/form-data; boundary=b"
START = b'--b\r\nContent-Disposition: form-data; name="other"; filename="o"\r\n\r\n'


@pytest.mark.parametrize("path", [route.path for route in ROUTES if "POST" in route.methods])
@pytest.mark.parametrize("kind", ["application/json", "multipart/form-data; boundary=b", "text/plain"])
def test_body_that_comes_byte_by_byte_is_waited_for_so_long_and_no_longer(
    flying: Any, port: Port, loop: Any, path: str, kind: str
) -> None:
    async def act() -> tuple[Any, float]:
        wire = await port.connect()
        began = loop.time()
        headers = [OWNER, f"Content-Type: {kind}", "Content-Length: 1000", "Prefer: respond-async"]
        wire.send("POST", path, *headers, body=START if "form" in kind else b"{")
        answer = loop.create_task(wire.answer())
        while not answer.done() and loop.time() - began < 100:
            wire.writer.write(b" ")
            await asyncio.wait({answer}, timeout=1.0)
        return answer.result() if answer.done() else answer.cancel(), loop.time() - began

    answer, seconds = port.run(act)
    assert answer.status in (400, 404, 409)
    assert seconds < BODY_TIMEOUT + 2


def test_form_with_an_endless_part_before_its_file_is_refused(flying: Any, port: Port) -> None:
    async def act() -> tuple[Any, int]:
        wire = await port.connect()
        wire.send("POST", "/mission/upload-script", OWNER, FORM, "Transfer-Encoding: chunked")
        wire.writer.write(b"%x\r\n" % len(START) + START + b"\r\n")
        answer, sent = asyncio.ensure_future(wire.answer()), 0
        while not answer.done() and sent < 50_000_000:
            wire.writer.write(b"10000\r\n" + b"\n" * 0x10000 + b"\r\n")
            sent += 0x10000
            await asyncio.sleep(0)
            try:
                await wire.writer.drain()
            except ConnectionError:
                break
        return await answer, sent

    answer, sent = port.run(act)
    assert answer is None or (answer.status, answer.body["code"]) == (400, "bad_request")
    assert sent < 20_000_000


PART = b'Content-Disposition: form-data; name="%b"; filename="a.py"\r\n'
NESTED = b"--b\r\nContent-Type: multipart/mixed; boundary=%b\r\n\r\n"
SCRIPT = b"--b\r\n" + PART % b"file" + b"\r\nprint(1)\r\n--b--\r\n"


def post_script(port: Port, body: bytes) -> Any:
    """Send a form with boundary `b`."""
    length = f"Content-Length: {len(body)}"
    return port.run(lambda: port.ask("POST", "/mission/upload-script", OWNER, FORM, length, body=body))


@pytest.mark.parametrize(
    ("before", "why"),
    [
        (NESTED % b"c" + b"--c\r\n\r\nx\r\n--c--\r\n\r\n", "multipart itself"),
        (NESTED % b"b" * 12_000, "multipart itself"),
        (b"--b\r\n" + PART % b"other" + b"x" * 9000 + b": y\r\n\r\n", "bad headers"),
        (b"--b\r\n" + PART % b"other" + b"x: y\r\n" * 200 + b"\r\n", "bad headers"),
        (b"--b\r\n" + PART % b"other" + b"no header\r\n\r\nx\r\n", "bad headers"),
        (b"--b\r\n\r\nx\r\n" * 20_000, "100 parts"),
    ],
    ids=["a form", "forms in forms", "a long header", "many headers", "no header", "many parts"],
)
def test_form_is_refused_for_what_comes_before_its_file(
    flying: Any, port: Port, caplog: pytest.LogCaptureFixture, before: bytes, why: str
) -> None:
    answer = post_script(port, before + SCRIPT)
    assert (answer.status, answer.body["code"]) == (400, "bad_request")
    assert why in answer.body["detail"]
    assert [record for record in caplog.records if record.exc_info] == []


def test_form_with_a_few_other_parts_before_its_file_is_taken(flying: Any, port: Port) -> None:
    assert post_script(port, (b"--b\r\n" + PART % b"other" + b"\r\nx\r\n") * 99 + SCRIPT).status == 200


# -- pages --------------------------------------------------------------------------------------------------


def test_log_has_a_line_for_each_cause_whatever_a_stranger_sends(
    drone: Any, port: Port, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    port.run(lambda: port.ask("GET", "/jobs", host="evil\x1b.example"))
    port.run(lambda: port.ask("GET", "/jobs", "Origin: http://evil\xff.example"))
    for _ in range(3):
        port.run(lambda: port.ask("GET", "/jobs"))
    lines = [record.getMessage() for record in caplog.records if "refused" in record.getMessage()]
    assert len(lines) == 2
    assert all(line.isascii() and line.isprintable() for line in lines)
