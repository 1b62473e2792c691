"""The transition from hovering to flight on the wing: accelerate, then let the lift motors go."""

from __future__ import annotations

from enum import Enum, auto

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..airframe import Airframe


class TransitionStage(Enum):
    """The stages in their order."""

    HOVER = auto()
    ACCELERATING = auto()
    TIMER = auto()
    WING = auto()


class Transition:
    """As in ArduPlane it ends Q_TRANSITION_MS after the airspeed was reached; texts report each step."""

    def __init__(self, vehicle: Airframe) -> None:
        self._vehicle = vehicle
        self.stage = TransitionStage.WING
        self._since = 0.0

    def hover(self) -> None:
        """The lift motors carry the vehicle."""
        self.stage = TransitionStage.HOVER

    def forward(self) -> None:
        """One step of flight on the wing."""
        vehicle = self._vehicle
        speed, parameters = vehicle.airspeed, vehicle.parameters
        enough = max(parameters["AIRSPEED_MIN"], parameters["Q_ASSIST_SPEED"])
        if self.stage is TransitionStage.HOVER:
            self.stage = TransitionStage.ACCELERATING
            vehicle.say(mavlink.MAV_SEVERITY_INFO, f"Transition started airspeed {speed:.1f}")
        elif self.stage is TransitionStage.ACCELERATING and speed >= enough:
            self.stage, self._since = TransitionStage.TIMER, vehicle.now
            vehicle.say(mavlink.MAV_SEVERITY_INFO, f"Transition airspeed reached {speed:.1f}")
        elif (
            self.stage is TransitionStage.TIMER and vehicle.now - self._since >= parameters["Q_TRANSITION_MS"] / 1000
        ):
            self.stage = TransitionStage.WING
            vehicle.say(mavlink.MAV_SEVERITY_INFO, "Transition done")

    @property
    def underway(self) -> bool:
        """Whether the lift motors still help."""
        return self.stage in (TransitionStage.ACCELERATING, TransitionStage.TIMER)
