"""MQTT clients for the brokers that settings name."""

from __future__ import annotations

import ssl
from typing import Any
from urllib.parse import SplitResult, unquote

import aiomqtt

from mavproxy_gradys.net.http_client import tls_context

KEEP_ALIVE = 15  # s; the broker closes a silent connection after 1.5 times this


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
    return aiomqtt.Client(
        parts.hostname or "",
        port,
        username=unquote(parts.username) if parts.username else None,
        password=unquote(parts.password) if parts.password else None,
        timeout=timeout,
        keepalive=KEEP_ALIVE,
        tls_context=_tls(ca_file) if parts.scheme == "mqtts" else None,
        **more,
    )


def _tls(ca_file: str) -> ssl.SSLContext:
    context = tls_context(ca_file)
    return context if isinstance(context, ssl.SSLContext) else ssl.create_default_context()
