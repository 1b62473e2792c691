"""`aerpawlib.v1.safety`: the client of AERPAW's safety checker, which decides whether a command is allowed."""

from __future__ import annotations

from types import TracebackType
from typing import Any

from mavproxy_uavapi.aerpaw.constants import (
    SAFETY_CHECKER_REQUEST_TIMEOUT_S,
    SERVER_STATUS_REQ,
    VALIDATE_CHANGE_SPEED_REQ,
    VALIDATE_LANDING_REQ,
    VALIDATE_TAKEOFF_REQ,
    VALIDATE_WAYPOINT_REQ,
)
from mavproxy_uavapi.aerpaw.geometry import Coordinate
from mavproxy_uavapi.aerpaw.safety_rules import Verdict
from mavproxy_uavapi.aerpaw.safety_wire import deserialize_msg, serialize_request


class SafetyCheckerClient:
    """A safety checker at an address. Each request blocks, at most for `timeout_s`."""

    def __init__(self, addr: str, port: int, timeout_s: float = SAFETY_CHECKER_REQUEST_TIMEOUT_S) -> None:
        import zmq  # noqa: PLC0415 - an extra

        self._zmq = zmq
        self._timeout = timeout_s
        self._url = f"tcp://{addr}:{port}"
        self.context = zmq.Context()
        self._connect()

    def _connect(self) -> None:
        self.socket = self.context.socket(self._zmq.REQ)
        self.socket.linger = 0
        self.socket.rcvtimeo = self.socket.sndtimeo = int(self._timeout * 1000)
        self.socket.connect(self._url)

    def close(self) -> None:
        """Close the connection."""
        self.socket.close()
        self.context.term()

    def __enter__(self) -> SafetyCheckerClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def send_request(self, msg: bytes) -> dict[str, Any]:
        """Send a request and return the response.

        Raises:
            TimeoutError: there is no response.
            ValueError: it is malformed.
        """
        try:
            self.socket.send(msg)
            answer = self.socket.recv()
        except self._zmq.Again as error:
            self.socket.close()
            self._connect()  # the old socket would wait for the missing answer
            raise TimeoutError(
                f"the safety checker at {self._url} did not answer within {self._timeout:g} s"
            ) from error
        return deserialize_msg(answer)

    def parse_response(self, response: dict[str, Any]) -> Verdict:
        """Whether it is allowed, and if not, the reason."""
        return response["result"], response["message"]

    def _ask(self, function: str, *params: Any) -> Verdict:
        return self.parse_response(self.send_request(serialize_request(function, list(params))))

    def check_server_status(self) -> Verdict:
        """Whether the server works."""
        return self._ask(SERVER_STATUS_REQ)

    def validate_waypoint_command(self, current_location: Coordinate, next_location: Coordinate) -> Verdict:
        """Whether the flight between two positions is allowed."""
        return self._ask(VALIDATE_WAYPOINT_REQ, current_location.to_json(), next_location.to_json())

    def validate_change_speed_command(self, new_speed: float) -> Verdict:
        """Whether a speed (m/s) is allowed."""
        return self._ask(VALIDATE_CHANGE_SPEED_REQ, new_speed)

    def validate_takeoff_command(self, takeoff_alt: float, current_lat: float, current_lon: float) -> Verdict:
        """Whether a takeoff to that altitude (m) is allowed."""
        return self._ask(VALIDATE_TAKEOFF_REQ, takeoff_alt, current_lat, current_lon)

    def validate_landing_command(self, current_lat: float, current_lon: float) -> Verdict:
        """Whether a landing there is allowed."""
        return self._ask(VALIDATE_LANDING_REQ, current_lat, current_lon)

    sendRequest, parseResponse, checkServerStatus = send_request, parse_response, check_server_status
    validateWaypointCommand, validateChangeSpeedCommand = validate_waypoint_command, validate_change_speed_command
    validateTakeoffCommand, validateLandingCommand = validate_takeoff_command, validate_landing_command
