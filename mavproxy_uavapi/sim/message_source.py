"""What all message builders share: the vehicle, its clocks and the place it reports."""

from __future__ import annotations

from .copter import SimulatedCopter
from .geodesy import Location, Ned


class MessageSource:
    """Base of the message builders. A builder `_build_name` makes the message NAME, or None.

    unix_epoch is the unix time in seconds at which the vehicle booted.
    """

    def __init__(self, copter: SimulatedCopter, unix_epoch: float) -> None:
        self.copter = copter
        self.unix_epoch = unix_epoch
        self._frozen: tuple[float, Ned, Ned, Location] | None = None

    def freeze_position(self, frozen: bool) -> None:
        """Keep reporting the present position and fix time, as a frozen GPS does."""
        if not frozen:
            self._frozen = None
        elif self._frozen is None:
            copter = self.copter
            estimator = copter.estimator
            self._frozen = (copter.now, estimator.position, estimator.velocity, estimator.location)

    def _milliseconds(self) -> int:
        return int(self.copter.now * 1000 + 0.5) & 0xFFFFFFFF

    def _microseconds(self) -> int:
        return int(self.copter.now * 1e6 + 0.5)

    def _position(self) -> tuple[float, Ned, Ned, Location]:
        """Time, position, velocity and location as they are to be reported."""
        if self._frozen is not None:
            return self._frozen
        estimator = self.copter.estimator
        return self.copter.now, estimator.position, estimator.velocity, estimator.location
