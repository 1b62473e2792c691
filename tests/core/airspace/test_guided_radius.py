"""Which radius a plane's circles in GUIDED have."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace.guided_radius import GuidedRadius
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.link.messages import GlobalTarget
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

GUIDED, LOITER = 15, 12


@pytest.fixture
def state() -> VehicleState:
    """A plane in GUIDED."""
    return VehicleState(1, 1, mavlink.MAV_TYPE_FIXED_WING, 0.0, armed=True, mode=GUIDED)


@pytest.fixture
def radius() -> GuidedRadius:
    """That of a plane that was told at 10 s to circle with 300 m."""
    radius = GuidedRadius()
    radius.sent(reposition(300.0), 10.0)
    return radius


def reposition(radius: float) -> Any:
    head = (1, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_CMD_DO_REPOSITION, 0, 0)
    return mavlink.MAVLink_command_int_message(*head, -1, 0, radius, 0, -350000000, 1490000000, 20.0)


@pytest.mark.parametrize("unchanged", [0.0, -1.0, float("nan")])
def test_radius_stays_with_targets_that_give_none(
    radius: GuidedRadius, state: VehicleState, unchanged: float
) -> None:
    radius.sent(reposition(unchanged), 11.0)
    radius.sent(messages.set_mode(GUIDED).to(Address(1, 1), 0), 12.0)
    assert radius.in_force(state) == 300.0


def test_target_of_a_verb_brings_back_the_planes_own_radius(radius: GuidedRadius, state: VehicleState) -> None:
    radius.sent(messages.reposition(GlobalTarget(-35.0, 149.0, 20.0)).to(Address(1, 1), 0), 11.0)
    assert radius.in_force(state) == 0.0


def test_radius_ends_with_the_mode(radius: GuidedRadius, state: VehicleState) -> None:
    state.mode_changes.append((9.0, LOITER))
    state.mode_changes.append((10.5, GUIDED))
    assert radius.in_force(state) == 300.0
    state.mode_changes.append((20.0, LOITER))
    state.mode_changes.append((30.0, GUIDED))
    assert radius.in_force(state) == 0.0
    radius.sent(reposition(200.0), 31.0)
    assert radius.in_force(state) == 200.0
