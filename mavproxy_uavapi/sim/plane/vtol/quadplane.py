"""The QuadPlane without its radio: a plane that also hovers."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ...commands import ACCEPTED, DENIED, FAILED, CommandInt
from ...frames import HIGHEST_ALTITUDE
from ..commands import PlaneCommands
from ..modes import Mode, build
from .auto import QuadAuto
from .frame import LiftFrame
from .guided import QuadGuided
from .modes import QHover, QLand, QLoiter, QRtl, QStabilize
from .transition import TransitionStage

VTOL_STATES = {
    TransitionStage.HOVER: mavlink.MAV_VTOL_STATE_MC,
    TransitionStage.ACCELERATING: mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW,
    TransitionStage.TIMER: mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW,
    TransitionStage.WING: mavlink.MAV_VTOL_STATE_FW,
}


class SimulatedQuadPlane(LiftFrame):
    """Its type is a fixed wing (Q_MAV_TYPE 0); EXTENDED_SYS_STATE reports whether it hovers."""

    frame_text = "QuadPlane Frame: QUAD/X"

    def build_modes(self) -> dict[int, Mode]:
        kinds = (QStabilize, QHover, QLoiter, QLand, QRtl, QuadGuided, QuadAuto)
        return build(self) | {kind.number: kind(self) for kind in kinds}

    @property
    def vtol_state(self) -> int:
        guided = self.mode is self.guided and isinstance(self.guided, QuadGuided) and self.guided.climbing
        if guided:
            return int(mavlink.MAV_VTOL_STATE_TRANSITION_TO_MC)
        if self.mode.vtol and not self.mode.navigates:
            return int(mavlink.MAV_VTOL_STATE_MC)
        return int(VTOL_STATES[self.transition.stage])


class QuadPlaneCommands(PlaneCommands):
    """Carries out commands on one QuadPlane; some of them a plane refuses."""

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
