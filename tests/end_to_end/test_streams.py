"""Streams that nobody reads, and the trail of flights at the prompt, in a real MAVProxy."""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Iterator
from typing import Any

import pytest
import requests

from mavproxy_uavapi.core.streaming import MOST_OPEN
from tests.support.processes import Rig

pytestmark = pytest.mark.long

SHARE = MOST_OPEN // 2  # of one caller
RIG_LOGS = True
RIG_SPEEDUP = 2  # nobody flies far here, and each message costs processor time


@pytest.fixture
def unread(embedded_rig: Rig) -> Iterator[list[socket.socket]]:
    """As many streams as one program may open, none of which is read."""
    with contextlib.ExitStack() as clients:
        opened = []
        for _ in range(SHARE):
            client = clients.enter_context(socket.socket())
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            client.connect(("127.0.0.1", embedded_rig.port))
            client.sendall(b"GET /telemetry/stream HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            opened.append(client)
        # Each has its place before anybody else asks for one; the rest is not read.
        assert {client.recv(15) for client in opened} == {b"HTTP/1.1 200 OK"}
        yield opened


def test_streams_that_nobody_reads_cost_a_reader_nothing(embedded_rig, harness, unread):
    rig = embedded_rig
    harness.eventually(lambda: status_of_one_more(rig) == 429, what="a refusal of one more")
    assert status_of_one_more(rig, "Mozilla/5.0 (X11) Firefox/127.0") == 200  # the pilot's page on the same machine
    for _ in range(50):  # how long they take is for benchmarks/bench_streams.py to say
        rig.ok(rig.get("/telemetry/gps", timeout=5))
    for client in unread:
        client.close()

    harness.eventually(lambda: status_of_one_more(rig) == 200, what="a free place")


def status_of_one_more(rig: Rig, program: str = "a script") -> int:
    """The status of another stream, which is closed at once: read to its end it would never end."""
    names = {"User-Agent": program}
    with requests.get(f"{rig.url}/telemetry/stream", headers=names, stream=True, timeout=5) as answer:
        return answer.status_code


def test_flight_that_was_begun_at_the_prompt_is_in_the_audit_trail(embedded_rig, harness):
    pytest.importorskip("cv2")
    rig = embedded_rig
    rig.mavproxy.ask("module load vision", "Loaded module vision")
    rig.mavproxy.ask("vision search 3", "`arm` it first")
    file = rig.directory / "uavapi-audit.jsonl"
    (entry,) = harness.eventually(lambda: of_console(file), what="an entry")
    assert (entry["verb"], entry["request"], entry["outcome"]) == ("/vision/search", {"id": 3}, "not_armed")
    assert "console /vision/search(id=3): not_armed" in rig.mavproxy.ask("uavapi log 3", "all of them:")
    assert file.stat().st_mode & 0o777 == 0o600


def of_console(file: Any) -> list[dict[str, Any]]:
    """The trail's entries of the prompt."""
    if not file.exists():
        return []
    entries = [json.loads(line) for line in file.read_text(encoding="ascii").splitlines()]
    return [entry for entry in entries if entry.get("client") == "console"]
