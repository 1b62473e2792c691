"""Names -> addresses, in our own threads: a silent name server delays no other lookup."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import Any

from aiohttp.abc import AbstractResolver, ResolveResult

from mavproxy_gradys.net.daemon_threads import DaemonThreads
from mavproxy_uavapi.core.timeout import kept

Info = tuple[Any, ...]  # family, kind, protocol, canonical name, address: as getaddrinfo has them
NUMERIC = socket.AI_NUMERICHOST | socket.AI_NUMERICSERV


class Resolver(AbstractResolver):
    """Looks names up; a name is not requested again while its answer is awaited.

    Args:
        ask: as socket.getaddrinfo, blocking.
    """

    def __init__(self, ask: Callable[..., list[Info]] = socket.getaddrinfo) -> None:
        self._ask = ask
        self._threads = DaemonThreads("gradys-name")
        self._pending: dict[tuple[Any, ...], asyncio.Future[list[Info]]] = {}

    async def look_up(self, host: str, port: int, family: int = 0, kind: int = socket.SOCK_STREAM) -> list[Info]:
        """The addresses of a host; an IP address is returned at once.

        Raises:
            OSError: there is no such host.
        """
        with contextlib.suppress(socket.gaierror, UnicodeError):
            return list(socket.getaddrinfo(host, port, family, kind, flags=NUMERIC))
        question = (host, port, family, kind)
        if question not in self._pending:
            answer = asyncio.get_running_loop().run_in_executor(self._threads, self._answer, question)
            answer.add_done_callback(lambda _: self._pending.pop(question))
            self._pending[question] = answer
        return await kept(self._pending[question])

    def _answer(self, question: tuple[Any, ...]) -> list[Info]:
        try:
            return self._ask(*question)
        except UnicodeError as error:  # not a valid DNS name
            raise socket.gaierror(socket.EAI_NONAME, "not a host's name") from error

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
