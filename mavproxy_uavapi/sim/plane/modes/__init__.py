"""The modes of a plane, one file for each family."""

from __future__ import annotations

from ..airframe import Airframe
from .auto import Auto
from .base import Mode
from .circling import AvoidAdsb, Circle, Loiter
from .guided import Guided
from .pilot import Acro, Autotune, Cruise, FlyByWireA, FlyByWireB, Manual, Stabilize, Training
from .rtl import Rtl
from .takeoff import Takeoff

__all__ = ["Auto", "Guided", "Loiter", "Mode", "Rtl", "Takeoff", "build"]

PILOT = (Manual, Stabilize, Training, Acro, FlyByWireA, FlyByWireB, Cruise, Autotune)
AUTOPILOT = (Circle, Auto, Rtl, Loiter, Takeoff, AvoidAdsb, Guided)


def build(plane: Airframe) -> dict[int, Mode]:
    """The modes of a plane by ArduPlane's mode number."""
    return {kind.number: kind(plane) for kind in (*PILOT, *AUTOPILOT)}
