from __future__ import annotations

import asyncio
import gzip
import socket
import tracemalloc
from typing import Any

import aiohttp
import pytest
from aiohttp import web

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net.http_client import FORM, LARGEST_ANSWER, Client, explain, refusal
from tests.support.virtual_time import FastLoop


class Peer:
    """A real server in the test's loop, on the loopback.

    Attributes:
        answer: what it answers with.
        connections: the peers that it saw.
    """

    def __init__(self) -> None:
        self.answer: Any = web.json_response
        self.connections: list[Any] = []
        self.url = ""
        self.runner: Any = None

    async def start(self) -> None:
        app = web.Application()
        app.router.add_post("/", self._take)
        self.runner = web.AppRunner(app, access_log=None)
        await self.runner.setup()
        site = web.TCPSite(self.runner, "127.0.0.1", 0)
        await site.start()
        self.url = f"http://127.0.0.1:{self.runner.addresses[0][1]}/"

    async def _take(self, request: web.Request) -> web.StreamResponse:
        self.connections.append(request.transport.get_extra_info("peername"))
        answer = self.answer(request)
        return (await answer) if asyncio.iscoroutine(answer) else answer


def requested(loop: FastLoop, peer: Peer, times: int = 1, **options: Any) -> list[Any]:
    """What the client makes of the peer's answers."""
    loop.real_wait = 0.2

    async def run() -> list[Any]:
        await peer.start()
        client = Client(3.0, **options)
        try:
            return [await client.post(peer.url, b"a=1", FORM) for _ in range(times)]
        finally:
            await client.close()
            await peer.runner.cleanup()

    answers: list[Any] = loop.run(run())
    return answers


@pytest.fixture
def peer() -> Peer:
    return Peer()


def test_one_connection_is_used_again(loop: FastLoop, peer: Peer) -> None:
    peer.answer = lambda request: web.json_response({"type": 103})
    assert requested(loop, peer, 3) == [{"type": 103}] * 3
    assert len(set(peer.connections)) == 1


@pytest.mark.parametrize("text", ["OK", "[" * 60_000, "9" * 5000, f"[{'1, ' * 30_000}1]"])
def test_a_200_that_is_no_json_is_none(loop: FastLoop, peer: Peer, text: str) -> None:
    peer.answer = lambda request: web.Response(text=text)
    assert requested(loop, peer) == [None]


@pytest.mark.parametrize(
    "answer,text,too_large",
    [
        (
            lambda request: web.Response(status=302, headers={"Location": "http://x/"}),
            "redirects to http://x/",
            False,
        ),
        (lambda request: web.Response(status=401), "does it want a token", False),
        (lambda request: web.Response(status=500), "answers 500", False),
        (lambda request: web.Response(status=413), "answers 413", True),
        (lambda request: web.Response(body=b"x" * (LARGEST_ANSWER + 1)), "more than", False),
    ],
)
def test_what_is_no_200_is_a_refusal(loop: FastLoop, peer: Peer, answer: Any, text: str, too_large: bool) -> None:
    peer.answer = answer
    with pytest.raises(NotDelivered, match=text) as raised:
        requested(loop, peer)
    assert raised.value.reached and raised.value.too_large == too_large


def test_an_answer_that_would_grow_large_is_no_json(loop: FastLoop, peer: Peer) -> None:
    bomb = gzip.compress(b" " * 50 * LARGEST_ANSWER)
    peer.answer = lambda request: web.Response(body=bomb, headers={"Content-Encoding": "gzip"})
    tracemalloc.start()
    assert requested(loop, peer) == [None]
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 4 * LARGEST_ANSWER


def test_an_address_that_cannot_be_called_is_not_repeated() -> None:
    assert "s3cret" not in explain(aiohttp.InvalidURL("http://me:s3cret@h/"), 3.0)


def test_what_a_redirect_says_cannot_write_to_the_terminal() -> None:
    assert str(refusal(302, "http://x/\x1b[2J\r\n" + "y" * 9000)).startswith("it redirects to http://x/?[2J??yyy")
    assert len(str(refusal(302, "y" * 9000))) < 300


@pytest.mark.parametrize(
    "status,of_content",
    [
        *((status, True) for status in (400, 413, 422, 500)),
        *((status, False) for status in (301, 401, 404, 429, 503)),
    ],
)
def test_what_less_of_it_may_help_against(status: int, of_content: bool) -> None:
    assert refusal(status, "").for_content == of_content


def test_a_connection_that_was_closed_meanwhile_is_replaced_once(loop: FastLoop, peer: Peer) -> None:
    def answer(request: web.Request) -> web.Response:
        if len(peer.connections) == 2:  # the second request finds its connection closed
            assert request.transport is not None
            request.transport.abort()
        return web.json_response({})

    peer.answer = answer
    assert requested(loop, peer, 2) == [{}, {}]


def test_silence_ends_with_the_time_out(loop: FastLoop, peer: Peer) -> None:
    async def silent(request: web.Request) -> web.Response:
        await asyncio.sleep(1000)
        return web.Response()

    peer.answer = silent
    with pytest.raises(NotDelivered, match="no answer within 3 s") as raised:
        requested(loop, peer)
    assert not raised.value.reached


def test_nobody_there_and_no_such_name(loop: FastLoop) -> None:
    loop.real_wait = 0.2
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]

    async def run(url: str) -> None:
        client = Client(3.0)
        try:
            await client.post(url, b"", FORM)
        finally:
            await client.close()

    with pytest.raises(NotDelivered, match="cannot connect to 127.0.0.1"):
        loop.run(run(f"http://127.0.0.1:{port}/"))
    with pytest.raises(NotDelivered, match=r"no such host|no answer within"):
        loop.run(run("http://no-such-host.invalid/"))
