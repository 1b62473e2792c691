"""Two clients that both want to fly the vehicle, for a minute: the newest command counts, and all are answered."""

from __future__ import annotations

import asyncio
import math
import random
from typing import Any, NamedTuple

from tests.support.make_world import MakeWorld
from tests.support.world import World

MINUTE = 60.0
PATH = "/movement/go_to_ned_wait"


class Requested(NamedTuple):
    """A request, when it was sent (s), and its answer."""

    at: float
    target: dict[str, float]
    reply: Any


async def hammer(world: World, seed: int, requested: list[Requested]) -> None:
    """A client that sends the vehicle somewhere else as soon as it has its answer, but for a breath."""
    dice = random.Random(seed)
    end = world.now + MINUTE
    await asyncio.sleep(dice.uniform(0.0, 0.1))
    while world.now < end:
        target = {"x": dice.randint(-20, 20), "y": dice.randint(-20, 20), "z": -dice.randint(5, 15)}
        began = world.now
        wire = await world.request("POST", PATH, target)
        requested.append(Requested(began, target, await asyncio.wait_for(wire.reply, MINUTE)))
        await asyncio.sleep(dice.uniform(*dice.choice([(0.0, 0.1), (0.3, 1.0), (6.0, 10.0)])))


def test_all_requests_are_answered_and_the_last_one_counts(make_world: MakeWorld) -> None:
    world = make_world()
    requested: list[Requested] = []

    async def both() -> None:
        await asyncio.gather(hammer(world, 1, requested), hammer(world, 2, requested))

    world.run(both())
    requested.sort(key=lambda one: one.at)
    outcomes = [one.reply.outcome for one in requested]
    assert set(outcomes) == {"200", "409 superseded"}
    assert outcomes[-1] == "200"
    for one, newer in zip(requested, requested[1:], strict=False):
        if one.reply.outcome == "409 superseded":
            assert one.reply.at - newer.at < 0.1
            assert PATH in one.reply.body["detail"]
        else:
            assert one.reply.at - one.at < 30.0
    last = requested[-1].target
    world.pass_time(5.0)
    assert math.dist(world.at, (last["x"], last["y"], last["z"])) < 1.5
    assert world.host.jobs.running() == [] and len(world.host.pending) == 0
    setpoints = [message for message in world.orders() if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert [(m.x, m.y, m.z) for m in setpoints] == [(t["x"], t["y"], t["z"]) for _, t, _ in requested]


def test_identical_requests_join_the_one_in_flight(make_world: MakeWorld) -> None:
    world = make_world()
    target = {"x": 15, "y": 0, "z": -8}
    first = world.begin("POST", PATH, target)
    world.pass_time(1.0)
    second = world.begin("POST", PATH, target)
    replies = [world.answer(wire) for wire in (first, second)]
    assert [reply.outcome for reply in replies] == ["200", "200"]
    assert replies[0].at == replies[1].at
    assert len([message for message in world.orders() if message.get_type().startswith("SET_POSITION")]) == 1


def test_land_that_is_repeated_without_a_pause_is_one_landing(make_world: MakeWorld) -> None:
    world = make_world()
    wires = []
    for _ in range(20):
        wires.append(world.begin("GET", "/command/land"))
        world.pass_time(0.25)
    assert {world.answer(wire).outcome for wire in wires} == {"200"}
    assert len([message for message in world.orders() if message.get_type() == "COMMAND_LONG"]) == 1


def test_reads_yaw_and_speeds_do_not_supersede(make_world: MakeWorld) -> None:
    world = make_world()
    wire = world.begin("POST", PATH, {"x": 20, "y": 0, "z": -8})
    for path in ("/telemetry/gps", "/movement/set_heading?heading=90", "/command/set_ground_speed?new_v=4"):
        assert world.ask("GET", path).outcome == "200"
    assert world.answer(wire).outcome == "200"
