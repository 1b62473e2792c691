"""Message in -> the vehicle that it came from. Pure: the clock is an argument."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from mavproxy_uavapi.core.telemetry import autopilot
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState


class VehicleStates:
    """Every vehicle that was ever heard on the links, by system id.

    The state of a system is its autopilot's, by `autopilot.rank`; it changes to a better candidate when one is heard.
    It never changes back, not even when the better one falls silent: the mode and arming of a second autopilot must
    not pass for the vehicle's own. The link counts as lost then.
    """

    def __init__(self) -> None:
        self.vehicles: dict[int, VehicleState] = {}
        self._parameters: dict[tuple[int, int], dict[str, float]] = {}  # by system and component
        self._ranks: dict[int, int] = {}

    def update(self, message: Any, now: float, came_after: float | None = None) -> VehicleState | None:
        """Take a message, as `VehicleState.update`; the vehicle it came from, None if it came from none."""
        system = message.get_srcSystem()
        if message.get_type() == "HEARTBEAT":
            self._take_candidate(message, now)
        state = self.vehicles.get(system)
        if state is not None:
            state.update(message, now, came_after)
        return state

    def learn(self, parameters: Mapping[tuple[int, int], Mapping[str, float]]) -> None:
        """Take parameters by system and component, of vehicles that were heard or are yet to be."""
        for key, values in parameters.items():
            finite = {name: value for name, value in values.items() if math.isfinite(value)}
            self._parameters.setdefault(key, {}).update(finite)

    def _take_candidate(self, heartbeat: Any, now: float) -> None:
        system, rank = heartbeat.get_srcSystem(), autopilot.rank(heartbeat)
        if rank <= self._ranks.get(system, autopilot.NONE):
            return
        self._ranks[system] = rank
        component = heartbeat.get_srcComponent()
        state = self.vehicles.get(system)
        if state is None:
            self.vehicles[system] = VehicleState(system, component, heartbeat.type, now)
        elif component != state.component:
            state.become(component, heartbeat.type, now)
        self.vehicles[system].parameters = self._parameters.setdefault((system, component), {})
