from __future__ import annotations

import pytest

from mavproxy_uavapi.core.errors import Superseded
from mavproxy_uavapi.core.link.messages import VelocityTarget
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.own_target import OwnTarget
from tests.support.clock import Clock
from tests.support.messages import mavlink, message_of

FORWARD = VelocityTarget(2.0, 0.0, 0.0)
STEP = 0.001  # degrees north: 111 m


@pytest.mark.parametrize(("elsewhere", "is_anothers"), [(0.0, False), (STEP, True)])
def test_place_that_is_reported_beside_velocities_is_anothers_unless_a_boat_stays_there(
    elsewhere: float, *, is_anothers: bool
) -> None:
    clock = Clock()
    state = VehicleState(1, 1, mavlink.MAV_TYPE_SURFACE_BOAT, clock())
    own, job = OwnTarget(state, clock), object()

    def at(north: float) -> None:
        state.update(message_of("global_position_int", lat=round(north * 1e7), lon=1), clock())

    at(0.0)
    for _ in range(4):
        clock.now += 1.0
        own.require_steered_by(job)
        own.sent(FORWARD, job)
    at(STEP)
    place = {"coordinate_frame": mavlink.MAV_FRAME_GLOBAL, "lat_int": round((STEP + elsewhere) * 1e7), "lon_int": 1}
    state.update(message_of("position_target_global_int", **place), clock())
    if is_anothers:
        with pytest.raises(Superseded):
            own.require_steered_by(job)
        return
    own.require_steered_by(job)
    at(4 * STEP)  # it goes on, and reports no place
    own.require_steered_by(job)
