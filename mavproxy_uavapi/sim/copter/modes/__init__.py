"""The flight modes, one file for each family."""

from __future__ import annotations

from ..aircraft import Aircraft
from .auto import Auto
from .base import Mode
from .guided import Guided
from .landing import Land
from .manual import AltHold, Brake, Loiter, Stabilize
from .rtl import Rtl, SmartRtl

__all__ = ["Auto", "Brake", "Guided", "Land", "Mode", "Rtl", "SmartRtl", "build"]


def build(aircraft: Aircraft) -> dict[int, Mode]:
    """All modes of one vehicle by ArduCopter's mode number."""
    kinds = (Stabilize, AltHold, Auto, Guided, Loiter, Rtl, SmartRtl, Land, Brake)
    return {kind.number: kind(aircraft) for kind in kinds}
