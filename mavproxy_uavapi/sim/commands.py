"""Commands: one handler for each MAV_CMD that every ArduPilot vehicle takes; each gives a MAV_RESULT.

COMMAND_LONG and COMMAND_INT meet here in one shape, as in ArduPilot; commands not in the table are
MAV_RESULT_UNSUPPORTED. A type of vehicle adds its own to the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import DEG_E7, from_deg_e7

from .frames import AMSL_FRAMES, GLOBAL_FRAMES, HIGHEST_ALTITUDE, valid_location
from .geodesy import Location
from .link import PeerLink
from .streams import HEARTBEAT_INTERVAL, group_of
from .telemetry import TelemetryMessages
from .transmitter import Transmitter
from .vehicle import EmbeddedVehicle

ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
DENIED: int = mavlink.MAV_RESULT_DENIED
FAILED: int = mavlink.MAV_RESULT_FAILED
BUSY: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED
FORCE_ARM = 2989.0
FORCE_ARM_OR_DISARM = 21196.0
"""Values of param2 of MAV_CMD_COMPONENT_ARM_DISARM that skip checks."""
FORCE_REBOOT = 20190226
FASTEST_INTERVAL = 0.003
"""Seconds; ArduPilot refuses more than 0.8 of SCHED_LOOP_RATE. More than 100 Hz is not sent here."""
LONGEST_INTERVAL = 60.0
LOCATION_COMMANDS = {
    # The frame that COMMAND_LONG means, for commands whose x and y are a location; None: COMMAND_INT only.
    mavlink.MAV_CMD_DO_SET_HOME: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_CMD_DO_SET_ROI: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_CMD_DO_SET_ROI_LOCATION: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_CMD_DO_REPOSITION: None,
}


@dataclass(frozen=True)
class CommandInt:
    """A command as COMMAND_INT has it: x, y in 1e-7 degrees for a location, z in metres of its frame.

    link is where answers beyond the ack go.
    """

    command: int
    frame: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float
    link: PeerLink
    long: bool = False
    """Whether it came as COMMAND_LONG."""


def from_message(message: Any, link: PeerLink) -> CommandInt | None:
    """COMMAND_LONG or COMMAND_INT as a Command; None for a COMMAND_LONG that ArduPilot takes as INT only.

    A parameter that is not a finite number means "not given" and reads as 0. z stays as it is, because an altitude
    must not become 0 by mistake.
    """
    p1, p2, p3, p4 = map(_finite, (message.param1, message.param2, message.param3, message.param4))
    if message.get_type() == "COMMAND_INT":
        return CommandInt(message.command, message.frame, p1, p2, p3, p4, message.x, message.y, message.z, link)
    frame = LOCATION_COMMANDS.get(message.command, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT)
    if frame is None:
        return None
    scale = DEG_E7 if message.command in LOCATION_COMMANDS else 1.0
    x, y = int(_finite(message.param5) * scale), int(_finite(message.param6) * scale)
    return CommandInt(message.command, frame, p1, p2, p3, p4, x, y, message.param7, link, long=True)


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 0.0


Handler = Callable[[CommandInt], int]
V = TypeVar("V", bound=EmbeddedVehicle)


class Commands(Generic[V]):
    """Carries out commands on one vehicle; reboot makes it boot again once the acknowledgement is out."""

    def __init__(
        self,
        vehicle: V,
        telemetry: TelemetryMessages,
        transmitter: Transmitter,
        reboot: Callable[[], None],
    ) -> None:
        self._vehicle = vehicle
        self._telemetry = telemetry
        self._transmitter = transmitter
        self._reboot_soon = reboot
        self._handlers: dict[int, Handler] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: self._run_prearm_checks,
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: self._set_mission_current,
            mavlink.MAV_CMD_DO_SET_HOME: self._set_home,
            mavlink.MAV_CMD_GET_HOME_POSITION: self._get_home,
            mavlink.MAV_CMD_DO_SET_SERVO: self._set_servo,
            mavlink.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            mavlink.MAV_CMD_BATTERY_RESET: self._reset_battery,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._capabilities,
            mavlink.MAV_CMD_DO_SEND_BANNER: self._banner,
            mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot,
            **self.own_handlers(),
        }

    def own_handlers(self) -> dict[int, Handler]:
        """The commands that a type of vehicle has of its own, or instead of those of all."""
        return {}

    def run(self, command: CommandInt) -> int:
        """Carry the command out; its MAV_RESULT."""
        return self._handlers.get(command.command, self.refuse)(command)

    def accept(self, command: CommandInt) -> int:
        """Accept a command for a gimbal that is not there, as ArduPilot does."""
        return ACCEPTED

    def refuse(self, command: CommandInt) -> int:
        """The answer to a command that the type does not have."""
        return UNSUPPORTED

    def _arm_disarm(self, command: CommandInt) -> int:
        vehicle = self._vehicle
        if command.param1 == 1:
            forced = command.param2 in (FORCE_ARM, FORCE_ARM_OR_DISARM)
            return ACCEPTED if vehicle.arm(forced=forced) else FAILED
        if command.param1 == 0:
            return ACCEPTED if vehicle.disarm(forced=command.param2 == FORCE_ARM_OR_DISARM) else FAILED
        return UNSUPPORTED

    def _run_prearm_checks(self, command: CommandInt) -> int:
        vehicle = self._vehicle
        if vehicle.armed:
            return BUSY
        vehicle.report_prearm()
        return ACCEPTED

    def set_mode(self, base_mode: int, custom_mode: int) -> int:
        """Change the mode as MAV_CMD_DO_SET_MODE and SET_MODE ask; a MAV_RESULT."""
        if not base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        return ACCEPTED if self._vehicle.set_mode(custom_mode) else FAILED

    def _set_mode(self, command: CommandInt) -> int:
        return self.set_mode(int(command.param1), int(command.param2))

    def knows_frame(self, frame: int) -> bool:
        """Whether a location may be given in that frame; a STATUSTEXT says when not."""
        if frame in GLOBAL_FRAMES:
            return True
        self._vehicle.say(mavlink.MAV_SEVERITY_INFO, f"Unknown mavlink coordinate frame {frame}")
        return False

    def mode_command(self, number: int) -> Handler:
        """A command that changes the mode and nothing else."""
        return lambda _command: ACCEPTED if self._vehicle.set_mode(number) else FAILED

    def _set_mission_current(self, command: CommandInt) -> int:
        if not self._vehicle.current_item(int(command.param1), begins=command.param2 == 1):
            return DENIED
        self._transmitter.broadcast("MISSION_CURRENT")
        return ACCEPTED

    def _set_home(self, command: CommandInt) -> int:
        vehicle = self._vehicle
        if command.param1 == 1 or (command.x == 0 and command.y == 0):
            return ACCEPTED if vehicle.set_home_here(lock=True) else FAILED
        if command.param1 != 0:
            return FAILED
        if not abs(command.z) <= HIGHEST_ALTITUDE or not self.knows_frame(command.frame):
            return DENIED
        if not valid_location(command.x, command.y, command.z):
            return FAILED
        altitude = command.z if command.frame in AMSL_FRAMES else command.z + vehicle.home_altitude
        home = Location(from_deg_e7(command.x), from_deg_e7(command.y), altitude)
        return ACCEPTED if vehicle.set_home(home, lock=True) else FAILED

    def _get_home(self, command: CommandInt) -> int:
        if self._vehicle.home is None:
            return FAILED
        self._transmitter.send(command.link, "HOME_POSITION")
        self._transmitter.send(command.link, "GPS_GLOBAL_ORIGIN")
        return ACCEPTED

    def _set_servo(self, command: CommandInt) -> int:
        done = self._vehicle.set_servo(int(command.param1), int(command.param2))
        return ACCEPTED if done else FAILED

    def _terminate(self, command: CommandInt) -> int:
        if command.param1 <= 0.5:
            return FAILED
        self._vehicle.disarm_now()
        return ACCEPTED

    def _reset_battery(self, command: CommandInt) -> int:
        """param1 has a bit for each battery, of which there is one; param2 is percent."""
        if int(command.param1) & 1:
            self._vehicle.battery.reset(command.param2)
        return ACCEPTED

    def _request_message(self, command: CommandInt) -> int:
        message_id = int(command.param1)
        if message_id == mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            return self._send_interval(int(command.param2), command.link)
        name = self._name_of(message_id)
        if name is None:
            return FAILED
        # As in ArduPilot the message waits its turn, so the acknowledgement comes first.
        self._transmitter.send_soon(command.link, name)
        return ACCEPTED

    def _set_interval(self, command: CommandInt) -> int:
        vehicle = self._vehicle
        name = self._name_of(int(command.param1))
        if name is None:
            text = f"No ap_message for mavlink id ({int(command.param1)})"
            vehicle.say(mavlink.MAV_SEVERITY_INFO, text)
            return DENIED
        if command.param3 != 0 or command.param2 < -1:
            return DENIED
        if 0 < command.param2 < FASTEST_INTERVAL * 1e6:
            text = f"Requested rate for message ID {int(command.param1)} too fast. Increase SCHED_LOOP_RATE"
            vehicle.say(mavlink.MAV_SEVERITY_INFO, text)
            return DENIED
        interval: float | None = min(LONGEST_INTERVAL, command.param2 / 1e6)
        if command.param2 == -1:
            interval = None
        elif command.param2 == 0:
            interval = self._default_interval(name)
        command.link.streams.set(name, interval, vehicle.now)
        return ACCEPTED

    def _default_interval(self, name: str) -> float | None:
        if name == "HEARTBEAT":
            return HEARTBEAT_INTERVAL
        group = group_of(name, self._vehicle.streams)
        rate = self._vehicle.parameters[self._vehicle.rate_parameter(group)] if group is not None else 0.0
        return 1 / rate if rate > 0 else None

    def _get_interval(self, command: CommandInt) -> int:
        return self._send_interval(int(command.param1), command.link)

    def _send_interval(self, message_id: int, link: PeerLink) -> int:
        name = self._name_of(message_id)
        if name is None:
            link.send(mavlink.MAVLink_message_interval_message(message_id & 0xFFFF, 0))
            return FAILED
        interval = link.streams.interval(name)
        microseconds = -1 if interval is None else round(interval * 1e6)
        link.send(mavlink.MAVLink_message_interval_message(message_id, microseconds))
        return ACCEPTED

    def _name_of(self, message_id: int) -> str | None:
        kind = mavlink.mavlink_map.get(message_id)
        name = None if kind is None else str(kind.msgname)
        return name if name is not None and self._telemetry.knows(name) else None

    def _capabilities(self, command: CommandInt) -> int:
        if command.param1 != 1:
            return FAILED
        self._transmitter.send(command.link, "AUTOPILOT_VERSION")
        return ACCEPTED

    def _banner(self, command: CommandInt) -> int:
        self._vehicle.say_banner()
        return ACCEPTED

    def _reboot(self, command: CommandInt) -> int:
        if self._vehicle.armed and command.y != FORCE_REBOOT:
            return FAILED
        if command.param1 not in (1, 3):
            return UNSUPPORTED
        self._reboot_soon()
        return ACCEPTED
