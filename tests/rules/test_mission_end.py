"""When a mission with `until_complete` has ended, in virtual time: not by motors that stop on the way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.link.messages import FORCE_DISARM
from tests.support.make_world import MakeWorld
from tests.support.messages import message_of
from tests.support.world import PLACE, World

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


def on_the_way(world: World, *, lands: bool = False) -> Any:
    """A request for a mission of a waypoint far away, and of a landing there; it waits for the end."""
    items = [{"command": "NAV_WAYPOINT", "lat": PLACE[0] + 0.004, "long": PLACE[1], "alt": 30}]
    if lands:
        items = [{"command": "NAV_LAND", "lat": PLACE[0], "long": PLACE[1], "alt": 0}]
    assert world.ask("POST", "/mission/waypoints", {"items": items}).outcome == "200"
    waiting = world.begin("POST", "/mission/start", {"until_complete": True})
    world.pass_time(4.0)
    assert not waiting.reply.done()
    return waiting


def kill(world: World) -> None:
    world.pilot_command(ARM, 0, FORCE_DISARM)


def boots(world: World) -> None:
    world.reboot(1.5)


@pytest.fixture
def high(make_world: MakeWorld) -> World:
    return make_world(lambda world: world.flying(height=30.0))


@pytest.mark.parametrize("end", [kill, boots])
@pytest.mark.parametrize("lands", [False, True])
def test_mission_is_not_completed_by_motors_lost_in_its_last_item(
    high: World, end: Callable[[Any], None], lands: bool
) -> None:
    waiting = on_the_way(high, lands=lands)
    end(high)
    assert high.answer(waiting).outcome == "409 not_armed"


def test_mission_that_lands_is_complete_when_it_stands_disarmed(high: World) -> None:
    waiting = on_the_way(high, lands=True)
    assert high.answer(waiting).outcome == "200"
    assert not high.copter.armed
    assert high.at[2] == pytest.approx(0.0, abs=0.1)


def test_mission_whose_last_item_is_a_waypoint_is_complete_there(high: World) -> None:
    waiting = on_the_way(high)
    assert high.answer(waiting).outcome == "200"
    assert high.copter.armed
    assert high.at[0] > 430.0


def test_late_end_of_the_mission_before_is_not_the_end_of_this_one(high: World) -> None:
    """It was complete 24 m from its begin, of 334 m: the answer to the start had overtaken that message."""
    on_the_way_back = {"command": "NAV_WAYPOINT", "lat": PLACE[0] + 0.0002, "long": PLACE[1], "alt": 30}
    assert high.ask("POST", "/mission/waypoints", {"items": [on_the_way_back]}).outcome == "200"
    assert high.ask("POST", "/mission/start", {"until_complete": True}).outcome == "200"
    feed = high.host.bridge.feed
    high.delay(0.3, 0.9, seed=3)
    high.pass_time(8.0)  # the trip is measured
    items = high.copter.mission.items
    items[1] = items[1]._replace(x=round((PLACE[0] + 0.003) * 1e7))
    waiting = high.begin("POST", "/mission/start", {"until_complete": True})
    high.until(lambda: high.copter.mission.state.name == "RUNNING", step=0.02)
    high.pass_time(1.5)
    complete = mavlink.MISSION_STATE_COMPLETE
    feed(message_of("MISSION_CURRENT", seq=1, total=1, mission_state=complete))
    high.host.bridge.turn()
    assert high.answer(waiting).outcome == "200" and high.at[0] > 330.0
