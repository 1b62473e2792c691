"""The radius of a plane's circles in GUIDED. A DO_REPOSITION may give one, which the mode keeps. Pure."""

from __future__ import annotations

from typing import Any

from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.core.telemetry.flight_modes import mode_name
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

SHOWN = 2.0  # s; a heartbeat that is this much newer than a command shows what came after it


class GuidedRadius:
    """The radius that our newest DO_REPOSITION gave. That of another ground station is not known."""

    def __init__(self) -> None:
        self._radius, self._at = 0.0, 0.0

    def sent(self, message: Any, now: float) -> None:
        """Note a message that goes out at `now` (s)."""
        radius = orders.commanded_radius(message)
        if radius is not None:
            self._radius, self._at = radius, now

    def in_force(self, state: VehicleState) -> float:
        """The radius (m); 0 where the plane uses its own, WP_LOITER_RAD."""
        for at, number in state.mode_changes:
            if at > self._at + SHOWN + state.trip.deadline and mode_name(state.vehicle_type, number) != "GUIDED":
                return 0.0
        return self._radius
