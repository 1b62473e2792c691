"""The safety checker: its rules, its server, and the client before it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.safety import SafetyCheckerClient
from mavproxy_uavapi.aerpaw.safety_rules import SafetyRules
from mavproxy_uavapi.aerpaw.safety_server import SafetyCheckerServer, main_cli, read_rules
from mavproxy_uavapi.aerpaw.safety_wire import LARGEST, deserialize_msg, serialize_msg, serialize_request
from tests.support.ports import free_port

LIMITS = {"vehicle_type": "copter", "max_speed": 10, "min_speed": 1, "max_alt": 50, "min_alt": 5}


def kml(south: float, west: float, north: float, east: float) -> str:
    """A rectangle."""
    corners = [(west, south), (west, north), (east, north), (east, south), (west, south)]
    text = " ".join(f"{lon},{lat},0" for lon, lat in corners)
    ring = f"<outerBoundaryIs><LinearRing><coordinates>{text}</coordinates></LinearRing></outerBoundaryIs>"
    return f'<kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><Polygon>{ring}</Polygon></Placemark></kml>'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with two allowed rectangles, a gap between them, and a no-go zone in the first."""
    (tmp_path / "in.kml").write_text(kml(35.0, -79.0, 35.01, -78.99))
    (tmp_path / "beyond.kml").write_text(kml(35.02, -79.0, 35.03, -78.99))
    (tmp_path / "out.kml").write_text(kml(35.004, -78.996, 35.006, -78.994))
    return tmp_path


@pytest.fixture
def config(folder: Path) -> Path:
    """The server's file."""
    pytest.importorskip("yaml")
    lines = [f"{name}: {value}" for name, value in LIMITS.items()]
    lines += ["include_geofences: [in.kml, beyond.kml]", "exclude_geofences: [out.kml]"]
    (folder / "safety.yaml").write_text("\n".join(lines))
    return folder / "safety.yaml"


@pytest.fixture
def rules(config: Path) -> SafetyRules:
    return read_rules(config)


START = Coordinate(35.002, -78.998, 10)


@pytest.mark.parametrize(
    ("there", "reason"),
    [
        (Coordinate(35.008, -78.998, 20), ""),
        (Coordinate(35.008, -78.998, 51), "altitude of 51 m is not from 5.0 to 50.0"),
        (Coordinate(35.008, -78.998, 4), "altitude of 4 m"),
        (Coordinate(35.015, -78.998, 20), "outside of the geofence"),
        (Coordinate(35.005, -78.995, 20), "inside a no-go zone"),
        (Coordinate(35.008, -78.992, 20), "enters a no-go zone"),
        (Coordinate(35.025, -78.998, 20), "leaves the geofence"),
    ],
)
def test_way_is_judged(rules: SafetyRules, there: Coordinate, reason: str) -> None:
    allowed, said = rules.check_waypoint(START, there)
    assert allowed is not bool(reason)
    assert reason in said


def test_speeds_and_takeoffs_are_judged(rules: SafetyRules) -> None:
    assert [rules.check_speed(speed)[0] for speed in (0.5, 1, 10, 10.5)] == [False, True, True, False]
    assert [rules.check_altitude(alt)[0] for alt in (4, 5, 50, 51)] == [False, True, True, False]


def test_rover_has_no_altitudes(folder: Path) -> None:
    config = {"vehicle_type": "rover", "max_speed": 5, "min_speed": 0, "include_geofences": ["in.kml"]}
    rules = SafetyRules.from_mapping({**config, "exclude_geofences": []}, folder)
    assert rules.check_waypoint(START, Coordinate(35.008, -78.998, 0)) == (True, "")


@pytest.mark.parametrize(
    ("line", "says"),
    [("vehicle_type: plane", "plane"), ("max_alt: high", "high"), ("include_geofences: [none.kml]", "none.kml")],
)
def test_file_with_a_mistake_is_named(config: Path, line: str, says: str) -> None:
    text = config.read_text()
    name = line.partition(":")[0]
    config.write_text("\n".join(line if one.startswith(name) else one for one in text.splitlines()))
    with pytest.raises((ValueError, OSError), match=says):
        read_rules(config)


def test_missing_limit_is_named(config: Path) -> None:
    config.write_text("vehicle_type: copter\nmax_speed: 3\n")
    with pytest.raises(SystemExit, match="min_speed"):
        main_cli(["--vehicle_config", str(config)])


STOP = b"stop"


class StoppableContext:
    """A context of ZMQ whose socket ends its server by the message STOP, as Ctrl-C does."""

    def __init__(self, context: Any) -> None:
        self._context = context
        self.term = context.term

    def socket(self, kind: int) -> Any:
        made = self._context.socket(kind)
        self.bind, self.send, self.close = made.bind, made.send, made.close
        self._recv = made.recv
        return self

    def recv(self) -> bytes:
        message: bytes = self._recv()
        if message == STOP:
            raise KeyboardInterrupt
        return message


@pytest.fixture
def client(config: Path) -> Iterator[SafetyCheckerClient]:
    """A client of a server that serves in a thread."""
    zmq = pytest.importorskip("zmq")
    port = free_port()

    class Threaded(SafetyCheckerServer):
        def start_server(self, port: int, *, context_factory: Any = None, host: str = "127.0.0.1") -> None:
            def serve() -> None:
                with pytest.raises(KeyboardInterrupt):
                    SafetyCheckerServer.start_server(
                        self, port, context_factory=lambda: StoppableContext(zmq.Context()), host=host
                    )

            self.thread = threading.Thread(target=serve, daemon=True)
            self.thread.start()

    server = Threaded(str(config), port)
    with SafetyCheckerClient("127.0.0.1", port) as made:
        yield made
        made.socket.linger = 1000
        made.socket.send(STOP)
        server.thread.join(60)
    assert not server.thread.is_alive()


def test_client_asks_the_server(client: SafetyCheckerClient) -> None:
    assert client.check_server_status() == (True, "")
    assert client.validate_waypoint_command(START, Coordinate(35.008, -78.998, 20)) == (True, "")
    assert not client.validateWaypointCommand(START, Coordinate(36, -78, 20))[0]
    assert not client.validate_change_speed_command(20)[0]


def test_landing_is_allowed_where_the_takeoff_was(client: SafetyCheckerClient) -> None:
    assert "no takeoff" in client.validate_landing_command(35.002, -78.998)[1]
    assert client.validate_takeoff_command(20, 35.002, -78.998) == (True, "")
    assert client.validate_landing_command(35.00202, -78.998) == (True, "")
    allowed, reason = client.validate_landing_command(35.0021, -78.998)
    assert not allowed and "11.1 m from the takeoff" in reason


@pytest.mark.parametrize(
    ("request_bytes", "says"),
    [
        (b"no zlib", "Server error"),
        (serialize_request("dance", []), "dance"),
        (serialize_request("validate_takeoff_req", []), "Server error"),
        (serialize_request("validate_waypoint_req", ["{}", "{}"]), "Server error"),
        (serialize_msg("[1]"), "Server error"),
        (serialize_msg("[" * 200_000), "Server error"),
        (serialize_msg(" " * (LARGEST + 1)), "larger than"),
    ],
)
def test_malformed_request_is_answered(client: SafetyCheckerClient, request_bytes: bytes, says: str) -> None:
    answer = client.send_request(request_bytes)
    assert answer["result"] is False and says in answer["message"]
    assert client.check_server_status() == (True, "")


def test_number_that_is_too_large_is_answered(client: SafetyCheckerClient) -> None:
    assert client.validate_takeoff_command(20, 35.002, -78.998) == (True, "")
    allowed, reason = client.validate_landing_command(10**400, -78.998)
    assert not allowed and "Server error" in reason
    assert client.check_server_status() == (True, "")


def test_answer_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="decompress"):
        deserialize_msg(b"nonsense")
