"""The speeds that a mission is reckoned with."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from mavproxy_uavapi.core.airspace import cruise
from mavproxy_uavapi.core.airspace.speeds import Speeds
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState


def vehicle(kind: str, mode: str, **parameters: float) -> SimpleNamespace:
    """One that a client has given 15 m/s in its mode."""
    state = VehicleState(1, 1, 0, 0.0)
    state.parameters.update(parameters)
    speeds = Speeds(state)
    speeds.take("ground", 15.0)
    return SimpleNamespace(kind=kind, mode=mode, state=state, speeds=speeds)


def test_a_plane_is_reckoned_faster_over_the_ground_than_its_airspeed() -> None:
    """SITL's plane flies 25.0 m/s over the ground at an airspeed of 22 m/s, 680 m above the sea."""
    fastest, slowest = cruise.mission_paces(vehicle("plane", "AUTO", AIRSPEED_CRUISE=22.0))
    assert fastest.level == pytest.approx(25.5, abs=0.1) and slowest.level == 15.0


@pytest.mark.parametrize(("kind", "own"), [("plane", 12.0), ("copter", 10.0)])
def test_a_mission_that_begins_drops_the_speed_of_the_mode_before(kind: str, own: float) -> None:
    fastest, slowest = cruise.mission_paces(vehicle(kind, "GUIDED"))
    assert slowest.level == own and fastest.level < 15.0
    assert cruise.mission_paces(vehicle("rover", "GUIDED", WP_SPEED=2.0))[0].level == 15.0
