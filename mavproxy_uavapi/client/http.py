"""Requests to one vehicle's API, and the errors of its answers."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from types import TracebackType
from typing import Any

import aiohttp

from mavproxy_uavapi.client.errors import Unreachable, error_of

CONNECT_TIMEOUT = 5.0  # s to the TCP connection; a verb's answer may take as long as its flight
ALIVE_EVERY = 10.0  # s between two looks at whether a silent stream is alive


def _as_text(values: Mapping[str, Any]) -> dict[str, str]:
    spelled = {name: str(value).lower() if isinstance(value, bool) else value for name, value in values.items()}
    return {name: str(value) for name, value in spelled.items() if value is not None}


class Http:
    """One API: its address and its connections.

    Args:
        url: of the API, with or without a path before its own (`http://host:8000/vehicles/2`).
        token: where it wants one.
    """

    def __init__(self, url: str, token: str = "") -> None:
        self.url = (url if "://" in url else f"http://{url}").rstrip("/")
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        timeout = aiohttp.ClientTimeout(total=None, sock_connect=CONNECT_TIMEOUT)
        # The vehicle is on this machine or this network: no proxy of the environment is in between. Each verb in
        # flight has a connection of its own, so there is no limit.
        connector = aiohttp.TCPConnector(limit=0)
        self._session = aiohttp.ClientSession(headers=headers, timeout=timeout, connector=connector, trust_env=False)

    async def __aenter__(self) -> Http:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self._session.close()

    async def get(self, path: str, **query: Any) -> dict[str, Any]:
        """As `ask`, of a reading or a command."""
        return await self.ask("GET", path, query)

    async def ask(
        self, method: str, path: str, query: Mapping[str, Any], body: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """The body of a success. What is None in query and body is left out.

        Raises:
            UavApiError: what the API answered, by its code.
            Unreachable: nothing answers, or no JSON.
        """
        content = None if body is None else {name: value for name, value in body.items() if value is not None}
        url = self.url + path
        try:
            async with self._session.request(method, url, params=_as_text(query), json=content) as response:
                answer = json.loads(await response.read())
        except (aiohttp.ClientError, asyncio.TimeoutError, OSError) as error:
            raise Unreachable(f"{url}: {str(error) or 'no answer'}") from error
        except ValueError as error:
            raise Unreachable(f"{url} does not answer as the API does") from error
        if not isinstance(answer, dict):
            raise Unreachable(f"{url} does not answer as the API does")
        if response.status >= 400:
            raise error_of(response.status, answer)
        return answer

    def stream(self, path: str, **query: Any) -> aiohttp.client._WSRequestContextManager:
        """A WebSocket, as a context manager."""
        url, query = self.url + path, _as_text(query)
        return self._session.ws_connect(url, params=query, compress=0, max_msg_size=1 << 20, heartbeat=ALIVE_EVERY)
