"""Checks whether the API answers."""

from __future__ import annotations

import asyncio
import ssl
from urllib.parse import urlsplit

from mavproxy_uavapi.core.timeout import wait_with_timeout

TIMEOUT_S = 2.0


async def answers(url: str) -> int | None:
    """The HTTP status of `/telemetry/status` at the API's URL; None while nothing answers. 401 is an answer too: no
    token is sent, because the program on the port may not be ours.
    """
    try:
        return await wait_with_timeout(TIMEOUT_S, _status(url))
    except (OSError, asyncio.TimeoutError, EOFError, ValueError):
        return None


async def _status(url: str) -> int:
    parts = urlsplit(url)
    tls = _unverified() if parts.scheme == "https" else None
    reader, writer = await asyncio.open_connection(parts.hostname, parts.port, ssl=tls)
    try:
        request = f"GET /telemetry/status HTTP/1.1\r\nHost: {parts.netloc}\r\nConnection: close\r\n\r\n"
        writer.write(request.encode("ascii"))
        protocol, status = (await reader.readline()).split(maxsplit=2)[:2]
        if not protocol.startswith(b"HTTP/"):
            raise ValueError("not an HTTP server")
        return int(status)
    finally:
        writer.close()


def _unverified() -> ssl.SSLContext:
    """TLS with whatever certificate the API has: it need not be for the address by which we ask."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context
