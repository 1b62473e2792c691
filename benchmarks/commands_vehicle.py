"""The vehicle of `bench_commands.py`: a peer in a process of its own, which acknowledges at once.

It shows what it was told to show, and the kernel notes when each datagram arrived at its socket.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import socket
import struct
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tap import SO_TIMESTAMPNS

from mavproxy_uavapi.core.airspace import time_limits

MODES = {name: number for number, name in mavutil.mode_mapping_acm.items()}
BURST = 10  # messages in each of the vehicle's datagrams
BURSTS_PER_SECOND = 5
TIMEOUT = 10.0  # s
ON_ITS_WAY = 1.0  # s that a message may arrive after the answer to its request
DATAGRAM = 1 << 16
SYSTEM = 1

Key = tuple[Any, ...]  # what a message on the wire asks for


def key_of(message: Any) -> Key | None:
    """What a message asks of the vehicle; None where it only asks for information."""
    name = message.get_type()
    if name == "COMMAND_LONG":
        second = message.param2 if message.command == mavlink.MAV_CMD_DO_SET_MODE else 0.0
        return message.command, message.param1, second
    if name == "SET_POSITION_TARGET_LOCAL_NED":
        if message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE:
            return "velocity", round(message.vx, 3)
        return "place", round(message.x, 3)
    return None


class Peer:
    """A copter as MAVLink shows it: it accepts everything, and shows what it was told at once.

    Args:
        pipe: to who runs it.
        way: s that a message takes to it, and from it. What its socket got is noted without.
    """

    def __init__(self, pipe: Any, way: float) -> None:
        self._pipe, self._way = pipe, way
        self._on_the_way: deque[tuple[float, Callable[..., Any], tuple[Any, ...]]] = deque()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.bind(("127.0.0.1", 0))
        self._mavproxy: Any = None
        self._mav = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=1)
        self._armed, self._landed, self._mode = True, False, MODES["GUIDED"]
        self._began = time.monotonic()
        self._arrived: dict[Key, float] = {}
        self._awaited: Key | None = None
        known = {names[0]: 100 * names[2] for names in time_limits.NAMES.values()}
        self._parameters = list({**known, **time_limits.TIMES}.items())

    def run(self) -> None:
        """Serve until the pipe says None."""
        port = self._socket.getsockname()[1]
        self._pipe.send(port)
        due = time.monotonic()
        turns = 0
        while True:
            self._deliver()
            next_at = min(due, self._on_the_way[0][0]) if self._on_the_way else due
            ready = multiprocessing.connection.wait([self._socket, self._pipe], max(next_at - time.monotonic(), 0))
            if self._socket in ready:
                self._read()
            if self._pipe in ready and not self._obey(self._pipe.recv()):
                return
            if time.monotonic() >= due:
                due += 1 / BURSTS_PER_SECOND
                turns += 1
                self._send(*self._telemetry(), *([self._heartbeat()] if turns % BURSTS_PER_SECOND == 0 else []))

    def _deliver(self) -> None:
        while self._on_the_way and self._on_the_way[0][0] <= time.monotonic():
            _, deliver, what = self._on_the_way.popleft()
            deliver(*what)

    def _later(self, deliver: Callable[..., Any], *what: Any) -> None:
        if self._way:
            self._on_the_way.append((time.monotonic() + self._way, deliver, what))
        else:
            deliver(*what)

    def _obey(self, order: Any) -> bool:
        if order is None:
            return False
        what, *arguments = order
        if what == "mavproxy":
            self._mavproxy = ("127.0.0.1", *arguments)
            self._send(self._heartbeat())
        elif what == "show":
            mode, self._armed, self._landed = arguments
            self._mode = MODES[mode]
            self._show()
            self._pipe.send(None)
        elif what == "clear":
            self._arrived.clear()
            self._awaited = None
            self._pipe.send(None)
        elif what == "await":
            self._awaited = arguments[0]
            self._tell()
        return True

    def _tell(self) -> None:
        if self._awaited in self._arrived:
            self._pipe.send(self._arrived[self._awaited])
            self._awaited = None

    def _read(self) -> None:
        data, ancillary, _, source = self._socket.recvmsg(DATAGRAM, 64)
        seconds, nanoseconds = struct.unpack("ll", ancillary[0][2][:16])
        for message in self._mav.parse_buffer(data) or []:
            key = key_of(message)
            if key is not None:
                self._arrived.setdefault(key, seconds + nanoseconds / 1e9)
            if source == self._mavproxy:
                self._later(self._answer, message)
        self._tell()

    def _answer(self, message: Any) -> None:
        name = message.get_type()
        if name == "PARAM_REQUEST_LIST":
            for index in range(len(self._parameters)):
                self._send(self._parameter(index))
        elif name == "PARAM_REQUEST_READ":
            names = [one for one, _ in self._parameters]
            expected = message.param_id if message.param_index < 0 else names[message.param_index]
            if expected in names:
                self._send(self._parameter(names.index(expected)))
        elif name == "COMMAND_LONG":
            if message.command == mavlink.MAV_CMD_DO_SET_MODE:
                self._mode = int(message.param2)
            elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self._armed = bool(message.param1)
            source = message.get_srcSystem(), message.get_srcComponent()
            self._send(mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, *source))
            self._show()

    def _parameter(self, index: int) -> Any:
        name, value = self._parameters[index]
        return mavlink.MAVLink_param_value_message(name.encode(), value, 9, len(self._parameters), index)

    def _show(self) -> None:
        self._send(self._heartbeat(), self._landed_state())

    def _send(self, *messages: Any) -> None:
        if self._mavproxy is None:
            return
        packed = []
        for message in messages:
            packed.append(message.pack(self._mav))
            self._mav.seq = (self._mav.seq + 1) % 256
        self._later(self._socket.sendto, b"".join(packed), self._mavproxy)

    def _heartbeat(self) -> Any:
        mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self._armed else 0
        status = mavlink.MAV_STATE_STANDBY if self._landed else mavlink.MAV_STATE_ACTIVE
        kind = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        return mavlink.MAVLink_heartbeat_message(*kind, mode, self._mode, status, 3)

    def _landed_state(self) -> Any:
        state = mavlink.MAV_LANDED_STATE_ON_GROUND if self._landed else mavlink.MAV_LANDED_STATE_IN_AIR
        return mavlink.MAVLink_extended_sys_state_message(0, state)

    def _telemetry(self) -> list[Any]:
        """One burst: a vehicle that hovers 10 m above home, and is ready to arm."""
        ms = int((time.monotonic() - self._began) * 1000)
        good = 0xFFFFFFFF >> 1
        estimator = mavlink.EKF_ATTITUDE | mavlink.EKF_POS_HORIZ_ABS | mavlink.EKF_POS_VERT_ABS
        reported = [
            mavlink.MAVLink_attitude_message(ms, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_local_position_ned_message(ms, 0, 0, -10, 0, 0, 0),
            mavlink.MAVLink_global_position_int_message(ms, -353632610, 1491652300, 594000, 10000, 0, 0, 0, 0),
            mavlink.MAVLink_sys_status_message(good, good, good, 500, 12000, 0, 100, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_ekf_status_report_message(estimator, 0, 0, 0, 0, 0),
            mavlink.MAVLink_vfr_hud_message(0, 0, 0, 0, 594, 0),
            mavlink.MAVLink_gps_raw_int_message(ms * 1000, 3, -353632610, 1491652300, 594000, 100, 100, 0, 0, 12),
            mavlink.MAVLink_servo_output_raw_message(ms, 0, *[1500] * 8),
            self._landed_state(),
            mavlink.MAVLink_system_time_message(int(time.time() * 1e6), ms),
        ]
        assert len(reported) == BURST
        return reported


def _run_peer(pipe: Any, way: float) -> None:
    Peer(pipe, way).run()


class Vehicle:
    """The peer, in a process of its own; `way` as there."""

    def __init__(self, way: float = 0.0) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_run_peer, args=(theirs, way), daemon=True)
        self._process.start()
        self.port: int = self._pipe.recv()

    def find(self, mavproxy: int) -> None:
        """Speak to the MAVProxy that listens on that port."""
        self._pipe.send(("mavproxy", mavproxy))

    def show(self, mode: str, armed: bool = True, landed: bool = False) -> None:
        """Have its heartbeats show this, beginning with one now."""
        self._ask("show", mode, armed, landed)

    def forget(self) -> None:
        """Count arrivals from here on."""
        self._ask("clear")

    def arrival(self, key: Key, answer: socket.socket) -> float | None:
        """When the first message of that key has arrived, s of time.time(); None where an answer came without it."""
        self._pipe.send(("await", key))
        assert multiprocessing.connection.wait([self._pipe, answer], TIMEOUT), f"nothing sent for {key}"
        at: float | None = self._pipe.recv() if self._pipe.poll(ON_ITS_WAY) else None
        return at

    def _ask(self, *order: Any) -> None:
        self._pipe.send(order)
        assert self._pipe.poll(TIMEOUT), f"the peer does not answer to {order}"
        self._pipe.recv()

    def close(self) -> None:
        """End the process."""
        self._pipe.send(None)
        self._process.join(TIMEOUT)
