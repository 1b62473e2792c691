from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.telemetry.vehicle_states import VehicleStates
from tests.support.messages import message_of


@pytest.fixture
def fleet() -> VehicleStates:
    return VehicleStates()


@pytest.fixture
def hear(fleet: VehicleStates) -> Callable[..., VehicleState | None]:
    """Feed one message; `at` is its time of arrival."""

    def hear(name: str, at: float = 1.0, **fields: Any) -> VehicleState | None:
        return fleet.update(message_of(name, **fields), at)

    return hear


@pytest.fixture
def state(hear: Callable[..., Any]) -> VehicleState:
    """Vehicle 1, of which one heartbeat was heard: disarmed, in mode 0."""
    return hear("heartbeat")
