"""The pilot wins on a slow link, too: what he has undone is not done again by a second sending."""

from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.sim.mission import Item
from tests.support import stages
from tests.support import world as support
from tests.support.make_world import MakeWorld
from tests.support.world import LEGS, PLACE, World, item_at

pytestmark = pytest.mark.matrix

MISSION_START, SET_MODE, LAND_START = 300, 176, 189  # MAV_CMD
LINKS = [(0.3, 0.3), (0.9, 0.0), (0.9, 0.9), (2.0, 2.0)]  # s each way, and s of chance
# s from the effect of the command to the pilot's switch
TAKEN = [pytest.param(0.1, marks=pytest.mark.long), 0.8, pytest.param(1.6, marks=pytest.mark.long)]
SWITCHES = {
    "/command/guided": "LOITER",
    "/command/rtl": "GUIDED",
    "/command/land": "GUIDED",
    "/command/brake": "GUIDED",
    "/command/set_mode?mode=AUTO": "GUIDED",
    "/mission/start": "GUIDED",
}


def items() -> list[Item]:
    return [item_at(*PLACE), *(item_at(PLACE[0] + north, PLACE[1]) for north in LEGS)]


@pytest.mark.parametrize("taken", TAKEN)
@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("path", SWITCHES)
def test_pilots_switch_after_the_effect_of_a_command_is_not_undone(
    make_world: MakeWorld, path: str, link: tuple[float, float], taken: float
) -> None:
    def stage(world: World) -> None:
        world.flying(mode=SWITCHES[path])
        world.copter.mission.items[:] = items()

    world = make_world(stage)
    world.delay(*link)
    world.pass_time(6.0)  # the trip is measured
    mode = SWITCHES[path]
    wire = world.begin("POST" if "start" in path else "GET", path)
    world.until(lambda: world.vehicle.mode.name != mode or wire.reply.done(), step=0.02)
    world.pass_time(taken)
    world.fault("pilot_mode", mode="ALT_HOLD")
    world.pass_time(5 * (sum(link) + 2.0))
    assert world.vehicle.mode.name == "ALT_HOLD"
    wire.hang_up()


@pytest.mark.parametrize("taken", TAKEN)
@pytest.mark.parametrize("link", LINKS)
def test_vehicle_that_its_pilot_has_disarmed_is_not_armed_again(
    make_world: MakeWorld, link: tuple[float, float], taken: float
) -> None:
    world = make_world(World.boot)
    world.delay(*link)
    world.pass_time(6.0)
    wire = world.begin("GET", "/command/arm?timeout=60")
    world.until(lambda: world.copter.armed, step=0.02)
    world.pass_time(taken)
    world.by_hand(400, 0)
    assert not world.copter.armed
    world.pass_time(5 * (sum(link) + 2.0))
    assert not world.copter.armed
    wire.hang_up()


@pytest.mark.parametrize(("path", "before"), [("/command/arm", "GUIDED"), *list(SWITCHES.items())[:1]])
def test_order_whose_lost_effect_the_pilot_undoes_is_not_sent_again(
    make_world: MakeWorld, path: str, before: str
) -> None:
    def stage(world: World) -> None:
        (world.boot if path == "/command/arm" else world.flying)()
        world.in_mode(before)

    world = make_world(stage)
    world.pass_time(3.0)
    world.hears = lambda message: message.get_type() not in ("COMMAND_ACK", "HEARTBEAT")
    before_it = world.vehicle.mode.name, world.vehicle.armed
    wire = world.begin("GET", path)
    world.until(lambda: (world.vehicle.mode.name, world.vehicle.armed) != before_it, step=0.02)
    if path == "/command/arm":
        world.by_hand(400, 0)
    else:
        world.in_mode(before)
    world.pass_time(0.5)
    world.hears = lambda _message: True
    assert world.answer(wire).outcome == "504 timeout"
    assert (world.vehicle.mode.name, world.vehicle.armed) == before_it


def test_lost_order_is_sent_again_where_nothing_of_the_vehicle_is_missing(make_world: MakeWorld) -> None:
    world = make_world(lambda world: (world.boot(), world.in_mode("GUIDED")))
    world.pass_time(3.0)
    world.fault("drop", message="COMMAND_LONG", command=400, count=1)
    assert world.ask("GET", "/command/arm").outcome == "200"
    assert world.copter.armed


@pytest.mark.parametrize("link", LINKS)
def test_lost_command_is_sent_again_and_does_its_work(
    make_world: MakeWorld, monkeypatch: pytest.MonkeyPatch, link: tuple[float, float]
) -> None:
    monkeypatch.setattr(support, "TICK", support.TICK / 2)  # the deadline lies within a step of the test world
    world = make_world()
    world.delay(*link)
    world.pass_time(6.0)
    world.fault("drop", message="COMMAND_LONG", command=176, count=1)
    assert world.ask("GET", "/command/brake").outcome == "200"
    assert world.vehicle.mode.name == "BRAKE"


def test_speed_that_never_comes_is_not_proven_by_a_copy_of_an_older_ack(world: World) -> None:
    feed = world.host.bridge.feed

    def twice(message: Any) -> None:
        feed(message)
        if message.get_type() == "COMMAND_ACK" and message.command == 178:
            world.loop.call_later(0.4, lambda: (feed(message), world.host.bridge.turn()))

    world.host.bridge.feed = twice
    assert world.ask("GET", "/command/set_ground_speed?new_v=3").outcome == "200"
    world.fault("drop", message="COMMAND_LONG", command=178)
    assert world.ask("GET", "/command/set_ground_speed?new_v=9").outcome == "504 timeout"


@pytest.mark.parametrize("seconds", [0.0, 0.9])
def test_order_that_begins_in_the_mode_that_it_needs_is_sent_once(make_world: MakeWorld, seconds: float) -> None:
    world = make_world(World.on_mission)
    world.delay(seconds)
    world.pass_time(4.0)
    start = world.begin("POST", "/mission/start")
    world.until(lambda: started(world), 30.0, step=0.02)
    world.pass_time(seconds + 0.04)
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(8.0)
    assert world.vehicle.mode.name == "LOITER" and started(world) == 1
    start.hang_up()


def started(world: World) -> int:
    """How many orders to begin the mission were sent."""
    return sum(getattr(message, "command", None) == MISSION_START for message in world.orders())


@pytest.mark.parametrize(("kind", "order"), [("quadplane", SET_MODE), ("plane", LAND_START)])
def test_landing_asks_nothing_before_it_goes_out(make_world: MakeWorld, kind: str, order: int) -> None:
    world = make_world(stages.hovering if kind == "quadplane" else stages.cruising, vehicle=kind)
    world.host.registry.find(1).state.parameters.clear()
    world.delay(0.9)
    world.pass_time(4.0)
    asked_at = world.now
    landing = world.begin("GET", "/command/land")
    world.pass_time(0.1)
    assert [message.command for message in world.orders(since=asked_at - 0.01)] == [order]
    landing.hang_up()


def test_what_the_vehicle_holds_is_read(make_world: MakeWorld) -> None:
    world = make_world()
    world.copter.mission.items[:] = items()
    world.host.registry.find(1).state.parameters.clear()
    world.delay(1.5)
    world.pass_time(8.0)
    assert len(world.ask("GET", "/mission/waypoints").body["items"]) == len(items()) - 1
    assert world.ask("GET", "/parameters/WPNAV_SPEED").outcome == "404 not_found"  # of older versions
    assert world.ask("GET", "/parameters/WP_SPD").outcome == "200"
