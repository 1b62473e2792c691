"""The flight modes, one file for each family."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .auto import Auto
from .base import Mode
from .guided import Guided
from .landing import Land
from .manual import AltHold, Brake, Loiter, Stabilize
from .rtl import Rtl

if TYPE_CHECKING:
    from ..copter import Copter

__all__ = ["Auto", "Guided", "Land", "Mode", "Rtl", "build"]


def build(copter: Copter) -> dict[int, Mode]:
    """All modes of one vehicle by ArduCopter's mode number."""
    kinds = (Stabilize, AltHold, Auto, Guided, Loiter, Rtl, Land, Brake)
    return {kind.number: kind(copter) for kind in kinds}
