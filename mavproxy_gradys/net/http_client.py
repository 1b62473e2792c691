"""The HTTP client: one keep-alive session, time-outs, no redirects, TLS with a CA file, a bearer token."""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
from typing import Any, Protocol

import aiohttp

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net.resolver import Resolver

CONNECTIONS = 8  # connections to one receiver at once
LARGEST_ANSWER = 1024 * 1024  # bytes; a longer answer is not read to its end
LARGEST_JSON = 64 * 1024  # bytes; a longer one is not decoded, which would hold up MAVProxy for 10 ms and more
LONGEST_TOLD = 200  # letters of a receiver's text that are shown
FORM = "application/x-www-form-urlencoded"
JSON = "application/json"
# Statuses about the address, the sender or the time; all others count as answers about the content.
NOT_FOR_CONTENT = {401, 403, 404, 405, 407, 408, 425, 429, 502, 503, 504}


class Poster(Protocol):
    """The client interface for the push and the HTTP sink."""

    async def post(self, url: str, body: bytes, content_type: str) -> Any:
        """See `Client.post`."""

    async def close(self) -> None:
        """Close the connections."""


class Client:
    """Posts to one receiver; belongs to the asyncio thread.

    Args:
        timeout: s from the first byte of the request to the last byte of the answer.
        token: sent as a bearer token; empty for none.
        ca_file: certificates to check TLS receivers with; empty for the system's own.

    Raises:
        NotDelivered: the CA file cannot be used.
    """

    def __init__(self, timeout: float, token: str = "", ca_file: str = "") -> None:
        headers = {"User-Agent": "mavproxy-uavapi", "Accept-Encoding": "identity"}
        if token:
            headers["Authorization"] = f"Bearer {token}"
        self._timeout = timeout
        self._session = aiohttp.ClientSession(
            connector=aiohttp.TCPConnector(limit=CONNECTIONS, ssl=tls_context(ca_file), resolver=Resolver()),
            timeout=aiohttp.ClientTimeout(total=timeout),
            headers=headers,
            cookie_jar=aiohttp.DummyCookieJar(),
            auto_decompress=False,  # a small answer must not grow large
            trust_env=False,
        )

    async def close(self) -> None:
        """Close the connections."""
        await self._session.close()

    async def post(self, url: str, body: bytes, content_type: str) -> Any:
        """POST `body`; returns the JSON of a 200, None if its body is not JSON.

        A connection that the receiver closed while it was idle is reopened once.

        Raises:
            NotDelivered: no answer in time, or not a 200.
        """
        try:
            try:
                return await self._post(url, body, content_type)
            except aiohttp.ServerDisconnectedError:
                return await self._post(url, body, content_type)
        except (aiohttp.ClientError, OSError, asyncio.TimeoutError, ValueError) as error:
            raise NotDelivered(explain(error, self._timeout)) from error

    async def _post(self, url: str, body: bytes, content_type: str) -> Any:
        headers = {"Content-Type": content_type}
        async with self._session.post(url, data=body, headers=headers, allow_redirects=False) as answer:
            text = await read_up_to(answer.content, LARGEST_ANSWER)
            if answer.status != 200:
                raise refusal(answer.status, answer.headers.get("Location", ""))
        if len(text) > LARGEST_JSON:
            return None
        try:
            return json.loads(text)
        except (ValueError, RecursionError):
            return None  # a 200 is an acknowledgement, with any body


async def read_up_to(stream: aiohttp.StreamReader, limit: int) -> bytes:
    """The whole body.

    Raises:
        NotDelivered: it is longer than `limit` bytes.
    """
    content = bytearray()
    async for piece in stream.iter_any():
        content += piece
        if len(content) > limit:
            raise NotDelivered(f"it answers with more than {limit} bytes", reached=True)
    return bytes(content)


def refusal(status: int, location: str) -> NotDelivered:
    """The error for an answer that is not a 200."""
    if 300 <= status < 400:
        where = f" to {printable(location)}" if location else ""
        return NotDelivered(f"it redirects{where} ({status}), which is refused: set its real address", reached=True)
    why = {401: " (does it want a token?)", 403: " (is the token the right one?)"}.get(status, "")
    for_content = status >= 400 and status not in NOT_FOR_CONTENT
    return NotDelivered(f"it answers {status}{why}", reached=True, too_large=status == 413, for_content=for_content)


def printable(text: str) -> str:
    """A receiver's text, safe for a terminal."""
    return "".join(letter if letter.isprintable() else "?" for letter in text[:LONGEST_TOLD])


def tls_context(ca_file: str) -> ssl.SSLContext | bool:
    """The TLS context for receivers; True is aiohttp's own check by the system's certificates.

    Raises:
        NotDelivered: the file cannot be read, or holds no certificate.
    """
    return ssl_context(ca_file) if ca_file else True


def ssl_context(ca_file: str) -> ssl.SSLContext:
    """The TLS context that checks by that file, or by the system's certificates.

    Raises:
        NotDelivered: as `tls_context`.
    """
    try:
        return ssl.create_default_context(cafile=ca_file or None)
    except OSError as error:  # includes ssl.SSLError
        raise NotDelivered(f"ca_file {ca_file}: {error.strerror or error}") from error


def explain(error: BaseException, timeout: float) -> str:
    """Why there is no answer, in a few words."""
    if isinstance(error, asyncio.TimeoutError):
        return f"no answer within {timeout:g} s"
    if isinstance(error, aiohttp.InvalidURL):
        return "there is no such address"  # it may hold a password, and the error repeats it
    if isinstance(error, aiohttp.ServerDisconnectedError):
        return "it closed the connection without an answer"
    if isinstance(error, aiohttp.ClientConnectorCertificateError):
        return f"its certificate is not trusted: {error.certificate_error}"
    if isinstance(error, aiohttp.ClientConnectorError):
        return unreachable(error)
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def unreachable(error: aiohttp.ClientConnectorError) -> str:
    """Why there is no connection."""
    if isinstance(error.os_error, socket.gaierror):
        return f"no such host: {error.host}"
    if isinstance(error, aiohttp.ClientSSLError):
        return f"no TLS there: {error.os_error}"
    return f"cannot connect to {error.host}:{error.port}: {error.os_error.strerror or error.os_error}"
