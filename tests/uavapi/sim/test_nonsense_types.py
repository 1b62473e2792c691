"""Whatever a ground station sends, no vehicle of another type dies or goes to a place that is not a number."""

import itertools
import math
import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options
from mavproxy_uavapi.sim.mission import ALL_ITEMS

pytestmark = pytest.mark.matrix

STRANGE = (math.nan, math.inf, -math.inf, 1e30, -1e30, -1.0, 0.0, 1.0, 255.0)
GUIDED = 15
TAKEOFF_MODE = 13
TYPES = ("rover", "plane", "quadplane")


@pytest.fixture(params=TYPES)
def moving(request, new_ground):
    """A vehicle of each type on its way in GUIDED."""
    ground = new_ground(Options(vehicle=request.param))
    ground.run(6.0)
    if request.param == "plane":
        ground.mode(TAKEOFF_MODE)
        ground.arm()
        ground.run(15.0)
    ground.mode(GUIDED)
    ground.arm()
    ground.run(4.0)
    ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 10.0)
    ground.run(8.0)
    ground.local((50.0, 0.0, 0.0))
    ground.run(1.0)
    return ground


def test_strange_command_parameters(moving):
    source = random.Random(1)
    for command in [*moving.simulator.commands._handlers, 31000]:
        for value in STRANGE:
            moving.command(command, *[value] * 7)
            moving.command(command, *[source.choice(STRANGE) for _ in range(7)])
            four, z = tuple(source.choice(STRANGE) for _ in range(4)), source.choice(STRANGE)
            moving.command_int(command, source.choice((0, 1, 3, 9, 10, 77)), four, (1, 1, z))
        moving.check_sanity()


@pytest.mark.parametrize("mask", [0b110111111000, 0b110111000111, 0b010111000111, 0b100111000111, 0b000111111111, 0])
def test_strange_setpoints(moving, mask):
    for value, frame in itertools.product(STRANGE, (1, 7, 8, 9, 77)):
        moving.send(mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *[value] * 11))
        moving.run(0.05)
    for value, frame in itertools.product(STRANGE, (0, 3, 6, 10, 77)):
        message = mavlink.MAVLink_set_position_target_global_int_message
        for place in ((900000001, 0), (1, 1)):
            moving.send(message(0, 1, 1, frame, mask, *place, *[value] * 9))
        moving.run(0.05)
    moving.check_sanity()


@pytest.mark.parametrize("seed", range(6))
def test_strange_parameter_values(moving, seed):
    source = random.Random(seed)
    for parameter in moving.simulator.parameters.ordered:
        for value in (source.choice(STRANGE), source.choice(STRANGE)):
            moving.send(mavlink.MAVLink_param_set_message(1, 1, parameter.name.encode(), value, 9))
    for mode in moving.simulator.vehicle.modes:
        moving.simulator.vehicle.sticks.move(3, 1700)
        moving.simulator.vehicle.sticks.move(1, 1700)
        moving.mode(mode)
        moving.run(0.5)
        moving.check_sanity()


def test_every_item_in_a_mission_with_strange_values(moving):
    moving.simulator.vehicle.set_home_here(lock=True)
    for value in STRANGE:
        items = sorted(ALL_ITEMS)
        moving.send(mavlink.MAVLink_mission_count_message(1, 1, len(items) + 1, 0))
        for seq, command in enumerate([16, *items]):
            spot = (1000 * seq, 1000 * seq, 20.0 if math.isnan(value) else min(max(value, -10.0), 80.0))
            four = (0, 0, 0, 0) if command == mavlink.MAV_CMD_DO_JUMP else [value] * 4
            moving.send(mavlink.MAVLink_mission_item_int_message(1, 1, seq, 3, command, 0, 1, *four, *spot, 0))
        moving.run(0.05)
        for seq in range(1, len(items) + 1):
            moving.command(mavlink.MAV_CMD_MISSION_START)
            moving.command(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, seq)
            moving.run(0.1)
        moving.check_sanity()
        moving.mode(GUIDED)
