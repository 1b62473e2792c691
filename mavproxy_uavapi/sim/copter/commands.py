"""The commands that ArduCopter takes beyond those of all vehicles."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..commands import ACCEPTED, DENIED, FAILED, CommandInt, Commands, Handler
from ..frames import AMSL_FRAMES, HIGHEST_ALTITUDE, global_target, valid_location
from ..position_control import SPEED_KINDS
from .copter import SimulatedCopter
from .modes import Guided
from .modes.auto import AUTO_RTL, Auto

NO_SPEED_KIND = 4
"""The end of the enumeration SPEED_TYPE: ArduCopter answers DENIED to it, and FAILED to larger values."""


def _means_here(command: CommandInt) -> bool:
    """Zeros that stand for the present place or height in a mission; a reposition must not have them."""
    return (command.x == 0 and command.y == 0) or (command.z == 0 and command.frame not in AMSL_FRAMES)


class CopterCommands(Commands[SimulatedCopter]):
    """Carries out commands on one copter."""

    def own_handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: self.mode_command(9),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self.mode_command(6),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self.mode_command(5),
            mavlink.MAV_CMD_DO_LAND_START: self.mode_command(AUTO_RTL),
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_MISSION_START: self._mission_start,
            mavlink.MAV_CMD_CONDITION_YAW: self._condition_yaw,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_DO_PAUSE_CONTINUE: self._pause_continue,
            mavlink.MAV_CMD_DO_SET_ROI: self._set_roi,
            mavlink.MAV_CMD_DO_SET_ROI_LOCATION: self._set_roi,
            mavlink.MAV_CMD_DO_SET_ROI_NONE: self._clear_roi,
        }

    def _take_off(self, command: CommandInt) -> int:
        copter = self._vehicle
        if command.frame not in (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT):
            return DENIED
        if not copter.armed or not copter.landed or not abs(command.z) <= HIGHEST_ALTITUDE:
            return FAILED
        return ACCEPTED if copter.mode.take_off(command.z) else FAILED

    def _reposition(self, command: CommandInt) -> int:
        copter = self._vehicle
        change = bool(int(command.param2) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
        if copter.mode is not copter.guided and not change:
            return DENIED
        if not valid_location(command.x, command.y, command.z) or not self.knows_frame(command.frame):
            return DENIED
        if _means_here(command):
            return DENIED
        target = global_target(copter, command.frame, command.x, command.y, command.z)
        if target is None or not copter.set_mode(Guided.number):
            return FAILED
        copter.guided.go_to(target)
        return ACCEPTED

    def _mission_start(self, command: CommandInt) -> int:
        copter = self._vehicle
        if command.param1 != 0 or command.param2 != 0:
            return DENIED
        if not copter.set_mode(Auto.number):
            return FAILED
        # Otherwise a vehicle on the ground waits until the pilot raises the throttle.
        copter.auto_armed = copter.armed
        assert isinstance(copter.mode, Auto)
        copter.mode.restart()
        return ACCEPTED

    def _condition_yaw(self, command: CommandInt) -> int:
        if not 0 <= command.param1 <= 360 or command.param4 not in (0, 1):
            return FAILED
        self._vehicle.fix_yaw(command.param1, command.param2, int(command.param3), command.param4 == 1)
        return ACCEPTED

    def _change_speed(self, command: CommandInt) -> int:
        kind = SPEED_KINDS.get(int(command.param1))
        if not command.param2 > 0 or int(command.param1) == NO_SPEED_KIND:
            return DENIED
        changed = kind is not None and self._vehicle.mode.set_speed(kind, command.param2)
        return ACCEPTED if changed else FAILED

    def _pause_continue(self, command: CommandInt) -> int:
        copter = self._vehicle
        if int(command.param1) not in (0, 1):
            return DENIED
        pause = int(command.param1) == 0
        if copter.mode.pause() if pause else copter.mode.resume():
            return ACCEPTED
        copter.say(mavlink.MAV_SEVERITY_INFO, "Failed to pause" if pause else "Failed to resume")
        return FAILED

    def _set_roi(self, command: CommandInt) -> int:
        if not (command.x or command.y or command.z):
            return self._clear_roi(command)
        copter = self._vehicle
        if not valid_location(command.x, command.y, command.z):
            return FAILED
        target = global_target(copter, command.frame, command.x, command.y, command.z)
        if target is None:
            return FAILED
        copter.yaw.look_at(target.north, target.east)
        return ACCEPTED

    def _clear_roi(self, command: CommandInt) -> int:
        copter = self._vehicle
        copter.yaw.roi = None
        copter.yaw.by_parameter(int(copter.parameters["WP_YAW_BEHAVIOR"]), returning=False)
        return ACCEPTED
