from __future__ import annotations

import asyncio
import socket
import threading
from typing import Any

import pytest

from mavproxy_gradys.net.resolver import Resolver
from tests.support.virtual_time import FastLoop

INFO = (socket.AF_INET, socket.SOCK_STREAM, 6, "", ("192.0.2.7", 80))


class Server:
    """A name server that answers about `good` at once and about all others when it is told to."""

    def __init__(self) -> None:
        self.requested: list[str] = []
        self.answers = threading.Event()

    def ask(self, host: str, *_: Any) -> Any:
        self.requested.append(host)
        if host != "good":
            self.answers.wait(20)
        if host == "nobody":
            raise socket.gaierror(-2, "Name or service not known")
        return [INFO]


def test_unanswered_name_holds_up_no_other_and_is_looked_up_once(loop: FastLoop) -> None:
    server = Server()
    names = Resolver(server.ask)

    async def look_up() -> None:
        for _ in range(3):
            for dead in ("dead1", "dead2"):
                with pytest.raises(asyncio.TimeoutError):
                    await asyncio.wait_for(names.look_up(dead, 80), 3.0)
            assert await names.look_up("good", 80) == [INFO]
        assert sorted(server.requested) == ["dead1", "dead2", "good", "good", "good"]
        server.answers.set()
        assert await names.look_up("dead1", 80) == [INFO]

    loop.real_wait = 0.05
    loop.run(look_up())


def test_an_address_needs_no_name_server(loop: FastLoop) -> None:
    names = Resolver(lambda *_: pytest.fail("it was asked"))
    for address in ("192.0.2.7", "2001:db8::7"):
        assert loop.run(names.look_up(address, 80))[0][4][:2] == (address, 80)


@pytest.mark.parametrize("host", ["nobody", "a..b", "x" * 70])
def test_what_is_no_host_is_an_error_of_the_system(loop: FastLoop, host: str) -> None:
    server = Server()
    server.answers.set()
    with pytest.raises(OSError):
        loop.run(Resolver(server.ask if host == "nobody" else socket.getaddrinfo).look_up(host, 80))


def test_as_aiohttp_asks(loop: FastLoop) -> None:
    (entry,) = loop.run(Resolver(Server().ask).resolve("good", 80))
    assert (entry["hostname"], entry["host"], entry["port"], entry["family"]) == ("good", "192.0.2.7", 80, 2)
