"""The commands that a QuadPlane takes where a plane refuses them."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...commands import ACCEPTED, DENIED, FAILED, CommandInt
from ...frames import HIGHEST_ALTITUDE
from ..commands import PlaneCommands
from .guided import QuadGuided


class QuadPlaneCommands(PlaneCommands):
    """Carries out commands on one QuadPlane."""

    def _take_off(self, command: CommandInt) -> int:
        """The climb in metres: upward in a COMMAND_LONG, downward in MAV_FRAME_LOCAL_OFFSET_NED."""
        plane, guided = self._vehicle, self._vehicle.guided
        offset = command.frame == mavlink.MAV_FRAME_LOCAL_OFFSET_NED
        if not command.long and not offset:
            return DENIED
        climb = command.z if command.long else -command.z
        if not abs(climb) <= HIGHEST_ALTITUDE:
            return FAILED
        if plane.mode is not guided:
            plane.say(mavlink.MAV_SEVERITY_INFO, "User Takeoff only in GUIDED mode")
            return FAILED
        assert isinstance(guided, QuadGuided)
        return ACCEPTED if guided.take_off(climb) else FAILED

    def _vtol_transition(self, command: CommandInt) -> int:
        self._vehicle.say(mavlink.MAV_SEVERITY_NOTICE, "VTOL transition only in AUTO")
        return FAILED
