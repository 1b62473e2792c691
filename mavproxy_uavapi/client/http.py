"""Sends requests to one vehicle's API, and raises the errors of its answers."""

from __future__ import annotations

import asyncio
import json
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import aiohttp

from mavproxy_uavapi.client.errors import Unreachable, error_of
from mavproxy_uavapi.core.text import reason_of

CONNECT_TIMEOUT = 5.0  # s for the TCP connection; a verb's answer may take as long as its flight
PART = 64 * 1024  # bytes of a file that are received and written at a time
PING_PERIOD = 10.0  # s between pings that check whether a silent stream is alive


def _as_text(values: Mapping[str, Any]) -> dict[str, str]:
    spelled = {name: str(value).lower() if isinstance(value, bool) else value for name, value in values.items()}
    return {name: str(value) for name, value in spelled.items() if value is not None}


class Http:
    """One API: its address and its connections.

    Args:
        url: the API's address, optionally with a prefix for its paths (`http://host:8000/vehicles/2`).
        token: the API's token, if it needs one.
    """

    def __init__(self, url: str, token: str = "") -> None:
        self.url = (url if "://" in url else f"http://{url}").rstrip("/")
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        timeout = aiohttp.ClientTimeout(total=None, sock_connect=CONNECT_TIMEOUT)
        # The vehicle is on this machine or this network, so proxy settings of the environment are ignored. Each verb
        # in flight needs a connection of its own, so their number is not limited.
        connector = aiohttp.TCPConnector(limit=0)
        self._session = aiohttp.ClientSession(headers=headers, timeout=timeout, connector=connector, trust_env=False)

    async def __aenter__(self) -> Http:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self._session.close()

    async def get(self, path: str, **query: Any) -> dict[str, Any]:
        """Send a GET; see `ask`."""
        return await self.ask("GET", path, query)

    async def ask(
        self, method: str, path: str, query: Mapping[str, Any], body: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Send a request and return the body of its success. Values in query and body that are None are left out.

        Raises:
            UavApiError: the error of the API's answer.
            Unreachable: nothing answers, or the answer is not JSON.
        """
        content = None if body is None else {name: value for name, value in body.items() if value is not None}
        url = self.url + path
        try:
            async with self._session.request(method, url, params=_as_text(query), json=content) as response:
                answer = json.loads(await response.read())
        except (aiohttp.ClientError, asyncio.TimeoutError, OSError) as error:
            raise Unreachable(f"{url}: {reason_of(error) or 'no answer'}") from error
        except ValueError as error:
            raise Unreachable(f"{url} does not answer as the API does") from error
        if not isinstance(answer, dict):
            raise Unreachable(f"{url} does not answer as the API does")
        if response.status >= 400:
            raise error_of(response.status, answer)
        return answer

    async def save(self, path: str, file: Path) -> None:
        """Send a GET and save the body of its success in `file`, which changes only if all of it has arrived.

        Raises:
            UavApiError: the error of the API's answer.
            Unreachable: nothing answers, or the connection breaks.
            OSError: `file` cannot be written.
        """
        url = self.url + path
        handle, name = await asyncio.to_thread(tempfile.mkstemp, dir=file.parent, prefix=f".{file.name}-")
        try:
            with os.fdopen(handle, "wb") as part:
                await self._receive(url, part)
            await asyncio.to_thread(os.replace, name, file)
        except BaseException:
            with suppress(FileNotFoundError):
                os.unlink(name)
            raise

    async def _receive(self, url: str, file: BinaryIO) -> None:
        try:
            async with self._session.get(url) as response:
                if response.status >= 400:
                    raise error_of(response.status, await response.json())
                async for data in response.content.iter_chunked(PART):
                    await asyncio.to_thread(file.write, data)
        except (aiohttp.ClientError, asyncio.TimeoutError) as error:
            raise Unreachable(f"{url}: {reason_of(error) or 'no answer'}") from error

    def stream(self, path: str, **query: Any) -> aiohttp.client._WSRequestContextManager:
        """A WebSocket, as a context manager."""
        url, query = self.url + path, _as_text(query)
        return self._session.ws_connect(url, params=query, compress=0, max_msg_size=1 << 20, heartbeat=PING_PERIOD)
