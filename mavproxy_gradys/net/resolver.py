"""Names -> addresses, in our own threads: a silent name server delays no other lookup."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import socket
import threading
from collections.abc import Callable
from typing import Any

from aiohttp.abc import AbstractResolver, ResolveResult

Info = tuple[Any, ...]  # family, kind, protocol, canonical name, address: as getaddrinfo has them
NUMERIC = socket.AI_NUMERICHOST | socket.AI_NUMERICSERV


class Resolver(AbstractResolver):
    """Looks names up; a name is not requested again while its answer is awaited.

    Args:
        ask: as socket.getaddrinfo, blocking.
    """

    def __init__(self, ask: Callable[..., list[Info]] = socket.getaddrinfo) -> None:
        self._ask = ask
        self._pending: dict[tuple[Any, ...], asyncio.Future[list[Info]]] = {}

    async def look_up(self, host: str, port: int, family: int = 0, kind: int = socket.SOCK_STREAM) -> list[Info]:
        """The addresses of a host; an IP address is returned at once.

        Raises:
            OSError: there is no such host.
        """
        if is_address(host):
            return list(socket.getaddrinfo(host, port, family, kind, flags=NUMERIC))
        question = (host, port, family, kind)
        if question not in self._pending:
            self._pending[question] = self._begin(question)
        return await asyncio.shield(self._pending[question])

    def _begin(self, question: tuple[Any, ...]) -> asyncio.Future[list[Info]]:
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[list[Info]] = loop.create_future()

        def settle(infos: list[Info], error: OSError | None) -> None:
            self._pending.pop(question, None)
            if error is None:
                answer.set_result(infos)
            else:
                answer.set_exception(error)
                answer.exception()  # read it, because perhaps no caller waits any more

        def ask() -> None:
            infos: list[Info] = []
            error: OSError | None = None
            try:
                infos = self._ask(*question)
            except OSError as failure:
                error = failure
            except UnicodeError as failure:  # not a valid DNS name
                error = socket.gaierror(socket.EAI_NONAME, f"not a host's name ({failure})")
            with contextlib.suppress(RuntimeError):  # the loop has ended meanwhile
                loop.call_soon_threadsafe(settle, infos, error)

        threading.Thread(target=ask, name=f"gradys-name-{question[0]}", daemon=True).start()
        return answer

    async def resolve(
        self, host: str, port: int = 0, family: socket.AddressFamily = socket.AF_INET
    ) -> list[ResolveResult]:
        """The lookup for aiohttp's connector."""
        return [
            ResolveResult(hostname=host, host=address[0], port=address[1], family=kin, proto=protocol, flags=NUMERIC)
            for kin, _, protocol, _, address in await self.look_up(host, port, family)
        ]

    async def close(self) -> None:
        """Nothing to close: a waiting thread ends by itself."""


def is_address(host: str) -> bool:
    """Whether the text is an IP address, not a name."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
