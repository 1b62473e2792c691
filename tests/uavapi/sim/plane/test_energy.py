"""How the plane shares its energy between speed and height."""

import math

import pytest

from mavproxy_uavapi.sim.parameter_tables.plane import BLOCKS
from mavproxy_uavapi.sim.parameters import ParameterStore
from mavproxy_uavapi.sim.plane.demand import Demand
from mavproxy_uavapi.sim.plane.energy import EnergyControl, PlaneMotion

LEVEL = PlaneMotion(height=50.0, climb=0.0, airspeed=23.4, roll=0.0, yaw_rate=0.0)
STAY = Demand(height=50.0)


@pytest.fixture
def settled():
    """A plane that has flown level for a minute, its path as it was told."""
    control = EnergyControl(ParameterStore(BLOCKS, "4.7"))
    climb = 0.0
    for _ in range(3000):
        climb, _ = control.step(STAY, 23.4, LEVEL._replace(climb=climb), 0.02)
    return control


def test_it_flies_level_with_the_throttle_of_the_cruise(settled):
    climb, throttle = settled.step(STAY, 23.4, LEVEL, 0.02)
    assert climb == pytest.approx(0.0, abs=0.2)
    assert throttle == pytest.approx(0.5, abs=0.02)


def test_a_plane_that_is_too_fast_climbs_and_takes_its_throttle_back(settled):
    climb = throttle = 0.0
    for step in range(400):
        airspeed = min(23.4 + 0.02 * step, 27.0)
        climb, throttle = settled.step(STAY, 23.4, LEVEL._replace(airspeed=airspeed, climb=climb), 0.02)
    assert climb > 1.5
    assert throttle < 0.3


def test_a_plane_that_need_not_heed_its_speed_keeps_its_height(settled):
    climb = 0.0
    for step in range(400):
        airspeed = min(23.4 + 0.02 * step, 27.0)
        now = LEVEL._replace(airspeed=airspeed, climb=climb)
        climb, _ = settled.step(Demand(height=50.0, trade=0.0), 23.4, now, 0.02)
    assert abs(climb) < 0.5


def test_a_steep_turn_takes_throttle(settled):
    """TECS_RLL2THR; SITL's plane comes out of its corners 1 to 2 m/s faster."""
    turning = LEVEL._replace(roll=math.radians(60), yaw_rate=0.55)
    _, throttle = settled.step(STAY, 23.4, turning, 0.02)
    assert throttle == pytest.approx(0.5 + 10 * 3 / (7 * 9.81), abs=0.03)


def test_a_climb_rate_without_a_height_is_flown_as_it_is(settled):
    climb, throttle = settled.step(Demand(climb=3.0), 23.4, LEVEL, 0.02)
    assert climb == 3.0
    assert throttle > 0.9
