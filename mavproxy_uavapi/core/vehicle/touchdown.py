"""Whether a disarming was a landing. Pure: the clock is an argument."""

from __future__ import annotations

from mavproxy_uavapi.core.airspace.time_limits import FlightLimits

ROLLING = 5.0  # m/s over the ground; a vehicle that is faster when it is disarmed flies: a plane would glide on
STANDING = 1.0  # m/s; a vehicle that sinks faster after disarming has not landed
FREE_FALL = 0.5  # s after the disarming, in which a vehicle that falls gets much faster than that
POSITION_TIMEOUT = 2.0  # s in which a position must come after the disarming, if positions come at all


class Touchdown:
    """Tells a landing from a fall: after a landing the disarmed vehicle stands still."""

    def __init__(self, limits: FlightLimits) -> None:
        self._fall = 2 * max(limits.down, limits.land, limits.land_high) + STANDING  # m/s; no descent is as fast
        self._sinking = self._level = 0.0
        self._disarmed_at: float | None = None
        self.fell = False

    def moves_at(self, down: float, level: float) -> None:
        """Take the newest speeds downwards and over the ground (m/s)."""
        self._sinking, self._level = down, level
        self.fell = self.fell or down > self._fall

    def disarmed(self, now: float) -> None:
        """Take that the vehicle is disarmed now (s)."""
        if self._disarmed_at is None:
            self._disarmed_at = now
            self.fell = self.fell or self._level > ROLLING

    def is_over(self, now: float, age: float | None) -> bool | None:
        """Whether a disarmed vehicle stands still, from a position that arrived a while after the disarming.

        Args:
            now: s.
            age: of the newest position, s; if none arrives any more, the disarming alone counts.
        """
        assert self._disarmed_at is not None
        updated_since = age is not None and now - age > self._disarmed_at + FREE_FALL
        if updated_since:
            return True if abs(self._sinking) <= STANDING else None
        return True if now - self._disarmed_at >= POSITION_TIMEOUT else None
