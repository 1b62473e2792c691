"""An order of ours that a newer one overtakes on the link: what stops the vehicle is not undone by it."""

from __future__ import annotations

import pytest

from tests.support.make_world import MakeWorld
from tests.support.world import LEGS, PLACE, World, item_at

STOPS = {"/command/brake": "BRAKE", "/movement/stop": "BRAKE", "/command/land": "LAND", "/command/rtl": "RTL"}
OLDER = {"/command/set_mode?mode=AUTO": "GUIDED", "/command/guided": "LOITER", "/mission/start": "GUIDED"}


def flying(world: World, mode: str) -> None:
    world.flying(mode=mode)
    world.copter.mission.items[:] = [item_at(*PLACE), *(item_at(PLACE[0] + north, PLACE[1]) for north in LEGS)]


def is_sent(world: World, number: int) -> bool:
    return any(getattr(message, "command", 0) == number for message in world.orders())


CASES = [(older, stop, 3.0) for older in OLDER for stop in STOPS]  # s by which the older order is late
CASES.remove(("/command/guided", "/movement/stop", 3.0))  # a vehicle in the pilot's mode is not stopped
CASES += [("/command/set_mode?mode=AUTO", "/command/brake", late) for late in (0.5, 1.5)]


@pytest.mark.matrix
@pytest.mark.parametrize(("older", "stop", "seconds"), CASES)
def test_stop_holds_although_an_older_switch_arrives_after_it(
    make_world: MakeWorld, older: str, stop: str, seconds: float
) -> None:
    world = make_world(lambda world: flying(world, OLDER[older]))
    world.delay(0.05)
    world.pass_time(6.0)
    world.held_up = seconds
    first = world.begin("POST" if "start" in older else "GET", older)
    world.until(lambda: is_sent(world, 176) or is_sent(world, 300))
    world.held_up = 0.0
    second = world.begin("GET", stop)
    world.pass_time(8.0)
    assert world.vehicle.mode.name == STOPS[stop] or not world.copter.armed
    assert not second.reply.done() or second.reply.result().outcome == "200"
    for wire in (first, second):
        wire.hang_up()


@pytest.mark.parametrize("seconds", [0.5, 3.0])
@pytest.mark.parametrize("stop", ["/command/disarm", "/movement/stop"])
def test_vehicle_stays_disarmed_when_an_older_order_to_arm_comes_late(
    make_world: MakeWorld, stop: str, seconds: float
) -> None:
    world = make_world(lambda world: (world.boot(), world.in_mode("GUIDED")))
    world.delay(0.05)
    world.pass_time(6.0)
    world.held_up = seconds
    world.begin("GET", "/command/arm")
    world.until(lambda: is_sent(world, 400))
    world.held_up = 0.0
    world.begin("GET", stop)
    world.pass_time(6.0)
    assert not world.copter.armed


def test_pilot_keeps_the_stopped_vehicle_while_an_older_order_is_missing(make_world: MakeWorld) -> None:
    world = make_world(lambda world: flying(world, "GUIDED"))
    world.delay(0.05)
    world.pass_time(6.0)
    world.fault("drop", message="COMMAND_LONG", command=176, count=1)
    world.begin("GET", "/command/set_mode?mode=AUTO")
    world.until(lambda: is_sent(world, 176))
    brake = world.begin("GET", "/command/brake")
    world.until(lambda: world.vehicle.mode.name == "BRAKE")
    world.pass_time(0.5)
    world.fault("pilot_mode", mode="AUTO")
    assert world.answer(brake).outcome == "409 mode_changed"
    world.pass_time(8.0)
    assert world.vehicle.mode.name == "AUTO"
