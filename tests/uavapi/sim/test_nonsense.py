"""Whatever a ground station sends, the copter neither dies nor flies to a place that is not a number."""

import itertools
import math
import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

STRANGE = (math.nan, math.inf, -math.inf, 1e30, -1e30, -1.0, 0.0, 1.0, 255.0)


@pytest.mark.parametrize("armed", [False, True])
def test_strange_command_parameters(ground, flying, armed):
    station = flying if armed else ground
    source = random.Random(1)
    for command in [*station.simulator.commands._handlers, 31000]:
        for value in STRANGE:
            station.command(command, *[value] * 7)
            station.command(command, *[source.choice(STRANGE) for _ in range(7)])
        station.check_sanity()


@pytest.mark.parametrize("mask", [0b110111111000, 0b110111000111, 0b110000111111, 0b110111000000, 0b000111111000, 0])
def test_strange_setpoints(flying, mask):
    for value, frame in itertools.product(STRANGE, (1, 7, 8, 9, 77)):
        flying.send(mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *[value] * 11))
        flying.run(0.05)
    for value, frame in itertools.product(STRANGE, (0, 3, 5, 6, 10, 11, 77)):
        flying.send(
            mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, frame, mask, 900000001, 0, *[value] * 9)
        )
        flying.send(mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, frame, mask, 1, 1, *[value] * 9))
        flying.run(0.05)
    flying.check_sanity()


def test_strange_parameter_values(flying):
    names = [parameter.name for parameter in flying.simulator.parameters.ordered]
    source = random.Random(2)
    for name in names:
        for value in (source.choice(STRANGE), source.choice(STRANGE)):
            flying.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
    for mode in (0, 2, 5, 4, 6, 9, 17):
        flying.copter.sticks.move(3, 1700)
        flying.mode(mode)
        flying.local((5.0, 5.0, -5.0))
        flying.run(0.5)
        flying.check_sanity()


def test_strange_mission_items_are_refused_or_flown(ground):
    ground.run(6.0)
    for value in STRANGE:
        ground.send(mavlink.MAVLink_mission_count_message(1, 1, 2, 0))
        ground.send(mavlink.MAVLink_mission_item_int_message(1, 1, 0, 0, 16, 0, 1, *[value] * 4, 0, 0, value, 0))
        ground.send(mavlink.MAVLink_mission_item_message(1, 1, 1, 3, 16, 0, 1, *[value] * 7, 0))
        ground.run(0.1)
        ground.send(mavlink.MAVLink_mission_request_message(1, 1, 0, 0))
        ground.send(mavlink.MAVLink_mission_request_message(1, 1, 1, 0))
        ground.run(0.1)
        ground.check_sanity()
