"""Copters as light as Python can make them, for MAVProxy alone: 50 messages/s each, by UDP, from one process.

They hover, accept every command and show the mode that they were told. The process also receives what MAVProxy
forwards, by the kernel's clock. It obeys a pipe: see `Generator.obey`.
"""

from __future__ import annotations

import heapq
import multiprocessing
import multiprocessing.connection
import selectors
import socket
import struct
import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tap import SO_TIMESTAMPNS, Forwarding

BURST, BURSTS_PER_SECOND = 10, 5  # messages in a datagram
GUIDED = 4
TIMEOUT = 20.0  # s
DATAGRAM = 1 << 16
MODE_COMMANDS = {"SET_MODE", "COMMAND_LONG"}


def telemetry(ms: int) -> list[Any]:
    """One burst of a copter that hovers 10 m above home; each message tells the time, so no two are alike."""
    reported = [
        mavlink.MAVLink_attitude_message(ms, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_local_position_ned_message(ms, 0, 0, -10, 0, 0, 0),
        mavlink.MAVLink_global_position_int_message(ms, -353632610, 1491652300, 594000, 10000, 0, 0, 0, 0),
        mavlink.MAVLink_gps_raw_int_message(ms * 1000, 3, -353632610, 1491652300, 594000, 100, 100, 0, 0, 12),
        mavlink.MAVLink_servo_output_raw_message(ms, 0, *[1500] * 8),
        mavlink.MAVLink_system_time_message(int(time.time() * 1e6), ms),
        mavlink.MAVLink_raw_imu_message(ms * 1000, 0, 0, -1000, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_scaled_pressure_message(ms, 950.0, 0.0, 2500),
        mavlink.MAVLink_rc_channels_message(ms, 8, *[1500] * 18, 255),
        mavlink.MAVLink_attitude_quaternion_message(ms, 1, 0, 0, 0, 0, 0, 0),
    ]
    assert len(reported) == BURST
    return reported


def asked_mode(message: Any) -> int | None:
    """The mode that a message asks for."""
    if message.get_type() == "SET_MODE":
        return int(message.custom_mode)
    if message.get_type() == "COMMAND_LONG" and message.command == mavlink.MAV_CMD_DO_SET_MODE:
        return int(message.param2)
    return None


class Copter:
    """One of them: a UDP socket, and a port of each MAVProxy.

    Args:
        system: its system id.
        ports: where the MAVProxys listen for it.
        on_mode: called when it is commanded a mode, with the time (s of time.time()).
    """

    def __init__(self, system: int, ports: list[int], on_mode: Callable[[int, float], None]) -> None:
        self._system, self._on_mode = system, on_mode
        self._mavproxys = [("127.0.0.1", port) for port in ports]
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.socket.bind(("127.0.0.1", 0))
        self._mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self._mode = GUIDED

    def pack(self, message: Any) -> bytes:
        """The message's bytes, with the next sequence number."""
        frame = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame

    def live(self) -> None:
        """Send a heartbeat, and what a status needs, to every MAVProxy."""
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        kind = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        good = 0xFFFFFFFF >> 1
        estimator = mavlink.EKF_ATTITUDE | mavlink.EKF_POS_HORIZ_ABS | mavlink.EKF_POS_VERT_ABS
        reported = [
            mavlink.MAVLink_heartbeat_message(*kind, flags, self._mode, mavlink.MAV_STATE_ACTIVE, 3),
            mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_IN_AIR),
            mavlink.MAVLink_sys_status_message(good, good, good, 500, 12000, 0, 100, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_ekf_status_report_message(estimator, 0, 0, 0, 0, 0),
            mavlink.MAVLink_vfr_hud_message(0, 0, 0, 0, 594, 0),
        ]
        for mavproxy in self._mavproxys:
            self.socket.sendto(b"".join(map(self.pack, reported)), mavproxy)

    def report(self, active: int, ms: int, sent: Callable[[float, bytes], None]) -> None:
        """Send a burst to that MAVProxy; `sent` is told each frame and its time (s of time.time())."""
        frames = [self.pack(message) for message in telemetry(ms)]
        at = time.time()
        for frame in frames:
            sent(at, frame)
        self.socket.sendto(b"".join(frames), self._mavproxys[active])

    def read(self) -> None:
        """Take what a MAVProxy has sent, and acknowledge it."""
        data, ancillary, _, source = self.socket.recvmsg(DATAGRAM, 64)
        seconds, nanoseconds = struct.unpack("ll", ancillary[0][2][:16])
        for message in self._mav.parse_buffer(data) or []:
            if message.get_type() not in MODE_COMMANDS:
                continue
            if message.get_type() == "COMMAND_LONG":
                asker = message.get_srcSystem(), message.get_srcComponent()
                ack = mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, *asker)
                self.socket.sendto(self.pack(ack), source)
            mode = asked_mode(message)
            if mode is not None:
                self._mode = mode
                self._on_mode(self._system, seconds + nanoseconds / 1e9)
                self.live()


class Generator:
    """All of them.

    Attributes:
        from_vehicle: told each frame that is sent, and its time; `Forwarding.attach` sets it.
    """

    def __init__(self, pipe: Any, ports: list[list[int]]) -> None:
        self._pipe = pipe
        self._selector = selectors.DefaultSelector()
        self._selector.register(pipe, selectors.EVENT_READ, None)
        self.from_vehicle: Callable[[float, bytes], None] = lambda _at, _frame: None
        self._forwarding = Forwarding()
        self._forwarding.attach(self)  # type: ignore[arg-type]  it is watched as a tap is
        self._awaited: set[int] = set()
        self._active = 0
        self._copters = [Copter(number, of_it, self._on_mode) for number, of_it in enumerate(ports, 1)]
        for copter in self._copters:
            self.watch(copter.socket, copter.read)
        pipe.send(self._forwarding.port)

    def watch(self, sock: socket.socket, read: Callable[[], None]) -> None:
        """Read a socket whenever there is something."""
        self._selector.register(sock, selectors.EVENT_READ, read)

    def _on_mode(self, system: int, at: float) -> None:
        if system in self._awaited:
            self._awaited.remove(system)
            self._pipe.send(at)

    def run(self) -> None:
        """Serve until the pipe says None."""
        began = time.monotonic()
        period = 1 / BURSTS_PER_SECOND
        due = [(began + period * n / len(self._copters), 0, n) for n in range(len(self._copters))]
        while True:
            for key, _ in self._selector.select(max(due[0][0] - time.monotonic(), 0)):
                if key.data is not None:
                    key.data()
                elif not self.obey(self._pipe.recv()):
                    return
            while due[0][0] <= time.monotonic():
                at, turn, number = due[0]
                self._copters[number].report(self._active, int(1000 * (at - began)), self.from_vehicle)
                if turn % BURSTS_PER_SECOND == 0:
                    self._copters[number].live()
                heapq.heapreplace(due, (at + period, turn + 1, number))

    def obey(self, order: Any) -> bool:
        """One order from the pipe; False for the end.

        `("active", n)`: telemetry goes to MAVProxy n. `("await", systems)`: answer when each got a mode.
        `("between", start, end)`: answer the delays (s) of what was sent then, and how many were lost.
        """
        if order is None:
            return False
        what, *arguments = order
        if what == "active":
            self._active = arguments[0]
        elif what == "await":
            self._awaited = set(arguments[0])
        else:
            self._pipe.send((self._forwarding.between(*arguments), self._forwarding.lost(*arguments)))
        return True


def run(pipe: Any, ports: list[list[int]]) -> None:
    """The process."""
    Generator(pipe, ports).run()


class Copters:
    """The copters, in a process of their own.

    Args:
        ports: of each copter, its port at each MAVProxy.
    """

    def __init__(self, ports: list[list[int]]) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self.process = context.Process(target=run, args=(theirs, ports), daemon=True)
        self.process.start()
        self.out_port: int = self._answer()

    def _answer(self) -> Any:
        assert self._pipe.poll(TIMEOUT), "the vehicles do not answer"
        return self._pipe.recv()

    def speak_to(self, mavproxy: int) -> None:
        """Send the telemetry to that MAVProxy; heartbeats go to all."""
        self._pipe.send(("active", mavproxy))

    def expect(self, *systems: int) -> None:
        """Count the next change of mode of each of these copters."""
        self._pipe.send(("await", systems))

    def commanded_at(self) -> float:
        """When the next expected change of mode arrived at its socket, s of time.time()."""
        return float(self._answer())

    def forwarded(self, start: float, end: float) -> tuple[list[float], int]:
        """The delays (s) of what was sent in that time (s of time.time()), and the number of lost messages."""
        self._pipe.send(("between", start, end))
        delays, lost = self._answer()
        return delays, lost

    def close(self) -> None:
        """End the process."""
        self._pipe.send(None)
        self.process.join(TIMEOUT)
