import math

import pytest

from mavproxy_uavapi.sim.geodesy import Ned
from mavproxy_uavapi.sim.position_control import PositionController
from mavproxy_uavapi.sim.shaping import limit_along, speeds_along, square_root_speed

DT = 0.01


def test_braking_speed_is_linear_near_and_parabolic_far():
    assert square_root_speed(0.1, 1.0, 2.0) == pytest.approx(0.1)
    assert square_root_speed(100.0, 1.0, 2.0) == pytest.approx(math.sqrt(2 * 2.0 * 99.0))


def test_a_slanted_way_keeps_both_speed_limits():
    horizontal, vertical = speeds_along(10.0, -10.0, 10.0, 2.5, 1.5)
    assert (horizontal, vertical) == pytest.approx((2.5, 2.5))


def follow(control):
    """The vehicle is where it should be."""
    control.thrust(Ned(*control.position), Ned(*control.velocity), DT)


@pytest.mark.parametrize("distance", [0.5, 3.0, 20.0, 300.0])
def test_a_move_keeps_its_limits_and_does_not_overshoot(distance):
    control = PositionController()
    target = Ned(distance * 0.6, distance * 0.8, -1.0)
    farthest, last = 0.0, (0.0, 0.0)
    for _ in range(8000):
        control.go_to(target, DT)
        follow(control)
        acceleration = (control.acceleration[0], control.acceleration[1])
        assert math.hypot(*acceleration) <= control.limits.acceleration * 1.01
        assert math.dist(acceleration, last) / DT <= 5.01
        assert math.hypot(*control.velocity[:2]) <= control.limits.speed * 1.02
        farthest, last = max(farthest, math.hypot(*control.position[:2])), acceleration
    assert farthest <= distance + 0.2
    assert control.position == pytest.approx(target, abs=0.01)


def test_a_long_move_reaches_the_speed_limit():
    control = PositionController()
    fastest = 0.0
    for _ in range(2000):
        control.go_to(Ned(300.0, 0.0, 0.0), DT)
        follow(control)
        fastest = max(fastest, control.velocity[0])
    assert fastest == pytest.approx(control.limits.speed, rel=0.02)


def test_a_move_waits_for_a_vehicle_that_the_wind_holds_back():
    control = PositionController()
    for step in range(4000):
        control.go_to(Ned(300.0, 0.0, 0.0), DT)
        control.thrust(Ned(2.0 * step * DT, 0.0, 0.0), Ned(2.0, 0.0, 0.0), DT)
    assert control.position[0] - 2.0 * 40 < 5.0


def test_what_the_lean_allows_holds_the_line_first():
    assert limit_along((30.0, 3.0), (1.0, 0.0), 5.0) == pytest.approx((4.0, 3.0))
    assert limit_along((0.0, 30.0), (1.0, 0.0), 5.0) == pytest.approx((0.0, 5.0))
    assert limit_along((30.0, 40.0), (0.0, 0.0), 5.0) == pytest.approx((3.0, 4.0))


def test_the_stopping_point_is_where_braking_ends():
    control = PositionController()
    for _ in range(1000):
        control.fly_at(5.0, 0.0, DT)
    promised = control.stopping_point
    for _ in range(1000):
        control.fly_at(0.0, 0.0, DT)
    assert control.position[0] == pytest.approx(promised.north, abs=2.5)
