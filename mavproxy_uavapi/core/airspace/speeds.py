"""The speeds that clients request. Pure.

ArduCopter drops a speed when its mode or the kind of setpoint changes. In a pilot's mode it accepts none: a speed
that is requested then is stored until the vehicle flies in GUIDED.
"""

from __future__ import annotations

from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState


class Speeds:
    """Speeds in m/s, by kind (air, ground, climb, descent)."""

    def __init__(self, state: VehicleState) -> None:
        self._state = state
        self._in_force: dict[str, float] = {}
        self._mode_since = -1.0  # when the mode began in which they are in force
        self._remembered: dict[str, float] = {}
        self._reboots = 0

    def take(self, kind: str, speed: float) -> None:
        """Note a speed that the autopilot has accepted."""
        if self._mode_since != self._state.mode_since:
            self._in_force = {}
            self._mode_since = self._state.mode_since
        self._in_force[kind] = speed
        self._remembered.pop(kind, None)

    def remember(self, kind: str, speed: float) -> None:
        """Keep it for the next flight in GUIDED."""
        if self._reboots != self._state.reboots:
            self._remembered, self._reboots = {}, self._state.reboots
        self._remembered[kind] = speed

    def to_send(self, new_kind: bool) -> dict[str, float]:
        """The speeds to send with a setpoint.

        Args:
            new_kind: whether the setpoint is of another kind than the one before.
        """
        remembered = self._remembered if self._reboots == self._state.reboots else {}
        return {**(self.in_force if new_kind else {}), **remembered}

    @property
    def in_force(self) -> dict[str, float]:
        """The speeds that were set since the last mode change."""
        return dict(self._in_force) if self._mode_since == self._state.mode_since else {}
