"""The QuadPlane without its radio: a plane that also hovers."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

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
