"""What all message builders share: the vehicle, its clocks and the place it reports."""

from __future__ import annotations

from .geodesy import Location, Ned
from .vehicle import EmbeddedVehicle


class MessageSource:
    """Base of the message builders. A builder `_build_name` makes the message NAME, or None.

    unix_epoch is the unix time in seconds at which the vehicle booted.
    """

    def __init__(self, vehicle: EmbeddedVehicle, unix_epoch: float) -> None:
        self.vehicle = vehicle
        self.unix_epoch = unix_epoch
        self._frozen: tuple[float, Ned, Ned, Location] | None = None

    def freeze_position(self, frozen: bool) -> None:
        """Keep reporting the present position and fix time, as a frozen GPS does."""
        if not frozen:
            self._frozen = None
        elif self._frozen is None:
            vehicle = self.vehicle
            estimator = vehicle.estimator
            self._frozen = (vehicle.now, estimator.position, estimator.velocity, estimator.location)

    def _milliseconds(self) -> int:
        return int(self.vehicle.now * 1000 + 0.5) & 0xFFFFFFFF

    def _microseconds(self) -> int:
        return int(self.vehicle.now * 1e6 + 0.5)

    def _position(self) -> tuple[float, Ned, Ned, Location]:
        """Time of the fix, position, velocity and location as they are to be reported; a message has its own time."""
        if self._frozen is not None:
            return self._frozen
        estimator = self.vehicle.estimator
        return self.vehicle.now, estimator.position, estimator.velocity, estimator.location
