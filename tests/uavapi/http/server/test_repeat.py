"""A read that comes again on its connection: the answer is as new as any, and what refuses a read refuses it."""

from __future__ import annotations

import asyncio
import itertools
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.callers.call import Service
from mavproxy_uavapi.http.server.repeat import TRUSTED_FOR, Repeat
from mavproxy_uavapi.http.wire.connection import Connection
from tests.support import tokens
from tests.support.api_port import OWNER, Port, Wire
from tests.support.drone import Drone
from tests.support.virtual_time import FastLoop

GPS = "/telemetry/gps"


@pytest.fixture
def repeats(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """For each request that came again: whether it was answered without being parsed."""
    tried = list[bool]()
    answer = Repeat.answer

    def noted(repeat: Repeat) -> bytes | None:
        result = answer(repeat)
        tried.append(result is not None)
        return result

    monkeypatch.setattr(Repeat, "answer", noted)
    return tried


def lines(answer: Any) -> list[str]:
    """The headers, without those that differ from answer to answer."""
    return sorted(line for line in answer.head.split("\r\n") if not line.startswith(("Date", "Content-Length")))


@pytest.mark.parametrize(
    "path", [f"/telemetry/{name}" for name in ("general", "gps", "gps_raw", "ned", "attitude", "sys_status")]
)
def test_answer_to_a_repeat_is_as_the_first_with_the_newest_message(
    flying: Drone, port: Port, repeats: list[bool], path: str
) -> None:
    async def act() -> tuple[Any, Any, Any]:
        wire = await port.connect()
        first = await wire.ask("GET", path, OWNER)
        again = await wire.ask("GET", path, OWNER)
        flying.fly(at=(50.0, 0.0, -20.0))
        flying.tell_all()
        await asyncio.sleep(0.05)
        return first, again, await wire.ask("GET", path, OWNER)

    first, again, later = port.run(act)
    assert repeats == [True, True]
    assert lines(first) == lines(again) == lines(later)
    assert {**first.body, "age_s": 0} == {**again.body, "age_s": 0}
    if path in (GPS, "/telemetry/ned"):
        assert later.body["info"]["position"] != again.body["info"]["position"]


def test_age_grows_until_the_message_is_too_old(
    flying: Drone, port: Port, service: Service, repeats: list[bool]
) -> None:
    flying.power_off()
    path = f"{GPS}?max_age=0.7"

    async def act() -> list[Any]:
        wire, answers = await port.connect(), []
        for _ in range(4):
            answers.append(await wire.ask("GET", path, OWNER))
            await asyncio.sleep(0.3)
        return answers

    answers = port.run(act)
    assert [answer.status for answer in answers] == [200, 200, 200, 503]
    ages = [answer.body["age_s"] for answer in answers[:3]]
    assert ages == sorted(ages) and ages[2] - ages[0] == pytest.approx(0.6, abs=0.1)
    assert repeats == [True, True, False]


def test_request_is_parsed_again_after_a_second(
    flying: Drone, port: Port, loop: FastLoop, repeats: list[bool]
) -> None:
    async def act() -> None:
        wire = await port.connect()
        for _ in range(12):
            assert (await wire.ask("GET", GPS, OWNER)).status == 200
            await asyncio.sleep(TRUSTED_FOR / 5 + 0.001)

    port.run(act)
    assert repeats == [True] * 4 + [False] + [True] * 4 + [False, True]


def change_settings(port: Port, service: Service, _path: Path) -> None:
    service.settings = replace(service.settings, token="another")


def limit_rate(port: Port, service: Service, _path: Path) -> None:
    service.settings = replace(service.settings, local_rate=0.5)


@pytest.mark.parametrize(("change", "status"), [(change_settings, 401), (limit_rate, 429)])
def test_new_settings_count_at_once(
    flying: Drone, port: Port, service: Service, tmp_path: Path, change: Callable[..., None], status: int
) -> None:
    async def act() -> list[int]:
        wire = await port.connect()
        before = [(await wire.ask("GET", GPS, OWNER)).status for _ in range(3)]
        change(port, service, tmp_path)
        after = [await wire.ask("GET", GPS, OWNER) for _ in range(2)]
        return before + [answer.status for answer in after if answer is not None][-1:]

    assert port.run(act) == [200, 200, 200, status]


def test_rate_counts_repeats(flying: Drone, port: Port, service: Service) -> None:
    service.settings = replace(service.settings, local_rate=10.0)

    async def act() -> list[int]:
        wire = await port.connect()
        return [(await wire.ask("GET", GPS, OWNER)).status for _ in range(21)]

    assert port.run(act) == [200] * 20 + [429]


def test_token_that_is_taken_away_counts_no_more(
    flying: Drone, port: Port, service: Service, tmp_path: Path, repeats: list[bool]
) -> None:
    file = tokens.write(tmp_path / "tokens", tokens.ALL)
    service.settings = replace(service.settings, tokens=file)
    service.tokens.use(file)
    tower = f"Authorization: {tokens.bearer('tower')['Authorization']}"

    async def act() -> list[int]:
        wire = await port.connect()
        before = [(await wire.ask("GET", GPS, tower)).status for _ in range(3)]
        tokens.write(tmp_path / "tokens", {"anna": "fly"})
        service.tokens.take()
        return [*before, (await wire.ask("GET", GPS, tower)).status]

    assert port.run(act) == [200, 200, 200, 401]
    assert repeats == [True, True, False]


def test_repeats_keep_a_lease_alive(flying: Drone, port: Port, service: Service, repeats: list[bool]) -> None:
    async def act() -> float:
        wire = await port.connect()
        body = b'{"x": 300, "y": 0, "z": -20}'
        length = f"Content-Length: {len(body)}"
        kind = "Content-Type: application/json"
        path = "/movement/go_to_ned?lease=5&client=mission"
        assert (await port.ask("POST", path, OWNER, length, kind, body=body)).status == 200
        for _ in range(20):
            assert (await wire.ask("GET", f"{GPS}?client=mission", OWNER)).status == 200
            await asyncio.sleep(0.4)
        (lease,) = service.host.leases._leases.values()
        return float(lease.ends_at - service.host.clock())

    assert port.run(act) == pytest.approx(4.6, abs=0.3)
    assert sum(repeats) >= 10


def test_repeat_waits_for_the_main_loop_as_any_read(
    flying: Drone, port: Port, host: Host, repeats: list[bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def act() -> None:
        wire = await port.connect()
        await wire.ask("GET", GPS, OWNER)
        monkeypatch.setattr(host.bridge, "_busy", True)
        assert (await wire.ask("GET", GPS, OWNER)).status == 200

    port.run(act)
    assert repeats == [False]


BODY = b'{"channel": 9, "pwm": 1500}'
REQUESTS = {
    "gps": (b"GET /telemetry/gps HTTP/1.1", b"", "velocity"),
    "attitude": (b"GET /telemetry/attitude HTTP/1.1", b"", "roll"),
    "gps of 1.0": (b"GET /telemetry/gps HTTP/1.0", b"Connection: keep-alive\r\n", "velocity"),
    "post": (b"POST /jobs HTTP/1.1", b"Content-Length: %d\r\n" % len(BODY), "detail"),
    "nothing": (b"GET /nothing HTTP/1.1", b"", "detail"),
}


def encoded(name: str) -> bytes:
    line, header, _ = REQUESTS[name]
    body = BODY if name == "post" else b""
    return line + b"\r\nHost: 127.0.0.1\r\n" + OWNER.encode() + header + b"\r\n" + body


@pytest.mark.parametrize("seed", range(40))
def test_each_request_gets_its_own_answer_however_its_bytes_are_cut(flying: Drone, port: Port, seed: int) -> None:
    """Requests in one piece, in pieces, and several in one piece."""
    chance = random.Random(seed)
    names = chance.choices(["gps", "gps", *REQUESTS], k=chance.randint(2, 8))
    wholes = list(map(encoded, names))
    ends = list(itertools.accumulate(map(len, wholes)))
    if seed % 4:
        ends = sorted({*chance.sample(ends, k=len(ends) // 2), *chance.choices(range(1, ends[-1]), k=seed % 4 - 1)})
    data = b"".join(wholes)
    pieces = [data[start:end] for start, end in itertools.pairwise(sorted({0, *ends, len(data)}))]

    async def act() -> list[Any]:
        wire = await port.connect()
        return await asyncio.gather(answers_of(wire, len(names)), send(port, wire, pieces))

    answers, _ = port.run(act)
    for name, answer in zip(names, answers, strict=True):
        assert REQUESTS[name][2] in str(answer.body)


async def answers_of(wire: Wire, count: int) -> list[Any]:
    return [await wire.answer() for _ in range(count)]


async def send(port: Port, wire: Wire, pieces: list[bytes]) -> None:
    for piece in pieces:
        wire.writer.write(piece)
        await wire.writer.drain()
        await asyncio.sleep(0.001)


class Inner(asyncio.Protocol):
    """aiohttp's protocol, of which only what it gets is seen."""

    def __init__(self) -> None:
        self.received: list[bytes] = []

    def data_received(self, data: bytes) -> None:
        self.received.append(data)


class Transport(asyncio.Transport):
    """A transport whose peer has read nothing of the last `waiting` bytes."""

    def __init__(self, waiting: int = 0) -> None:
        super().__init__()
        self.waiting = waiting
        self.written: list[bytes] = []

    def write(self, data: Any) -> None:
        self.written.append(bytes(data))

    def get_write_buffer_size(self) -> int:
        return self.waiting


GETS = encoded("gps"), encoded("attitude")


@pytest.mark.parametrize(
    ("before", "waiting", "repeated"),
    [
        ([GETS[0]], 0, True),
        ([GETS[1], GETS[0]], 0, False),  # the answer may be that to the first
        ([GETS[1] + GETS[0]], 0, False),
        ([b"\r\n", GETS[0]], 0, False),
        ([GETS[0][:9], GETS[0]], 0, False),  # the second piece is no request
        ([GETS[0]], 1, False),  # the answer before it is still on its way
        ([encoded("post")], 0, False),
    ],
)
def test_connection_answers_again_only_what_came_alone(
    loop: FastLoop, before: list[bytes], waiting: int, repeated: bool
) -> None:
    async def act() -> tuple[list[bytes], list[bytes]]:
        inner, transport = Inner(), Transport(waiting)
        connection = Connection(lambda: inner)
        connection.connection_made(transport)
        for piece in before:
            connection.data_received(piece)
        connection.began()
        connection.remember(lambda: b"again")
        connection.ended()
        connection.data_received(before[-1])
        connection.connection_lost(None)
        return transport.written, inner.received

    written, received = loop.run(act())
    assert (written, received) == (([b"again"], before) if repeated else ([], [*before, before[-1]]))
