"""How long a connection to a real port may be silent, and what closes it."""

from __future__ import annotations

import asyncio
import socket
import ssl
import subprocess
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.app import ApiServer
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.api_port import OWNER, Port, Wire
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop


def test_idle_connection_is_closed_after_30_s_and_a_stream_is_not(drone: Drone, port: Port, loop: FastLoop) -> None:
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


@pytest.mark.parametrize("drop", ["G", "\r\n", "\x00"])
def test_connection_that_sends_a_byte_every_29_s_is_closed(
    drone: Drone, port: Port, loop: FastLoop, drop: str
) -> None:
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
    drone: Drone, service: Service, loop: FastLoop, tmp_path: Path
) -> None:
    key, cert = str(tmp_path / "key.pem"), str(tmp_path / "cert.pem")
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost"]
    subprocess.run([*command, "-keyout", key, "-out", cert], check=True, capture_output=True)
    loop.real_wait = 0.02
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = int(probe.getsockname()[1])
    keywords = {"port": free, "certfile": cert, "keyfile": key}
    service.settings = ApiModuleSettings(keywords, environ={}).snapshot()
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


def test_connection_that_fails_at_the_door_after_it_has_passed_is_closed(flying: Drone, port: Port) -> None:
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


def test_upgrade_to_nowhere_is_an_ordinary_request(drone: Drone, port: Port) -> None:
    async def act() -> list[Any]:
        wire = await port.connect()
        upgrade = ("Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: x")
        answers = [await wire.ask("GET", "/telemetry/gps", OWNER, *upgrade)]
        return [*answers, await port.ask("GET", "/telemetry/stream", *upgrade), await port.ask("GET", "/jobs", OWNER)]

    assert [answer.status for answer in port.run(act)] == [200, 401, 200]
