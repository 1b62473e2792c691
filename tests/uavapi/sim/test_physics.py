import math

import pytest

from mavproxy_uavapi.sim.geodesy import Ned
from mavproxy_uavapi.sim.physics import GRAVITY, Body

DT = 0.01


def test_without_thrust_the_vehicle_stays_on_the_ground():
    body = Body.at_rest(353.0)
    for _ in range(100):
        body.step(Ned(0.0, 0.0, GRAVITY), 1.0, DT)
    assert body.position == (0.0, 0.0, 0.0)
    assert math.degrees(body.yaw) == pytest.approx(-7.0)


def test_motors_off_in_the_air_is_a_fall_that_ends_on_the_ground():
    body = Body.at_rest(0.0)
    body.down = -20.0
    for _ in range(150):
        body.step(Ned(0.0, 0.0, GRAVITY), 0.0, DT)
    assert body.velocity_down > 10.0
    for _ in range(200):
        body.step(Ned(0.0, 0.0, GRAVITY), 0.0, DT)
    assert body.down == 0.0
    assert body.velocity == (0.0, 0.0, 0.0)


def test_wind_pushes_to_where_it_blows():
    body = Body.at_rest(0.0)
    body.wind_east = 10.0
    body.down, body.thrust_down = -10.0, 0.0
    for _ in range(100):
        body.step(Ned(0.0, 0.0, 0.0), 0.0, DT)
    assert body.velocity_east > 0.5
    assert body.velocity_north == pytest.approx(0.0, abs=1e-9)


def test_acceleration_forward_is_nose_down_and_right_is_right_side_down():
    body = Body.at_rest(90.0)
    body.down, body.thrust_down = -10.0, 0.0
    for _ in range(100):
        body.step(Ned(1.0, 2.0, 0.0), 0.0, DT)
    assert body.pitch == pytest.approx(-math.atan2(2.0, GRAVITY), rel=0.05)
    assert body.roll == pytest.approx(-math.atan2(1.0, GRAVITY), rel=0.05)


def test_lean_of_30_degrees_ends_at_the_airspeed_of_sitls_quadcopter():
    body = Body.at_rest(0.0)
    body.down, body.thrust_down = -1000.0, 0.0
    for _ in range(3000):
        lift = 1 - body.thrust_down / GRAVITY  # more than the weight: some drag is along the propellers' axis
        body.step(Ned(GRAVITY * lift * math.tan(math.radians(30)), 0.0, -5.0 * body.velocity_down), 0.0, DT)
    assert body.velocity_north == pytest.approx(10.2, abs=0.4)
    assert math.degrees(body.pitch) == pytest.approx(-30, abs=1)
