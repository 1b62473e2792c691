"""Land detector: the vehicle has landed when it stands still although the controller pushes it down."""

from __future__ import annotations

from ..geodesy import Ned

LANDED_AFTER = 1.0
"""Seconds, LAND_DETECTOR_TRIGGER_SEC of ArduCopter."""
MAYBE_LANDED_AFTER = 0.2
"""Seconds, LAND_DETECTOR_MAYBE_TRIGGER_SEC."""
PUSHING_DOWN = 2.0
"""Thrust in m/s/s below weight from which the throttle counts as low."""


class LandDetector:
    """Counts the time on the ground with low throttle."""

    def __init__(self) -> None:
        self._still_for = 0.0

    def restart(self) -> None:
        """The vehicle has just lifted off."""
        self._still_for = 0.0

    @property
    def suspects(self) -> bool:
        """Whether it looks like a landing so far."""
        return self._still_for >= MAYBE_LANDED_AFTER

    def update(self, on_ground: bool, thrust: Ned, dt: float) -> bool:
        """Take one step of dt seconds into account; whether the vehicle has landed."""
        still = on_ground and thrust.down > PUSHING_DOWN
        self._still_for = self._still_for + dt if still else 0.0
        return self._still_for >= LANDED_AFTER
