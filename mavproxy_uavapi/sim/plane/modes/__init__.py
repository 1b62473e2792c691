"""The modes of a plane, one file for each family."""

from __future__ import annotations

from ..airframe import Airframe
from .auto import Auto
from .base import Mode
from .circling import AvoidAdsb, Circle, Loiter
from .guided import Guided
from .pilot import STICKS_MODES, Cruise, FlyByWireB, SticksMode
from .rtl import Rtl
from .takeoff import Takeoff

__all__ = ["Auto", "Guided", "Loiter", "Mode", "Rtl", "Takeoff", "build"]


def build(plane: Airframe) -> dict[int, Mode]:
    """The modes of a plane by ArduPlane's mode number."""
    sticks = {number: SticksMode(plane, number, name, limits_bank) for number, name, limits_bank in STICKS_MODES}
    kinds = (FlyByWireB, Cruise, Circle, Auto, Rtl, Loiter, Takeoff, AvoidAdsb, Guided)
    return {**sticks, **{kind.number: kind(plane) for kind in kinds}}
