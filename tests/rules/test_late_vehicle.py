"""A vehicle that MAVProxy hears later than the first: MAVProxy requests its streams up to 15 s later."""

from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.sim import Options, Simulator
from tests.support import world as support
from tests.support.make_world import MakeWorld
from tests.support.world import World

SOON = 5.0  # s


@pytest.fixture
def world(make_world: MakeWorld) -> Any:
    """Vehicle 2 is heard 1 s after MAVProxy requested the streams of vehicle 1."""
    world = make_world(lambda world: world.boot())
    second = Simulator(Options(seed=2, sysid=2, ready_after=1.0, step=support.TICK))
    second.run(5.0)
    world.join(second)
    world.pass_time(1.0)
    return world


def listed(world: World) -> Any:
    return next(vehicle for vehicle in world.ask("GET", "/vehicles").body["vehicles"] if vehicle["id"] == 2)


def test_list_soon_shows_where_it_is_and_that_it_is_ready(world: World) -> None:
    world.pass_time(SOON)
    assert listed(world)["position"] is not None and listed(world)["ready_to_arm"]


def test_first_arm_is_soon_done(world: World) -> None:
    began = world.now
    assert world.ask("GET", "/vehicles/2/command/arm").status == 200
    assert world.now - began < SOON


def test_without_streams_nothing_is_asked_until_somebody_uses_it(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.setattr(support, "STREAMS_EVERY", 1e9)
    world = request.getfixturevalue("world")
    world.host.registry.streams_are_off = True
    before = len(world.sent)
    world.pass_time(20.0)
    assert listed(world)["position"] is None
    assert [sent for sent in world.sent[before:] if getattr(sent.message, "target_system", 0) == 2] == []
    began = world.now
    assert world.ask("GET", "/vehicles/2/command/arm").status == 200
    assert world.now - began < SOON
    assert world.ask("GET", "/vehicles/2/command/takeoff?alt=5").status == 200
    assert world.ask("POST", "/vehicles/2/movement/go_to_ned_wait", {"x": 10, "y": 0, "z": -5}).status == 200
