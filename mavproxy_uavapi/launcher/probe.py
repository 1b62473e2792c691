"""Checks whether the API answers."""

from __future__ import annotations

import asyncio
from urllib.parse import urlsplit

from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.launcher.command_lines import api_url
from mavproxy_uavapi.launcher.options import RunOptions

TIMEOUT_S = 2.0


async def answers(options: RunOptions) -> int | None:
    """The HTTP status of `/telemetry/status`; None while nothing answers. 401 is an answer too: no token is sent,
    because the program on the port may not be ours.
    """
    try:
        return await wait_with_timeout(TIMEOUT_S, _status(api_url(options)))
    except (OSError, asyncio.TimeoutError, EOFError, ValueError):
        return None


async def _status(url: str) -> int:
    parts = urlsplit(url)
    reader, writer = await asyncio.open_connection(parts.hostname, parts.port)
    try:
        request = f"GET /telemetry/status HTTP/1.1\r\nHost: {parts.netloc}\r\nConnection: close\r\n\r\n"
        writer.write(request.encode("ascii"))
        protocol, status = (await reader.readline()).split(maxsplit=2)[:2]
        if not protocol.startswith(b"HTTP/"):
            raise ValueError("not an HTTP server")
        return int(status)
    finally:
        writer.close()
