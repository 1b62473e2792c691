"""The page at / with an API that a test plays: vehicles that stand where it says, and a list of what the page asks.

No vehicle, no MAVProxy: the same picture each time, and a gesture's whole effect in one list.
"""

from __future__ import annotations

import contextlib
import http.server
import json
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mavproxy_uavapi.http.handlers.page import KINDS

FOLDER = Path(__file__).parents[2] / "mavproxy_uavapi" / "page"
HOME = (-35.363261, 149.165230)  # degrees
METRES_PER_DEGREE, SHRUNK = 111_318.845, 0.8155
EVERY = 0.3  # s between two tellings


def vehicle(system: int, north: float = 0.0, east: float = 0.0, **more: Any) -> dict[str, dict[str, Any]]:
    """The views of a vehicle in flight, so many metres from home; `more` is of its view `vehicle`."""
    lat, lon = HOME[0] + north / METRES_PER_DEGREE, HOME[1] + east / METRES_PER_DEGREE / SHRUNK
    own = {
        "type": "copter",
        "mode": "GUIDED",
        "armed": True,
        "ready_to_arm": True,
        "why_not": [],
        "landed_state": "in_air",
        "ekf_ok": True,
        "paused": False,
        "commanded_by": None,
        "held_by": None,
        "battery_remaining": 80,
        "current": system == 1,
        "link": {"alive": True, "heartbeat_age_s": 0, "packet_loss": 0},
        **more,
    }
    return {
        "vehicle": own,
        "gps": {
            "position": {"lat": lat, "lon": lon, "relative_alt": 12.0},
            "velocity": {"vz": 0},
            "heading": 40 * system % 360,
        },
        "home": {"lat": HOME[0], "lon": HOME[1]},
        "general": {"groundspeed": 0.0},
        "attitude": {"roll": 5, "pitch": -3, "yaw": 40},
        "battery": {"battery_remaining": own["battery_remaining"], "voltage": 12_600},
        "gps_raw": {"fix_type": 3, "satelites": 14},
        "ned": {"position": {"x": north, "y": east}},
        "mission": {"current": 0, "total": 0, "state": "no_mission", "distance_m": None},
    }


@dataclass
class PlayedApi:
    """What it tells, answers and was asked."""

    vehicles: dict[int, dict[str, dict[str, Any]]]
    folder: Path = FOLDER
    address: str = ""
    answers: dict[str, tuple[int, dict[str, Any]]] = field(default_factory=dict)  # by path
    asked: list[tuple[str, str, Any]] = field(default_factory=list)  # method, path, body: of what commands
    events: list[dict[str, Any]] = field(default_factory=list)  # told once more at each telling
    over: bool = False

    def told(self) -> list[dict[str, Any]]:
        """What the stream tells now."""
        clock = time.monotonic()
        stamp = {"clock": clock, "time": time.time()}
        views = [
            {"system": system, "view": view, "info": info, **stamp}
            for system, views in self.vehicles.items()
            for view, info in views.items()
        ]
        return [{"event": "alive", "system": 0, "info": {}, **stamp}, *views, *({**e, **stamp} for e in self.events)]


def _handler(api: PlayedApi) -> type[http.server.BaseHTTPRequestHandler]:
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            path = self.path.partition("?")[0]
            name = "index.html" if path == "/" else path.removeprefix("/page/")
            file = api.folder / name
            if path == "/telemetry/stream":
                self._tell()
            elif (path == "/" or path.startswith("/page/")) and file.is_file():
                self._send(200, file.read_bytes(), KINDS[file.suffix])
            else:
                self._answer(path, (404, {"detail": "no such path", "code": "not_found"}))

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            api.asked.append((self.command, self.path, json.loads(body) if body else None))
            self._answer(self.path.partition("?")[0], (202, {"job": str(len(api.asked)), "result": "accepted"}))

        do_PUT = do_DELETE = do_POST

        def _answer(self, path: str, otherwise: tuple[int, dict[str, Any]]) -> None:
            status, body = api.answers.get(path, otherwise)
            self._send(status, json.dumps(body).encode(), "application/json")

        def _send(self, status: int, body: bytes, kind: str) -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            with contextlib.suppress(OSError):  # the browser has gone
                self.end_headers()
                self.wfile.write(body)

        def _tell(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            self.end_headers()
            with contextlib.suppress(OSError):
                while not api.over:
                    self.wfile.write("".join(f"data: {json.dumps(one)}\n\n" for one in api.told()).encode())
                    time.sleep(EVERY)

        def log_message(self, *_: Any) -> None:
            """Say nothing."""

    return Handler


@contextlib.contextmanager
def played_api(vehicles: dict[int, dict[str, dict[str, Any]]], folder: Path = FOLDER) -> Iterator[PlayedApi]:
    """A server of the page and of an API that tells of these vehicles."""
    api = PlayedApi(vehicles, folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), _handler(api)) as server:
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        api.address = f"http://127.0.0.1:{server.server_address[1]}"
        try:
            yield api
        finally:
            api.over = True
            server.shutdown()
            thread.join()
