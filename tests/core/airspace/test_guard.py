"""The guard of vehicles that are no copters; tests/rules/test_envelope.py flies a copter against it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot
from mavproxy_uavapi.core.airspace.model import Area, Envelope, EnvelopeLimits
from mavproxy_uavapi.core.airspace.ordered import Ordered
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.errors import OutsideEnvelope, Stale
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.link.messages import NO_YAW, GlobalTarget, NedTarget, VelocityTarget
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import PathPoint
from mavproxy_uavapi.core.oversight.envelope_watch import leaving
from mavproxy_uavapi.core.telemetry.flight_modes import mode_number
from mavproxy_uavapi.core.telemetry.vehicle_state import Received, VehicleState
from mavproxy_uavapi.core.vehicle.registry import CLASSES
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

HOME = (-35.0, 149.0)
FRAME = LocalFrame(HOME)
TYPES = {
    "copter": mavlink.MAV_TYPE_QUADROTOR,
    "plane": mavlink.MAV_TYPE_FIXED_WING,
    "rover": mavlink.MAV_TYPE_GROUND_ROVER,
}


def square(half: float, **limits: float) -> Space:
    ring = tuple(FRAME.degrees(Spot(n * half, e * half, 0)) for n, e in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    area = Area("field", inclusion=True, rings=(ring,), floor=5.0, ceiling=60.0)
    return Space(Envelope((area,), EnvelopeLimits(**limits)))


def test_a_stop_goes_out_though_nobody_knows_where_the_vehicle_is(make: Callable[..., Any], loop: FastLoop) -> None:
    vehicle = make("copter", square(100.0))
    loop.pass_time(60.0)
    stop = VelocityTarget(0.0, 0.0, 0.0).to(Address(1, 1), NO_YAW)
    vehicle.guard.require(stop)
    vehicle.guard.sending(stop)
    assert not vehicle.guard.remaining() and vehicle.guard.ordered.at == loop.time()
    with pytest.raises(Stale):
        vehicle.guard.require(VelocityTarget(1.0, 0.0, 0.0).to(Address(1, 1), NO_YAW))


@pytest.fixture
def make(host: Host, loop: FastLoop) -> Callable[..., Any]:
    """Makes a vehicle at a place (m north, east, up) with a velocity (m/s)."""

    def made(kind: str, space: Space, at=(0.0, 0.0, 20.0), velocity=(0.0, 0.0, 0.0), **parameters: float) -> Any:
        state = VehicleState(1, 1, TYPES[kind], loop.time(), armed=True, mode=mode_number(TYPES[kind], "GUIDED"))
        state.parameters.update(parameters)
        lat, lon = FRAME.degrees(Spot(*at))
        vx, vy, vz = (round(100 * speed) for speed in velocity)
        telemetry = {
            "GLOBAL_POSITION_INT": {
                "lat": round(lat * 1e7), "lon": round(lon * 1e7), "alt": 600_000, "relative_alt": round(1000 * at[2]),
                "vx": vx, "vy": vy, "vz": vz,
            },
            "LOCAL_POSITION_NED": {"x": at[0], "y": at[1], "z": -at[2]},
            "HOME_POSITION": {"latitude": round(HOME[0] * 1e7), "longitude": round(HOME[1] * 1e7)},
        }  # fmt: skip
        for name, fields in telemetry.items():
            state.messages[name] = Received(message_of(name.lower(), 1, 1, 0, **fields), loop.time())
        return CLASSES[kind](state, host.link, host.pending, loop.time, lambda: (space,))

    return made


def allowed(vehicle: Any, order: Any) -> bool:
    try:
        vehicle.inside(order)()
    except OutsideEnvelope:
        return False
    return True


def test_plane_keeps_the_radius_of_its_circles_from_every_border(make: Callable[..., Any]) -> None:
    plane = make("plane", square(300), WP_LOITER_RAD=80.0)
    for north, fits in ((200, True), (215, True), (225, False), (400, False)):
        place = GlobalTarget(*FRAME.degrees(Spot(north, 0, 0)), 40.0)
        assert allowed(plane, messages.reposition(place)) is fits


def test_raw_targets_stay_inside_and_bring_no_radius_or_speed(make: Callable[..., Any]) -> None:
    vehicle = make("plane", square(500.0), WP_LOITER_RAD=80.0)

    def sent(message: Any) -> bool:
        try:
            vehicle.guard.require(message)
        except OutsideEnvelope:
            return False
        return True

    def at(north: float) -> tuple[int, int, float]:
        lat, lon = FRAME.degrees(Spot(north, 0.0, 20.0))
        return round(lat * 1e7), round(lon * 1e7), 30.0

    def reposition(north: float, speed: float = -1.0, radius: float = 0.0) -> Any:
        return mavlink.MAVLink_command_int_message(1, 1, 3, 192, 0, 0, speed, 0, radius, 0, *at(north))

    def item(north: float) -> Any:
        return mavlink.MAVLink_mission_item_int_message(1, 1, 0, 3, 16, 2, 1, 0, 0, 0, 0, *at(north))

    assert sent(reposition(300.0)) and sent(item(300.0))
    assert not sent(reposition(450.0)) and not sent(item(450.0))
    assert not sent(reposition(300.0, radius=400.0)) and not sent(reposition(300.0, speed=30.0))


def test_plane_keeps_the_radius_that_it_was_told_from_every_border(make: Callable[..., Any]) -> None:
    plane = make("plane", square(300), WP_LOITER_RAD=80.0)
    order = messages.reposition(GlobalTarget(*FRAME.degrees(Spot(200, 0, 0)), 40.0))
    wide, keeping = order.to(Address(1, 1), 0), order.to(Address(1, 1), 0)
    wide.param3, keeping.param3 = 150.0, 0.0
    plane.guard.require(keeping)
    plane.guard.sending(wide)
    with pytest.raises(OutsideEnvelope):
        plane.guard.require(keeping)
    assert allowed(plane, order), "it brings back the plane's own radius"
    plane.guard.sending(order.to(Address(1, 1), 0))
    plane.guard.require(keeping)


def test_plane_that_flies_at_a_border_is_leaving_a_radius_before_it(make: Callable[..., Any]) -> None:
    for north, leaves in ((150, False), (230, True)):
        plane = make("plane", square(300), at=(north, 0, 40), velocity=(20, 0, 0), WP_LOITER_RAD=80.0)
        assert (leaving(plane) is not None) is leaves


def test_rover_has_no_floor_and_stops_by_its_own_deceleration(make: Callable[..., Any]) -> None:
    rover = make("rover", square(50), at=(0, 0, -3.0), ATC_DECEL_MAX=2.0)
    assert allowed(rover, NedTarget(45, 0, 0)) and not allowed(rover, NedTarget(55, 0, 0))
    assert allowed(rover, VelocityTarget(5, 0, 0)) and not allowed(rover, VelocityTarget(12, 0, 0))
    assert allowed(rover, NedTarget(0, 0, 3.0))
    for north, leaves in ((30, False), (42, True)):
        driving = make("rover", square(50), at=(north, 0, 0), velocity=(5, 0, 0), ATC_DECEL_MAX=2.0)
        assert (leaving(driving) is not None) is leaves


def test_speed_in_force_counts_for_places(make: Callable[..., Any]) -> None:
    copter = make("copter", square(300, speed=5), WPNAV_SPEED=1000.0)
    assert not allowed(copter, NedTarget(10, 0, -20))
    copter.speeds.remember("ground", 4.0)
    assert allowed(copter, NedTarget(10, 0, -20))
    assert not allowed(copter, messages.change_speed("ground", 6.0))
    assert allowed(copter, messages.change_speed("climb", 6.0))


def test_longer_timeout_of_the_autopilot_makes_a_velocity_lead_farther(make: Callable[..., Any]) -> None:
    assert allowed(make("copter", square(100)), VelocityTarget(10, 0, 0))
    assert not allowed(make("copter", square(100), GUID_TIMEOUT=10.0), VelocityTarget(10, 0, 0))


def test_nothing_that_moves_is_sent_without_a_position_and_a_stop_is(
    make: Callable[..., Any], loop: FastLoop
) -> None:
    copter = make("copter", square(100))
    loop.pass_time(5.0)
    for order in (NedTarget(10, 0, -20), VelocityTarget(1, 0, 0), messages.takeoff(10.0)):
        with pytest.raises(Stale):
            copter.inside(order)()
    for order in (VelocityTarget(0, 0, 0), messages.set_mode(17), messages.set_mode(9), messages.disarm(True)):
        copter.inside(order)()


def test_home_that_is_not_known_is_stale_where_the_distance_counts(make: Callable[..., Any]) -> None:
    copter = make("copter", square(100, distance=50))
    assert not allowed(copter, NedTarget(60, 0, -20))
    del copter.state.messages["HOME_POSITION"]
    with pytest.raises(Stale):
        copter.inside(NedTarget(10, 0, -20))()


def test_vehicle_outside_may_hold_its_place_but_not_creep_on(make: Callable[..., Any]) -> None:
    copter = make("copter", square(100), at=(110, 0, 20))
    assert allowed(copter, NedTarget(110, 0, -20))
    assert not allowed(copter, NedTarget(110.3, 0, -20))
    assert allowed(copter, NedTarget(0, 0, -20))
    address = Address(1, 1)
    message = VelocityTarget(-1, 0, 0).to(address, NO_YAW)
    with pytest.raises(OutsideEnvelope):
        copter.guard.require(message)


def test_faster_climb_needs_more_room_below_the_ceiling(make: Callable[..., Any]) -> None:
    near, fast = make("copter", square(100), at=(0, 0, 50), velocity=(0, 0, -1)), None
    assert leaving(near) is None
    fast = make("copter", square(100), at=(0, 0, 57), velocity=(0, 0, -4))
    space, breach = leaving(fast)
    assert breach.what == "field" and math.isfinite(breach.by) and space.envelope.areas


def test_a_way_that_is_taken_up_again_is_as_far_flown_as_it_was(make: Callable[..., Any]) -> None:
    """Each leg of a there and back again: geometry alone does not tell on which one the vehicle is."""
    copter = make("copter", square(300.0), at=(50.0, 0.0, 10.0))
    corners = [PathPoint(*FRAME.degrees(Spot(north, 0.0, 0.0)), 10.0) for north in (0.0, 50.0, 0.0, 50.0, 100.0)]
    ordered = Ordered(corners, passed=2)
    copter.guard.ordered = ordered
    assert list(copter.guard.remaining()) == corners[4:]
    copter.guard.ordered = Ordered()
    copter.guard.ordered = ordered  # what was ordered in between was refused
    assert list(copter.guard.remaining()) == corners[4:]


def test_no_place_of_a_way_is_on_the_other_side_of_the_earth(make: Callable[..., Any]) -> None:
    copter = make("copter", square(300))
    with pytest.raises(OutsideEnvelope, match=r"place 2 of the way is \d+ km away"):
        copter.require_route([GlobalTarget(*HOME, 10.0), GlobalTarget(HOME[0], 29.0, 10.0)])


def test_a_mission_that_was_changed_since_its_check_is_not_begun(make: Callable[..., Any]) -> None:
    copter = make("copter", square(300.0))
    lat, lon = FRAME.degrees(Spot(50.0, 0.0, 0.0))
    item = MissionItem(mavlink.MAV_CMD_NAV_WAYPOINT, 3, (0, 0, 0, 0), round(lat * 1e7), round(lon * 1e7), 20.0)
    copter.guard.require_mission([item], from_here=True, starts=[1])
    begin = messages.set_mode(mode_number(TYPES["copter"], "AUTO")).to(Address(1, 1), 0)
    copter.guard.require(begin)
    copter.guard.sending(mavlink.MAVLink_mission_clear_all_message(1, 1))
    with pytest.raises(OutsideEnvelope, match="was not checked"):
        copter.guard.require(begin)


@pytest.mark.parametrize("name", ["OA_TYPE", "wp_acc", "ANGLE_MAX", "ATC_DECEL_MAX", "NAVL1_PERIOD", "Q_OPTIONS"])
def test_no_client_sets_what_a_check_has_read(make: Callable[..., Any], name: str) -> None:
    copter = make("copter", square(300.0))
    copter.guard.require(mavlink.MAVLink_param_set_message(1, 1, b"SIM_WIND_SPD", 5.0, 9))
    with pytest.raises(OutsideEnvelope, match="decides where"):
        copter.guard.require(mavlink.MAVLink_param_set_message(1, 1, name.encode(), 1.0, 9))
