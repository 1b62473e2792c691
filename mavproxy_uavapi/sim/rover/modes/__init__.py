"""The modes of the rover, one file for each family."""

from __future__ import annotations

from ..chassis import Chassis
from .auto import Auto
from .base import Mode
from .guided import Guided
from .manual import REFUSED, Acro, Hold, Manual, Refused, Steering
from .returning import Rtl, SmartRtl
from .staying import Loiter

__all__ = ["Auto", "Guided", "Hold", "Loiter", "Mode", "Rtl", "SmartRtl", "build"]


def build(rover: Chassis) -> dict[int, Mode]:
    """All modes of one vehicle by Rover's mode number."""
    kinds = (Manual, Acro, Steering, Hold, Loiter, Auto, Rtl, SmartRtl, Guided)
    refused = {number: Refused(rover, number, name, why) for number, name, why in REFUSED}
    return {**{kind.number: kind(rover) for kind in kinds}, **refused}
