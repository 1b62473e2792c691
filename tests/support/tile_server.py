"""A source of map tiles on this machine, as one on the internet: another origin, which allows others."""

from __future__ import annotations

import contextlib
import http.server
import threading
from collections.abc import Iterator

from tests.support.pictures import grey_png


class TileServer(http.server.ThreadingHTTPServer):
    """Answers each path with a picture; `asked` are the paths, `lacks` those that it does not have."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.asked: list[str] = []
        self.lacks: set[str] = set()

    @property
    def source(self) -> str:
        """As `tile_source` names it."""
        return f"http://127.0.0.1:{self.server_address[1]}/{{z}}/{{x}}/{{y}}.png"


class _Handler(http.server.BaseHTTPRequestHandler):
    server: TileServer

    def do_GET(self) -> None:
        self.server.asked.append(self.path)
        self.send_response(404 if self.path in self.server.lacks else 200)
        self.send_header("Access-Control-Allow-Origin", "*")
        self.send_header("Content-Type", "image/png")
        self.end_headers()
        with contextlib.suppress(OSError):
            self.wfile.write(grey_png())

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextlib.contextmanager
def tile_server() -> Iterator[TileServer]:
    """One that runs."""
    with TileServer() as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
