from __future__ import annotations

import asyncio
from typing import Any

import pytest

from tests.support.api_port import FORM, OWNER, START, Port
from tests.support.drone import Drone

PART = b'Content-Disposition: form-data; name="%b"; filename="a.py"\r\n'
NESTED = b"--b\r\nContent-Type: multipart/mixed; boundary=%b\r\n\r\n"
SCRIPT = b"--b\r\n" + PART % b"file" + b"\r\nprint(1)\r\n--b--\r\n"


def test_form_with_an_endless_part_before_its_file_is_refused(flying: Drone, port: Port) -> None:
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
    ],
    ids=["a form", "forms in forms", "a long header", "many headers", "no header"],
)
def test_form_is_refused_for_what_comes_before_its_file(
    flying: Drone, port: Port, caplog: pytest.LogCaptureFixture, before: bytes, why: str
) -> None:
    answer = post_script(port, before + SCRIPT)
    assert (answer.status, answer.body["code"]) == (400, "bad_request")
    assert why in answer.body["detail"]
    assert [record for record in caplog.records if record.exc_info] == []


OTHER = b"--b\r\n" + PART % b"other" + b"\r\nx\r\n"
FIELD = b'--b\r\nContent-Disposition: form-data; name="note"\r\n\r\nx\r\n'
NAMELESS = b"--b\r\n\r\nx\r\n" * 20_000


@pytest.mark.parametrize(
    ("body", "name"),
    [
        (OTHER + SCRIPT, "other"),
        (FIELD + SCRIPT, "note"),
        (NAMELESS + SCRIPT, ""),
        (SCRIPT.removesuffix(b"--b--\r\n") + SCRIPT, "file"),
        (SCRIPT.removesuffix(b"--b--\r\n") + FIELD + b"--b--\r\n", "file"),
    ],
    ids=["another file", "another field", "many without a name", "a second file", "a field behind it"],
)
def test_form_has_one_file_and_nothing_else(flying: Drone, port: Port, body: bytes, name: str) -> None:
    answer = post_script(port, body)
    assert (answer.status, answer.body["detail"][0]["loc"]) == (422, ["body", name])
    assert post_script(port, SCRIPT).status == 200
