"""What strangers and the owner send behind the headers, to a real port."""

from __future__ import annotations

import asyncio
import functools
import gzip
import time
from typing import Any

import pytest

from mavproxy_uavapi.http.routes import ROUTES
from mavproxy_uavapi.http.wire.bodies import BODY_TIMEOUT
from tests.support.api_port import OWNER, START, Port
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop


def test_body_of_a_stranger_is_not_sent_for_nor_waited_for(drone: Drone, port: Port, loop: FastLoop) -> None:
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


def test_body_of_the_owner_is_sent_for(flying: Drone, port: Port) -> None:
    async def act() -> tuple[Any, Any]:
        wire = await port.connect()
        body = b'{"x": 1, "y": 2, "z": 0}'
        wire.send(
            "POST", "/movement/drive", OWNER, "Content-Type: application/json", f"Content-Length: {len(body)}",
            "Expect: 100-continue",
        )  # fmt: skip
        requested = await wire.answer()
        wire.writer.write(body)
        return requested, await wire.answer()

    requested, answer = port.run(act)
    assert (requested.status, answer.status) == (100, 200)


def test_unknown_expectation_is_417(flying: Drone, port: Port) -> None:
    answer = port.run(lambda: port.ask("GET", "/jobs", OWNER, "Expect: a miracle"))
    assert (answer.status, answer.body["code"]) == (417, "bad_request")


@pytest.mark.parametrize(("who", "status"), [("X-Token: none", 401), (OWNER, 404)], ids=["stranger", "owner"])
@pytest.mark.parametrize("expected", ["100-continue", "\xff"])
@pytest.mark.parametrize(("method", "path"), [("OPTIONS", "*"), ("OPTIONS", "/no/such"), ("CONNECT", "127.0.0.1:80")])
def test_expectation_on_a_path_of_nobodys_is_answered_behind_the_door(
    flying: Drone,
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


@functools.cache
def a_bomb() -> bytes:
    """300 MB of zeros, packed."""
    return gzip.compress(bytes(300_000_000), 1)


@pytest.mark.parametrize(("who", "status"), [("", 401), (OWNER, 415)], ids=["stranger", "owner"])
@pytest.mark.parametrize("path", ["/movement/drive", "/mission/upload-script", "/mission/waypoints", "/no/such"])
def test_compressed_body_is_refused_without_inflating_it(
    flying: Drone, port: Port, who: str, status: int, path: str
) -> None:
    bomb = a_bomb()

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


def test_stranger_cannot_make_the_server_swallow_an_endless_body(drone: Drone, port: Port, loop: FastLoop) -> None:
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


JSON = "application/json"
SLOW_BODIES = [(route.path, JSON) for route in ROUTES if "POST" in route.methods]
SLOW_BODIES += [
    (path, kind)
    for path in ("/movement/drive", "/mission/upload-script", "/mission/waypoints")  # as JSON, a form, any bytes
    for kind in ("multipart/form-data; boundary=b", "text/plain")
]


@pytest.mark.matrix
@pytest.mark.parametrize(("path", "kind"), SLOW_BODIES)
def test_body_that_comes_byte_by_byte_is_waited_for_so_long_and_no_longer(
    flying: Drone, port: Port, loop: FastLoop, path: str, kind: str
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
