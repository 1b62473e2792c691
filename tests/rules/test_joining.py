"""Two clients request the same: what one of them was promised the other one does not take away."""

from __future__ import annotations

import math
from typing import Any

import pytest

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.support.make_world import MakeWorld
from tests.support.world import World

FAR = {"x": 300, "y": 0, "z": -8}
GO = "/movement/go_to_ned_wait"


@pytest.fixture
def world(make_world: MakeWorld) -> Any:
    return make_world()


def speed(world: World) -> float:
    return math.hypot(*world.copter.body.velocity)


@pytest.mark.matrix
@pytest.mark.parametrize("others", ["", "?on_disconnect=continue", "?on_disconnect=hold"])
@pytest.mark.parametrize("first_leaves_first", [True, False])
def test_vehicle_holds_after_both_have_gone_if_one_wishes_that(
    world: World, others: str, first_leaves_first: bool
) -> None:
    clients = [world.begin("POST", f"{GO}?on_disconnect=hold", FAR)]
    world.pass_time(2.0)
    clients.append(world.begin("POST", GO + others, FAR))
    for client in clients if first_leaves_first else reversed(clients):
        world.pass_time(1.0)
        assert speed(world) > 4.0
        client.hang_up()
    world.pass_time(6.0)
    assert speed(world) < 0.3


def test_setting_counts_if_one_leaves_it_to_that(make_world: MakeWorld) -> None:
    world = make_world()
    world.host.endings.on_disconnect = Policy.HOLD
    for queries in (("?on_disconnect=continue", ""), ("", "?on_disconnect=continue")):
        clients = [world.begin("POST", GO + query, FAR) for query in queries]
        world.pass_time(3.0)
        for client in clients:
            client.hang_up()
        world.pass_time(6.0)
        assert speed(world) < 0.3


def test_lease_of_the_first_ends_the_flight_though_another_has_joined(world: World) -> None:
    assert world.ask("POST", f"{GO}?wait=false&lease=8&client=first", FAR).status == 202
    second = world.begin("POST", f"{GO}?client=second", FAR)
    world.pass_time(1.0)
    second.hang_up()
    world.pass_time(15.0)
    assert speed(world) < 0.3
    assert "the lease of first@127.0.0.1 ran out" in world.screen()


def test_lease_of_who_joined_ends_the_flight(world: World) -> None:
    assert world.ask("POST", f"{GO}?wait=false&client=first", FAR).status == 202
    assert world.ask("POST", f"{GO}?wait=false&lease=8&client=second", FAR).status == 202
    world.pass_time(15.0)
    assert speed(world) < 0.3
    assert "the lease of second@127.0.0.1 ran out" in world.screen()
