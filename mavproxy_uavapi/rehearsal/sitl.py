"""ArduPilot's SITL in place of an embedded vehicle: a process with a clock of its own."""

from __future__ import annotations

import ctypes
import math
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.core.telemetry.flight_modes import mode_name, mode_number
from mavproxy_uavapi.launcher.command_lines import sitl_binary
from mavproxy_uavapi.launcher.errors import LaunchError, OptionError
from mavproxy_uavapi.rehearsal.program_link import STREAM_RATE
from mavproxy_uavapi.sim.options import SITL_BASE_PORT, Options

DEFAULTS = {
    "copter": "default_params/copter.parm",
    "plane": "models/plane.parm",
    "quadplane": "default_params/quadplane.parm",
    "rover": "default_params/rover.parm",
}  # of each type, as sim_vehicle.py takes them; in Tools/autotest
OBSERVER = (254, 190)  # neither the companion nor a station whose heartbeats the vehicle misses
OBSERVERS_PORT, PROGRAMS_PORT = 2, 3  # behind the companion's: SERIAL1, SERIAL2
STREAMS_OF_PROGRAMS = "MAV3"  # begins the names of their rates, on SERIAL2
STREAMED = ("RAW_SENS", "EXT_STAT", "RC_CHAN", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3")
OBSERVED = ("HEARTBEAT", "SYSTEM_TIME", "SIM_STATE", "EXTENDED_SYS_STATE", "SYS_STATUS", "MISSION_CURRENT")
EVERY = 0.1  # s of its clock
BOOTS_WITHIN = 60.0  # s of this machine
ANSWERS_WITHIN = 5.0  # s of this machine, before missing parameters are asked for again
MAGIC_2, MAGIC_1 = 0xFD, 0xFE  # begins a frame of MAVLink 2, and of 1
FORCED = 21196  # COMPONENT_ARM_DISARM also in the air
DIES_WITH_PARENT = 1  # PR_SET_PDEATHSIG of prctl(2)

# fault -> the simulation's parameter, its value meanwhile, and afterwards
BY_PARAMETER: Mapping[str, tuple[str, float, float]] = {
    "ekf_bad": ("SIM_GPS1_ENABLE", 0.0, 1.0),
    "radio_loss": ("SIM_RC_FAIL", 1.0, 0.0),
}


class _Parameter(NamedTuple):
    name: str
    value: float


class Cable:
    """One TCP link, as whole frames of MAVLink 2.

    Args:
        port: of the loopback.
        is_running: whether whoever listens there still may.

    Raises:
        LaunchError: nobody listens there.
    """

    def __init__(self, port: int, is_running: Callable[[], bool]) -> None:
        self._near = _connected(port, is_running)
        self._near.setblocking(False)
        self._held = b""

    def drain(self) -> bytes:
        """What has come; its first messages, of MAVLink 1, are left out."""
        with suppress(BlockingIOError):
            while data := self._near.recv(65536):
                self._held += data
        whole, at = [], 0
        while at + 2 <= len(self._held):
            magic, length = self._held[at], self._held[at + 1]
            if magic not in (MAGIC_1, MAGIC_2):
                at += 1
                continue
            end = at + length + (12 if magic == MAGIC_2 else 8)
            if end > len(self._held):
                break
            if magic == MAGIC_2:
                whole.append(self._held[at:end])
            at = end
        self._held = self._held[at:]
        return b"".join(whole)

    def send(self, data: bytes) -> None:
        """Send a frame; one for which there is no room is lost, as on a radio."""
        with suppress(BlockingIOError):
            self._near.send(data)

    def close(self) -> None:
        """End it."""
        self._near.close()


class SitlVehicle:
    """One vehicle of ArduPilot's SITL: a `Simulator` to `rehearsal.companion`, a `Control` to `rehearsal.truth`.

    Args:
        options: what it is; it has no seed.
        ardupilot: a copy of ArduPilot with built SITL.
        folder: where it works.
        instance: which ports it has.

    Attributes:
        options: see above.
        parameters: those at its boot.
        address: of its MAVLink for programs.

    Raises:
        OptionError: SITL is not built there.
        LaunchError: it does not come up.
    """

    def __init__(self, options: Options, ardupilot: Path, folder: Path, instance: int) -> None:
        self.options = options
        self._newest: dict[str, Any] = {}
        self._parser, self._encoder = mavlink.MAVLink(None), mavlink.MAVLink(None, *OBSERVER)
        self._due: list[tuple[float, Callable[[], None]]] = []
        self._silent_until = -math.inf
        self._values: dict[str, float] = {}
        self._count = 0
        self._cables: list[Cable] = []
        self._process = _started(options, ardupilot, folder, instance)
        try:
            port = SITL_BASE_PORT + 10 * instance
            self.address = f"tcp:127.0.0.1:{port + PROGRAMS_PORT}"
            for offset in (0, OBSERVERS_PORT):  # it boots once somebody is at the first
                self._cables.append(Cable(port + offset, self._is_running))
            self._companion, self._observer = self._cables
            self.parameters = SimpleNamespace(ordered=self._fetched())
            for name in OBSERVED:
                number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
                self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, EVERY * 1e6)
            self._until(lambda: all(name in self._newest for name in OBSERVED), "has not told where it is")
        except BaseException:
            self.end()
            raise

    def end(self) -> None:
        """End its process."""
        self._process.kill()
        self._process.wait()
        for cable in self._cables:
            cable.close()

    def _is_running(self) -> bool:
        return self._process.poll() is None

    @property
    def now(self) -> float:
        """s of its clock."""
        return float(self._newest["SYSTEM_TIME"].time_boot_ms) / 1000

    # -- as a Simulator -----------------------------------------------------------------------------------------

    def open_link(self, _name: str = "") -> SitlVehicle:
        """The companion's link, whose `drain` gives what has come."""
        return self

    def drain(self) -> bytes:
        """What has come for the companion."""
        frames = self._companion.drain()
        return frames if self.now >= self._silent_until else b""

    def receive(self, _cable: Any, message: Any) -> None:
        """Take a message of the companion's."""
        if self.now >= self._silent_until:
            self._companion.send(bytes(message.get_msgbuf()))

    def step(self) -> None:
        """Hear what it tells; its time passes by itself.

        Raises:
            LaunchError: it has ended.
        """
        self._hear()
        for due in [one for one in self._due if one[0] <= self.now]:
            self._due.remove(due)
            due[1]()

    def _hear(self) -> None:
        if not self._is_running():
            raise LaunchError(f"vehicle {self.options.sysid}: ArduPilot's SITL has ended")
        for message in self._parser.parse_buffer(self._observer.drain()) or ():
            if message.get_srcSystem() != self.options.sysid:  # it forwards the companion's
                continue
            self._newest[message.get_type()] = message
            if message.get_type() == "PARAM_VALUE":
                self._values[message.param_id] = message.param_value
                self._count = message.param_count

    # -- as a Control -------------------------------------------------------------------------------------------

    def handle(self, line: Mapping[str, Any]) -> dict[str, Any]:
        """Do what a line of the control protocol (`sim.control`) says, as far as SITL can."""
        try:
            if line["op"] == "state":
                return {"ok": True, **self._state()}
            if line["op"] == "parameter":
                self._set(line["name"], line["value"])
            else:
                self._begin(line["name"], line)
        except Invalid as error:
            return {"ok": False, "error": str(error)}
        return {"ok": True}

    def _state(self) -> dict[str, Any]:
        heartbeat, place = self._newest["HEARTBEAT"], self._newest["SIM_STATE"]
        return {
            "mode": mode_name(heartbeat.type, heartbeat.custom_mode),
            "armed": bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
            "landed": self._newest["EXTENDED_SYS_STATE"].landed_state <= mavlink.MAV_LANDED_STATE_ON_GROUND,
            "velocity": (place.vn, place.ve, place.vd),
            "latitude": place.lat_int / 1e7,
            "longitude": place.lon_int / 1e7,
            "altitude_above_home": place.alt - self.options.home.altitude,
            "time_boot_ms": self._newest["SYSTEM_TIME"].time_boot_ms,
            "battery": {"remaining": self._newest["SYS_STATUS"].battery_remaining},
            "mission": {"current": self._newest["MISSION_CURRENT"].seq},
        }

    def _begin(self, fault: str, line: Mapping[str, Any]) -> None:
        """Raises Invalid: SITL has no such fault."""
        seconds = float(line.get("seconds", math.inf))
        if fault in BY_PARAMETER:
            name, meanwhile, afterwards = BY_PARAMETER[fault]
            self._set(name, meanwhile)
            self._due.append((self.now + seconds, lambda: self._set(name, afterwards)))
        elif fault == "silence":
            self._silent_until = self.now + seconds
        elif fault == "low_battery":
            self._set("SIM_BATT_VOLTAGE", line["voltage"])
        elif fault == "pilot_mode":
            number = mode_number(self._newest["HEARTBEAT"].type, line["mode"])
            self._command(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, number)
        elif fault == "pilot_disarm":
            self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, FORCED)
        else:
            raise Invalid(f"ArduPilot's SITL has no fault {fault} here")

    # -- the observer's link ------------------------------------------------------------------------------------

    def _tell(self, message: Any) -> None:
        self._observer.send(bytes(message.pack(self._encoder)))

    def _command(self, command: int, first: float, second: float) -> None:
        self._tell(
            mavlink.MAVLink_command_long_message(self.options.sysid, 1, command, 0, first, second, 0, 0, 0, 0, 0)
        )

    def _set(self, name: str, value: float) -> None:
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        self._tell(mavlink.MAVLink_param_set_message(self.options.sysid, 1, name.encode(), value, kind))

    def _fetched(self) -> list[_Parameter]:
        """The whole list, asked for again as long as some are missing."""
        ask_at = 0.0

        def is_complete() -> bool:
            nonlocal ask_at
            if time.monotonic() > ask_at:
                ask_at = time.monotonic() + ANSWERS_WITHIN
                self._tell(mavlink.MAVLink_param_request_list_message(self.options.sysid, 1))
            return 0 < self._count <= len(self._values)

        self._until(is_complete, "has not told its parameters")
        return [_Parameter(name, value) for name, value in self._values.items()]

    def _until(self, condition: Callable[[], bool], why: str) -> None:
        deadline = time.monotonic() + BOOTS_WITHIN
        while not condition():
            if time.monotonic() > deadline:
                raise LaunchError(f"vehicle {self.options.sysid}: ArduPilot's SITL {why}")
            time.sleep(0.01)
            self._companion.drain()
            self._hear()


def _started(options: Options, ardupilot: Path, folder: Path, instance: int) -> subprocess.Popen[bytes]:
    binary = sitl_binary(str(ardupilot), options.vehicle)
    if not binary.is_file():
        raise OptionError(f"--ardupilot-path: {binary} is missing, build it first")
    place = folder / f"sitl-{options.sysid}"
    place.mkdir()
    own = place / "own.parm"
    own.write_text("".join(f"{name} {value:.9g}\n" for name, value in _parameters(options)), encoding="ascii")
    home = options.home
    with (place / "log").open("wb") as log:
        return subprocess.Popen(
            [
                str(binary),
                f"--model={options.vehicle}",
                f"-I{instance}",
                f"--speedup={options.speedup:g}",
                f"--home={home.latitude},{home.longitude},{home.altitude},{home.heading}",
                f"--defaults={ardupilot / 'Tools' / 'autotest' / DEFAULTS[options.vehicle]},{own}",
            ],
            cwd=place,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
            preexec_fn=_die_with_parent,  # noqa: PLW1509  nothing else of it runs there
        )


def _die_with_parent() -> None:
    ctypes.CDLL(None).prctl(DIES_WITH_PARENT, signal.SIGKILL)


def _parameters(options: Options) -> list[tuple[str, float]]:
    """What the options are in SITL's parameters."""
    wanted = [*options.defaults, ("MAV_SYSID", options.sysid)]
    wanted += [(f"{STREAMS_OF_PROGRAMS}_{kind}", STREAM_RATE) for kind in STREAMED]
    wanted += [("SIM_WIND_SPD", options.wind.speed), ("SIM_WIND_DIR", options.wind.direction)]
    if options.gps_noise:
        wanted.append(("SIM_GPS1_NOISE", options.gps_noise))
    if options.battery:
        wanted += [("BATT_CAPACITY", options.battery), ("SIM_BATT_CAP_AH", options.battery / 1000)]
    return wanted


def _connected(port: int, is_running: Callable[[], bool]) -> socket.socket:
    deadline = time.monotonic() + BOOTS_WITHIN
    while True:
        try:
            return socket.create_connection(("127.0.0.1", port), 1.0)
        except OSError as error:
            if not is_running() or time.monotonic() > deadline:
                raise LaunchError(f"ArduPilot's SITL does not listen on port {port}: {error.strerror}") from error
            time.sleep(0.05)
