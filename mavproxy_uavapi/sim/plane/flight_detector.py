"""Does the plane fly? ArduPlane's guess: a share that grows while it moves and fades while it does not."""

from __future__ import annotations

INTERVAL = 0.2
SHARE = 0.15
"""Weight of the newest look."""
ARMED_LIMIT, DISARMED_LIMIT = 0.1, 0.9
"""The share from which it flies: little evidence is enough when armed."""


class FlightDetector:
    """Looks five times a second."""

    def __init__(self) -> None:
        self._share = 0.0
        self._due = 0.0
        self.flying = False
        self.last_flying = 0.0
        """Seconds since boot."""

    def update(self, now: float, moving: bool, armed: bool) -> None:
        """Take a look if it is time; now is seconds since boot."""
        if now < self._due:
            return
        self._due = now + INTERVAL
        self._share += SHARE * (float(moving) - self._share)
        self.flying = self._share >= (ARMED_LIMIT if armed else DISARMED_LIMIT)
        if self.flying:
            self.last_flying = now
