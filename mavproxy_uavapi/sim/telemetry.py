"""All messages that the vehicle can send about itself, by their MAVLink name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .motion_messages import MotionMessages
from .system_messages import SystemMessages
from .vehicle import EmbeddedVehicle


class TelemetryMessages(MotionMessages, SystemMessages):
    """Builds messages by name; None where ArduPilot would not send one either."""

    def __init__(self, vehicle: EmbeddedVehicle, unix_epoch: float) -> None:
        super().__init__(vehicle, unix_epoch)
        self._builders: dict[str, Callable[[], Any]] = {
            name.removeprefix("_build_").upper(): getattr(self, name)
            for name in dir(self)
            if name.startswith("_build_")
        }
        if not vehicle.reports_wind:
            del self._builders["WIND"]

    def knows(self, name: str) -> bool:
        """Whether the vehicle can send this message at all."""
        return name in self._builders

    def build(self, name: str) -> Any | None:
        """The message for the present state; KeyError for one that the vehicle does not know."""
        return self._builders[name]()
