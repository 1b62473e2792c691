"""The launcher's question whether the API answers."""

from __future__ import annotations

import asyncio
import ssl
import subprocess
from pathlib import Path

import pytest

from mavproxy_uavapi.launcher.probe import answers


async def status_of_a_server(words: bytes, tls: ssl.SSLContext | None = None) -> int | None:
    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(words)
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0, ssl=tls)
    async with server:
        port = server.sockets[0].getsockname()[1]
        return await answers(f"{'https' if tls else 'http'}://127.0.0.1:{port}")


def test_status_of_an_http_server_and_none_of_another() -> None:
    assert asyncio.run(status_of_a_server(b"HTTP/1.1 401 Unauthorized\r\n\r\n")) == 401
    assert asyncio.run(status_of_a_server(b"SSH-2.0-x y\r\n")) is None


@pytest.mark.needs("openssl")
def test_certificate_that_nobody_has_signed_is_no_silence(tmp_path: Path) -> None:
    key, cert = str(tmp_path / "key.pem"), str(tmp_path / "cert.pem")
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=drone"]
    subprocess.run([*command, "-keyout", key, "-out", cert], check=True, capture_output=True)
    tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    tls.load_cert_chain(cert, key)
    assert asyncio.run(status_of_a_server(b"HTTP/1.1 200 OK\r\n\r\n", tls)) == 200
