"""A ground station that remembers what MAVProxys push to it."""

from __future__ import annotations

import json
import socket
import ssl
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl


class Recorder(ThreadingHTTPServer):
    """A ground station that remembers what it got.

    Attributes:
        updates: (time, peer, headers, body) of each POST.
        status, headers, body: what it answers.
        delay: s until it does.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, port: int, certificate: Path | None = None, host: str = "127.0.0.1") -> None:
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        super().__init__((host, port), _Handler)
        if certificate is not None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(certificate)
            self.socket = context.wrap_socket(self.socket, server_side=True)
        self.updates: list[tuple[float, Any, Any, bytes]] = []
        self.status, self.headers, self.body = 200, {}, {"id": 1, "type": 103}
        self.delay = 0.0
        self._thread = threading.Thread(target=self.serve_forever, args=(0.05,), daemon=True)
        self._thread.start()

    @property
    def forms(self) -> list[dict[str, str]]:
        return [dict(parse_qsl(body.decode(), strict_parsing=True)) for *_, body in self.updates]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that goes away is none of our tests' business."""

    def stop(self) -> None:
        self.shutdown()
        self._thread.join()
        self.server_close()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Recorder

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.updates.append((time.monotonic(), self.client_address, self.headers, body))
        time.sleep(self.server.delay)
        output = json.dumps(self.server.body).encode()
        self.send_response(self.server.status)
        for name, value in {"Content-Length": str(len(output)), **self.server.headers}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(output)

    def log_message(self, *_: Any) -> None:
        """Nothing on the terminal."""
