"""MQTT clients for the brokers that settings name."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from typing import Any
from urllib.parse import SplitResult, unquote

import aiomqtt

from mavproxy_gradys.net.http_client import ssl_context
from mavproxy_uavapi.core.timeout import wait_with_timeout

KEEP_ALIVE = 15  # s; the broker closes a silent connection after 1.5 times this
DISCONNECT_TIMEOUT = 1.0  # s
SILENT = logging.Logger("mqtt", logging.CRITICAL)  # no handler has aiomqtt's own: Python would print it to the prompt


def make_client(parts: SplitResult, port: int, timeout: float, ca_file: str, **more: Any) -> aiomqtt.Client:
    """A client that is not connected yet.

    Args:
        parts: of mqtt(s)://[USER:PASSWORD@]HOST.
        port: the broker's.
        timeout: s for an answer of the broker.
        ca_file: certificates to check TLS with; empty for the system's.
        more: options of `aiomqtt.Client`.

    Raises:
        NotDelivered: `ca_file` cannot be read, or holds no certificate.
    """
    client = aiomqtt.Client(
        parts.hostname or "",
        port,
        username=unquote(parts.username) if parts.username else None,
        password=unquote(parts.password) if parts.password else None,
        timeout=timeout,
        keepalive=KEEP_ALIVE,
        tls_context=ssl_context(ca_file) if parts.scheme == "mqtts" else None,
        logger=SILENT,
        **more,
    )
    # Whoever uses it hears that it was disconnected; retrieved here, too, else asyncio prints it.
    client._disconnected.add_done_callback(lambda ended: ended.cancelled() or ended.exception())
    return client


async def disconnect(client: aiomqtt.Client) -> None:
    """Disconnect in order; if the broker does not answer, close the connection anyway."""
    with contextlib.suppress(aiomqtt.MqttError, asyncio.TimeoutError):
        await wait_with_timeout(DISCONNECT_TIMEOUT, client.__aexit__(None, None, None))
    open_socket = client._client.socket()  # aiomqtt leaves it open if the broker was too slow
    if isinstance(open_socket, socket.socket):
        with contextlib.suppress(OSError):
            open_socket.shutdown(socket.SHUT_RDWR)
