"""Links on which each message takes its time."""

from __future__ import annotations

import math

import pytest

from tests.support.make_world import MakeWorld
from tests.support.world import World


@pytest.mark.parametrize("seconds", [0.0, 0.1, 0.5])
def test_rover_does_not_turn_round_at_the_end_of_a_travel(make_world: MakeWorld, seconds: float) -> None:
    """The place where it is to stop lies ahead of it when the message comes."""
    world = make_world(World.armed, vehicle="rover")
    world.delay(seconds)
    world.pass_time(3.0)
    travel = {"vx": 8.0, "vy": 0.0, "vz": 0.0, "duration": 10.0}
    assert world.ask("POST", "/movement/travel_at_ned", travel).outcome == "200"
    farthest = 0.0
    for _ in range(15):
        world.pass_time(1.0)
        farthest = max(farthest, world.at[0])
    assert math.hypot(*world.vehicle.body.velocity) < 0.1
    assert world.at[0] == pytest.approx(farthest, abs=0.5) and farthest > 45.0
    assert world.at[1] == pytest.approx(0.0, abs=0.5)
    assert math.degrees(world.vehicle.body.yaw) == pytest.approx(0.0, abs=10.0)
