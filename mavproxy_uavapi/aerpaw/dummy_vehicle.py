"""No vehicle, for scripts that need none (`--vehicle none`)."""

from __future__ import annotations

from typing import Any


class DummyVehicle:
    """It is closed, and nothing else."""

    def __init__(self, connection_string: str = "", mavsdk_server_port: int = 50051, *_: Any, **__: Any) -> None:
        self.closed = False

    def initialize(self, should_arm: bool = True) -> None:
        """There is nothing to wait for."""

    _preflight_wait = initialize

    async def _arm_vehicle(self) -> None:
        """There is nothing to arm."""

    def set_event_log(self, event_log: object) -> None:
        """There is nothing to tell."""

    def close(self) -> None:
        """Be closed."""
        self.closed = True
