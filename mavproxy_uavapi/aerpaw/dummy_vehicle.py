"""The stand-in for a vehicle, for scripts that need none (`--vehicle none`)."""

from __future__ import annotations

from typing import Any


class DummyVehicle:
    """A vehicle that does nothing; it can only be closed."""

    def __init__(self, connection_string: str = "", mavsdk_server_port: int = 50051, *_: Any, **__: Any) -> None:
        self.closed = False

    def initialize(self, should_arm: bool = True) -> None:
        """Do nothing."""

    _preflight_wait = initialize

    async def _arm_vehicle(self) -> None:
        """Do nothing."""

    def set_event_log(self, event_log: object) -> None:
        """Do nothing: it has no events."""

    def close(self) -> None:
        """Mark it as closed."""
        self.closed = True
