"""The forces on the plane. The figures are those of SITL's plane."""

import math

import pytest

from mavproxy_uavapi.sim.physics import GRAVITY
from mavproxy_uavapi.sim.plane.body import PlaneBody

STEP = 0.01


def flying(airspeed, **state):
    body = PlaneBody.at_rest(0.0)
    body.airborne, body.down, body.airspeed, body.density = True, -50.0, airspeed, 1.087
    for name, value in state.items():
        setattr(body, name, value)
    return body


def fly(body, seconds, bank=0.0, climb=0.0, throttle=0.476):
    for _ in range(round(seconds / STEP)):
        body.fly(bank, climb, throttle, STEP)


def test_level_flight_takes_the_throttle_that_sitl_takes():
    body = flying(23.3)
    fly(body, 20.0, throttle=0.48)  # SITL: 23.30 m/s with 0.480
    assert body.airspeed == pytest.approx(23.3, abs=0.3)


def test_a_bank_turns_three_quarters_of_a_coordinated_turn():
    body = flying(23.3)
    fly(body, 3.0, bank=math.radians(40))
    before = body.yaw
    fly(body, 1.0, bank=math.radians(40))
    coordinated = GRAVITY * math.tan(math.radians(40)) / body.airspeed
    assert (body.yaw - before) / coordinated == pytest.approx(0.75, abs=0.02)


def test_a_plane_that_lowers_its_nose_turns_slower():
    """SITL's plane flies on by 20 m and more where it turns out of its climb."""
    turned = []
    for climb in (0.0, -4.0):
        body = flying(26.0, roll=math.radians(60), velocity_down=0.0)
        for step in range(100):
            body.fly(math.radians(60), climb * step / 100, 0.5, STEP)
        turned.append(body.yaw)
    assert turned[1] < 0.85 * turned[0]


def test_the_roll_begins_late():
    body = flying(23.3)
    fly(body, 0.2, bank=math.radians(64))
    assert math.degrees(body.roll) == pytest.approx(6.0, abs=3.0)  # SITL: 4.1 degrees
    fly(body, 0.6, bank=math.radians(64))
    assert math.degrees(body.roll) == pytest.approx(56.0, abs=5.0)  # SITL: 56.1


def test_a_tail_wind_that_grows_costs_airspeed():
    body = flying(23.3)
    fly(body, STEP)
    ground_speed = body.velocity_north
    body.wind_north = 5.0
    fly(body, STEP)
    assert body.velocity_north == pytest.approx(ground_speed, abs=0.05)
    assert body.airspeed == pytest.approx(18.3, abs=0.1)


def test_a_cross_wind_that_grows_turns_the_nose_before_it_carries_the_plane():
    body = flying(23.3)
    fly(body, STEP)
    body.wind_east = 2.0
    fly(body, STEP)
    assert body.velocity_east == pytest.approx(0.5, abs=0.1)
    assert math.degrees(body.yaw) == pytest.approx(-3.7, abs=0.3)
