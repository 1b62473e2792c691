"""The commands that Rover takes beyond those of all vehicles. It knows no takeoff, landing, yaw or pause."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..commands import ACCEPTED, DENIED, FAILED, CommandInt, Commands, Handler
from ..frames import global_target, valid_location
from .modes import Auto, Guided, Rtl
from .rover import SimulatedRover

DENIED_SPEED_TYPES = (mavlink.SPEED_TYPE_CLIMB_SPEED, mavlink.SPEED_TYPE_DESCENT_SPEED, mavlink.SPEED_TYPE_ENUM_END)


class RoverCommands(Commands[SimulatedRover]):
    """Carries out commands on one rover."""

    def own_handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self.mode_command(Rtl.number),
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_MISSION_START: self._mission_start,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_DO_SET_REVERSE: self._set_reverse,
            mavlink.MAV_CMD_DO_FLIGHTTERMINATION: self.refuse,
            mavlink.MAV_CMD_DO_SET_ROI: self.accept,
            mavlink.MAV_CMD_DO_SET_ROI_LOCATION: self.accept,
            mavlink.MAV_CMD_DO_SET_ROI_NONE: self.accept,
        }

    def _reposition(self, command: CommandInt) -> int:
        """As in Rover a speed (param1) is refused before there is a target, when GUIDED is entered already."""
        rover = self._vehicle
        change = bool(int(command.param2) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
        if rover.mode is not rover.guided and not change:
            return DENIED
        if not valid_location(command.x, command.y, command.z) or (command.x == 0 and command.y == 0):
            return DENIED
        return self._drive_to(command) if self.knows_frame(command.frame) else DENIED

    def _drive_to(self, command: CommandInt) -> int:
        rover = self._vehicle
        if not rover.set_mode(Guided.number):
            return FAILED
        if command.param1 > 0 and not rover.guided.set_speed(command.param1):
            return FAILED
        target = global_target(rover, command.frame, command.x, command.y, command.z)
        if target is None:
            return FAILED
        rover.guided.go_to(target)
        return ACCEPTED

    def _mission_start(self, command: CommandInt) -> int:
        if command.param1 != 0 or command.param2 != 0:
            return DENIED
        return ACCEPTED if self._vehicle.set_mode(Auto.number) else FAILED

    def _change_speed(self, command: CommandInt) -> int:
        if int(command.param1) in DENIED_SPEED_TYPES:
            return DENIED
        return ACCEPTED if self._vehicle.mode.set_speed(command.param2) else FAILED

    def _set_reverse(self, command: CommandInt) -> int:
        self._vehicle.navigator.reversed = command.param1 == 1
        return ACCEPTED
