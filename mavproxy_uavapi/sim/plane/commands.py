"""The commands that ArduPlane takes beyond those of all vehicles. It knows no yaw, pause or landing command."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..commands import ACCEPTED, DENIED, FAILED, CommandInt, Commands, Handler
from ..frames import AMSL_FRAMES, HIGHEST_ALTITUDE, global_target, valid_location
from .modes import Auto, Guided, Loiter, Rtl
from .plane import SimulatedPlane

NO_TERMINATION = "AFS not enabled, can't terminate the vehicle"


class PlaneCommands(Commands[SimulatedPlane]):
    """Carries out commands on one plane."""

    def own_handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self._enter(Loiter.number),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self._enter(Rtl.number),
            mavlink.MAV_CMD_MISSION_START: self._mission_start,
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_DO_CHANGE_ALTITUDE: self._change_altitude,
            mavlink.MAV_CMD_DO_LAND_START: self._land_start,
            mavlink.MAV_CMD_DO_GO_AROUND: self._go_around,
            mavlink.MAV_CMD_DO_VTOL_TRANSITION: self._vtol_transition,
            mavlink.MAV_CMD_DO_FLIGHTTERMINATION: self._no_termination,
            mavlink.MAV_CMD_DO_SET_ROI: self.accept,
            mavlink.MAV_CMD_DO_SET_ROI_LOCATION: self.accept,
            mavlink.MAV_CMD_DO_SET_ROI_NONE: self.accept,
        }

    def _enter(self, number: int) -> Handler:
        """A mode change that ArduPlane accepts whether or not it succeeds."""

        def handler(_command: CommandInt) -> int:
            self._vehicle.set_mode(number)
            return ACCEPTED

        return handler

    def _take_off(self, command: CommandInt) -> int:
        """For a QuadPlane in GUIDED: z is the climb in metres, upward in a COMMAND_LONG."""
        return FAILED

    def _mission_start(self, command: CommandInt) -> int:
        if command.param1 != 0 or command.param2 != 0:
            return DENIED
        self._vehicle.set_mode(Auto.number)
        return ACCEPTED

    def _reposition(self, command: CommandInt) -> int:
        """The speed (param1) is not looked at; param3 is the radius, param4 other than 0 counter-clockwise."""
        plane = self._vehicle
        if not valid_location(command.x, command.y, command.z) or not self.knows_frame(command.frame):
            return DENIED
        if (command.x == 0 and command.y == 0) or (command.z == 0 and command.frame not in AMSL_FRAMES):
            return DENIED
        target = global_target(plane, command.frame, command.x, command.y, command.z)
        if target is None:
            return FAILED
        change = bool(int(command.param2) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
        if not change and plane.mode is not plane.guided:
            return FAILED
        plane.set_mode(Guided.number)
        plane.guided.go_to(target, counter_clockwise=command.param4 != 0, radius=max(command.param3, 0.0))
        return ACCEPTED

    def _change_speed(self, command: CommandInt) -> int:
        plane = self._vehicle
        if not plane.mode.takes_speeds:
            return FAILED
        done = plane.change_speed(int(command.param1), command.param2, command.param3)
        return ACCEPTED if done else FAILED

    def _change_altitude(self, command: CommandInt) -> int:
        """param1 is the altitude in metres, param2 its frame; the target of whatever mode gets it."""
        plane, frame = self._vehicle, int(command.param2)
        origin = plane.estimator.origin
        if not self.knows_frame(frame) or not abs(command.param1) <= HIGHEST_ALTITUDE:
            return DENIED
        amsl = command.param1 if frame in AMSL_FRAMES else command.param1 + plane.home_altitude
        if origin is not None and math.isfinite(amsl):
            plane.navigator.change_altitude(origin.altitude - amsl)
        return ACCEPTED

    def _land_start(self, command: CommandInt) -> int:
        plane = self._vehicle
        if not plane.estimator.ready or not plane.select_landing():
            return FAILED
        if plane.mode.number == Auto.number:
            plane.mission_mode.jump_to(plane.mission.current)
            return ACCEPTED
        return ACCEPTED if plane.set_mode(Auto.number) else FAILED

    def _go_around(self, command: CommandInt) -> int:
        """A landing is broken off by going on with its DO_LAND_START."""
        plane = self._vehicle
        if not plane.mode.landing or not plane.select_landing():
            return FAILED
        plane.mission_mode.jump_to(plane.mission.current)
        return ACCEPTED

    def _vtol_transition(self, command: CommandInt) -> int:
        self._vehicle.say(mavlink.MAV_SEVERITY_NOTICE, "VTOL not available")
        return FAILED

    def _no_termination(self, command: CommandInt) -> int:
        self._vehicle.say(mavlink.MAV_SEVERITY_INFO, NO_TERMINATION)
        return FAILED
