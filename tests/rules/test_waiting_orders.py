"""A verb that waits for an answer of the vehicle meets a newer one: what was asked for later counts."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.rules.test_envelope import put
from tests.support.crossing_flights import Fleet
from tests.support.envelopes import field
from tests.support.make_world import MakeWorld
from tests.support.virtual_time import FastLoop
from tests.support.world import World

GO = ("POST", "/movement/go_to_ned", {"x": 20, "y": 0, "z": -8})


def waiting(make_world: MakeWorld, stage: Any, method: str, path: str, body: Any = None) -> tuple[World, Any]:
    """A verb that waits for home: the vehicle has told it once, and that was lost."""
    world = make_world(stage)
    put(world, field(200.0, 400))
    world.pass_time(4.0)
    world.hears = lambda message: message.get_type() != "HOME_POSITION"
    del world.host.registry.find(1).state.messages["HOME_POSITION"]
    wire = world.begin(method, path, body)
    world.pass_time(1.0)
    assert not wire.reply.done()
    return world, wire


def orders(world: World, since: float) -> list[Any]:
    """What was sent since but for questions."""
    asks = mavlink.MAV_CMD_REQUEST_MESSAGE
    return [message for message in world.orders(since) if getattr(message, "command", None) != asks]


def home_is_told(world: World) -> None:
    world.hears = lambda _message: True
    world.pass_time(8.0)


@pytest.mark.parametrize(
    ("newer", "mode"),
    [
        ("/command/land?wait=false", "LAND"),
        ("/command/rtl?wait=false", "RTL"),
        ("/command/brake", "BRAKE"),
    ],
)
def test_guided_that_waited_does_not_end_what_was_asked_for_later(
    make_world: MakeWorld, newer: str, mode: str
) -> None:
    world, wire = waiting(make_world, World.flying, "GET", "/command/guided")
    asked = world.begin("GET", newer)
    world.until(lambda: world.vehicle.mode.name == mode, 12.0, step=0.02)
    home_is_told(world)
    assert world.vehicle.mode.name == mode and world.answer(wire).outcome == "409 superseded"
    asked.hang_up()


@pytest.mark.parametrize("path", ["/command/guided", "/command/takeoff?alt=8"])
def test_stop_holds_against_a_verb_that_waited(make_world: MakeWorld, path: str) -> None:
    world, wire = waiting(make_world, World.armed if "takeoff" in path else World.flying, "GET", path)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    since, height = world.now, world.at[2]
    home_is_told(world)
    assert orders(world, since) == [] and world.at[2] == pytest.approx(height, abs=0.5)
    assert world.answer(wire).outcome == "409 superseded"


def test_of_two_targets_that_waited_the_newer_one_counts(make_world: MakeWorld) -> None:
    world, wire = waiting(make_world, World.flying, *GO)
    newer = world.begin("POST", "/movement/go_to_ned_wait", {"x": 0, "y": 20, "z": -8})
    home_is_told(world)
    assert world.answer(newer).outcome == "200" and world.answer(wire).status == 409
    assert world.at[1] == pytest.approx(20.0, abs=1.5)


def test_pilot_who_switches_while_a_verb_waits_keeps_the_vehicle(make_world: MakeWorld) -> None:
    world, wire = waiting(make_world, World.flying, "GET", "/command/guided")
    world.fault("pilot_mode", mode="ALT_HOLD")
    world.pass_time(1.5)
    home_is_told(world)
    assert world.vehicle.mode.name == "ALT_HOLD" and world.answer(wire).outcome == "409 mode_changed"


@pytest.mark.parametrize("newer", ["command/land?wait=false", "movement/stop", "command/brake"])
def test_nobody_of_a_gate_begins_if_a_newer_verb_takes_one(loop: FastLoop, newer: str) -> None:
    fleet = Fleet(loop, 2, {}, 8.0)
    world = fleet.world
    world.pass_time(2.0)
    put(world, field(400.0, 3000))
    world.pass_time(4.0)
    world.hears = lambda message: message.get_type() != "HOME_POSITION"
    del world.host.registry.find(2).state.messages["HOME_POSITION"]
    wire = world.begin("POST", "/fleet/guided", {"vehicles": [1, 2], "all_or_none": True})
    world.pass_time(0.5)
    asked = world.begin("GET", f"/vehicles/1/{newer}")
    world.pass_time(2.0)
    since = world.now
    home_is_told(world)
    assert world.answer(wire).status == 207 and orders(world, since) == []
    asked.hang_up()
    fleet.close()
