"""The safety checker: `python -m mavproxy_uavapi.aerpaw.safety_server --vehicle_config FILE [--port 14580]`."""

from __future__ import annotations

import argparse
import contextlib
import json
import logging
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mavproxy_uavapi.aerpaw.constants import (
    DEFAULT_SAFETY_SERVER_PORT,
    SERVER_STATUS_REQ,
    VALIDATE_CHANGE_SPEED_REQ,
    VALIDATE_LANDING_REQ,
    VALIDATE_TAKEOFF_REQ,
    VALIDATE_WAYPOINT_REQ,
)
from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.safety_rules import ALLOWED, SafetyRules, Verdict
from mavproxy_uavapi.aerpaw.safety_wire import deserialize_msg, serialize_response
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.file_text import read_text

log = logging.getLogger("aerpawlib.v1.safety")

LARGEST = 1024 * 1024  # bytes of a file of rules
LANDING_RADIUS = 5.0  # m from the place of the takeoff


class SafetyCheckerServer:
    """Answers the requests of safety checker clients. Its constructor serves until the process is stopped.

    Args:
        vehicle_config_filename: YAML file with `vehicle_type` (copter or rover), `max_speed`, `min_speed` (m/s),
            `include_geofences`, `exclude_geofences` (lists of KML files beside it), and for a copter `max_alt`,
            `min_alt` (m above home).
        server_port: the TCP port.
        host: the address to listen at; * for all.

    Attributes:
        rules: the limits.
        takeoff_location: where the last takeoff was allowed; None before.

    Raises:
        ValueError, OSError: the file is invalid.
    """

    def __init__(
        self,
        vehicle_config_filename: str,
        server_port: int = DEFAULT_SAFETY_SERVER_PORT,
        *,
        host: str = "127.0.0.1",
    ) -> None:
        self.rules = read_rules(Path(vehicle_config_filename))
        self.takeoff_location: Coordinate | None = None
        self.REQUEST_FUNCTIONS: dict[str, Callable[..., Verdict]] = {
            SERVER_STATUS_REQ: self.check_server_status,
            VALIDATE_WAYPOINT_REQ: self._validate_waypoint,
            VALIDATE_CHANGE_SPEED_REQ: self.validate_change_speed_command,
            VALIDATE_TAKEOFF_REQ: self.validate_takeoff_command,
            VALIDATE_LANDING_REQ: self.validate_landing_command,
        }
        self.start_server(server_port, host=host)

    def start_server(
        self, port: int, *, context_factory: Callable[[], Any] | None = None, host: str = "127.0.0.1"
    ) -> None:
        """Serve at a port until an exception, such as KeyboardInterrupt, ends it.

        `context_factory` makes the ZMQ context, by default `zmq.Context`.
        """
        import zmq  # noqa: PLC0415 - an extra

        context = (context_factory or zmq.Context)()
        socket = context.socket(zmq.REP)
        try:
            socket.bind(f"tcp://{host}:{port}")
            log.info("the safety checker listens at %s:%d", host, port)
            while True:
                socket.send(self._answer(socket.recv()))
        finally:
            socket.close()
            context.term()

    def _answer(self, request: bytes) -> bytes:
        name = "unknown"
        try:
            message = deserialize_msg(request)
            name = str(message.get("request_function"))
            function = self.REQUEST_FUNCTIONS.get(name)
            if function is None:
                return serialize_response(name, result=False, message=f"there is no request {name}")
            result, reason = function(*(message.get("params") or []))
        except (ValueError, TypeError, KeyError, ArithmeticError, RecursionError) as error:  # it is malformed
            return serialize_response(name, result=False, message=f"Server error: {error}")
        return serialize_response(name, result=result, message=reason)

    def check_server_status(self) -> Verdict:
        """That it works."""
        return ALLOWED

    def validate_waypoint_command(self, current_location: Coordinate, next_location: Coordinate) -> Verdict:
        """Whether the flight between two positions is allowed."""
        return self.rules.check_waypoint(current_location, next_location)

    def _validate_waypoint(self, current: str, following: str) -> Verdict:
        return self.validate_waypoint_command(_coordinate(current), _coordinate(following))

    def validate_change_speed_command(self, new_speed: float) -> Verdict:
        """Whether a speed (m/s) is allowed."""
        return self.rules.check_speed(new_speed)

    def validate_takeoff_command(self, takeoff_alt: float, current_lat: float, current_lon: float) -> Verdict:
        """Whether a takeoff to that altitude (m) is allowed; the place is remembered for the landing."""
        allowed, reason = self.rules.check_altitude(takeoff_alt)
        if allowed:
            self.takeoff_location = Coordinate(current_lat, current_lon)
        return allowed, reason

    def validate_landing_command(self, current_lat: float, current_lon: float) -> Verdict:
        """Whether a landing there is allowed: near the place of the takeoff."""
        if self.takeoff_location is None:
            return False, "Invalid landing: no takeoff was checked before"
        distance = self.takeoff_location.ground_distance(Coordinate(current_lat, current_lon))
        if distance > LANDING_RADIUS:
            return (
                False,
                f"Invalid landing: it is {distance:.1f} m from the takeoff; {LANDING_RADIUS:g} m are allowed",
            )
        return ALLOWED


def read_rules(file: Path) -> SafetyRules:
    """The rules of a YAML file.

    Raises:
        ValueError, OSError: the file is invalid.
    """
    import yaml  # noqa: PLC0415 - an extra

    try:
        config = yaml.safe_load(read_text(file, LARGEST))
        if not isinstance(config, dict):
            raise ValueError(f"{file} has no settings")
        return SafetyRules.from_mapping(config, file.parent)
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        raise ValueError(f"{file} is not YAML{'' if mark is None else f': line {mark.line + 1}'}") from error
    except UavApiError as error:
        raise ValueError(str(error)) from error


def _coordinate(text: str) -> Coordinate:
    place = json.loads(text)
    return Coordinate(place["lat"], place["lon"], place["alt"])


def main_cli(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m mavproxy_uavapi.aerpaw.safety_server", description=__doc__)
    parser.add_argument("--port", type=int, default=DEFAULT_SAFETY_SERVER_PORT, help="its TCP port (%(default)s)")
    parser.add_argument("--vehicle_config", required=True, help="the YAML file with the limits")
    parser.add_argument("--host", default="127.0.0.1", help="the address to listen at; * for all (%(default)s)")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        with contextlib.suppress(KeyboardInterrupt):
            SafetyCheckerServer(options.vehicle_config, options.port, host=options.host)
    except ImportError:
        sys.exit("the safety checker needs pyzmq and PyYAML: pip install 'mavproxy-uavapi[aerpaw]'")
    except (ValueError, OSError) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main_cli()
