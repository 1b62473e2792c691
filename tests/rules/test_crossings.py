"""Orders and answers that cross on the link: a pilot's, another client's, or those of a packet that was lost."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.support.make_world import MakeWorld
from tests.support.world import PLACE, World, item_at

MODE, PAUSE = mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_DO_PAUSE_CONTINUE
START = mavlink.MAV_CMD_MISSION_START
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
FAR, GO = {"x": 300, "y": 0, "z": -8}, "/movement/go_to_ned_wait"
MUTE = ("HEARTBEAT", "COMMAND_ACK")


def speed(world: World) -> float:
    return math.hypot(*world.copter.body.velocity)


def commands(world: World, number: int, since: float) -> list[Any]:
    return [s.message for s in world.sent if s.at >= since - 1e-3 and getattr(s.message, "command", None) == number]


def beat(world: World) -> float:
    """Just after a heartbeat; now."""
    state = world.host.fleet.vehicles[1]
    before = state.heartbeat_at
    world.until(lambda: state.heartbeat_at > before)
    return world.now


def hear_all(world: World) -> None:
    world.hears = lambda _message: True


def mission_in_guided(world: World) -> None:
    world.flying()
    world.copter.mission.items[:] = [item_at(*PLACE), item_at(PLACE[0] + 0.003, PLACE[1])]


@pytest.mark.parametrize("path", ["/command/brake", "/command/land", "/command/rtl"])
def test_late_refusal_of_another_mode_does_not_end_what_stops(world: World, path: str) -> None:
    world.ask("POST", "/movement/go_to_ned", FAR)
    world.pass_time(3.0)
    since = beat(world)
    world.fault("refuse", command=MODE, result=mavlink.MAV_RESULT_FAILED, count=1)
    world.fault("delay_acks", command=MODE, seconds=0.4, count=1)
    world.begin("GET", "/command/set_mode?mode=AUTO")
    world.until(lambda: commands(world, MODE, since))
    world.pass_time(0.2)
    world.uplink_until = world.now + 0.1  # one packet is lost
    call = world.begin("GET", path)
    world.pass_time(8.0)
    assert world.copter.mode.name != "GUIDED", call.reply.result().outcome


def test_stop_in_a_pilots_mode_that_a_lost_guided_did_not_end_is_refused(make_world: MakeWorld) -> None:
    world = make_world(lambda world: world.flying("LOITER"))
    world.uplink_until = world.now + 0.2  # GUIDED is lost
    guided = world.begin("GET", "/command/guided")
    world.pass_time(0.3)
    guided.hang_up()
    world.pass_time(3.0)
    assert world.ask("GET", "/movement/stop").outcome == "409 mode_changed"
    assert world.copter.mode.name == "LOITER"


@pytest.mark.parametrize("path", ["land", "rtl", "guided", "set_mode?mode=AUTO"])
def test_switch_is_not_repeated_over_the_pilots(make_world: MakeWorld, path: str) -> None:
    world = make_world(mission_in_guided)
    if path == "guided":
        world.in_mode("AUTO")
        world.pass_time(3.0)
    since = beat(world)
    call = world.begin("GET", f"/command/{path}")
    world.until(lambda: commands(world, MODE, since))
    world.hears = lambda message: message.get_type() not in MUTE
    world.pass_time(0.95)
    world.in_mode("LOITER")
    world.pass_time(0.8)  # the second sending, at 1.5 s
    hear_all(world)
    assert world.answer(call).outcome == "409 mode_changed" and world.copter.mode.name == "LOITER"


@pytest.mark.parametrize("path", ["brake", "set_mode?mode=brake"])
def test_what_stops_is_sent_again_as_soon_as_its_pilot_is_heard(world: World, path: str) -> None:
    world.ask("POST", "/movement/go_to_ned", FAR)
    world.pass_time(3.0)
    world.hears = lambda message: message.get_type() not in MUTE
    world.uplink_until = world.now + 0.1  # the first packet is lost
    world.begin("GET", f"/command/{path}")
    world.pass_time(3.0)
    assert world.copter.mode.name == "GUIDED"  # unheard, he may have it
    world.hears = lambda message: True
    world.pass_time(9.0)
    assert world.copter.mode.name == "BRAKE" and speed(world) < 0.3


@pytest.mark.parametrize("pilot", ["LOITER", "STABILIZE"])
def test_refused_pause_of_a_mission_the_pilot_left_sends_nothing_more(make_world: MakeWorld, pilot: str) -> None:
    world = make_world(World.on_mission)
    world.pass_time(3.0)
    beat(world)
    world.hears = lambda message: message.get_type() != "HEARTBEAT"
    world.in_mode(pilot)
    world.pass_time(0.1)
    world.loop.call_later(0.8, hear_all, world)
    assert world.ask("GET", "/movement/stop").outcome == "409 mode_changed"
    assert world.copter.mode.name == pilot


@pytest.mark.parametrize("policy", [Policy.RTL, Policy.LAND])
def test_lease_of_a_flight_that_another_client_has_stopped_moves_nothing(world: World, policy: Policy) -> None:
    world.host.endings.on_lease_end = policy
    world.begin("POST", GO + "?lease=10&client=a", FAR)
    world.pass_time(3.0)
    assert world.ask("GET", "/movement/stop?client=b").outcome == "200"
    world.pass_time(10.0)
    assert world.copter.mode.name == "GUIDED"


def test_deleted_takeoff_whose_pause_is_refused_stays_low(on_ground: World) -> None:
    world = on_ground
    world.fault("refuse", command=PAUSE, result=mavlink.MAV_RESULT_UNSUPPORTED)
    job = world.ask("GET", "/command/takeoff?alt=20&wait=false").headers["location"]
    world.pass_time(0.3)
    world.ask("DELETE", job)
    world.pass_time(15.0)
    assert world.at[2] > -2.0
    assert not world.host.registry.find(1).authority.paused


def test_delete_of_a_lost_guided_after_auto_stops_the_mission(make_world: MakeWorld) -> None:
    world = make_world(mission_in_guided)
    since = beat(world)
    world.begin("POST", "/mission/start", {})
    world.until(lambda: commands(world, START, since))
    world.hears = lambda _message: False  # a blink: the heartbeat AUTO, and the order GUIDED, are lost
    world.until(lambda: world.copter.mode.name == "AUTO")
    world.uplink_until = world.now + 0.1
    guided = world.begin("GET", "/command/guided?wait=false")
    world.pass_time(0.11)
    hear_all(world)
    world.ask("DELETE", world.answer(guided).headers["location"])
    world.pass_time(10.0)
    assert speed(world) < 0.3


def test_resume_whose_client_hangs_up_is_completed(world: World) -> None:
    world.begin("POST", GO, FAR)
    world.pass_time(2.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    since = world.now
    resume = world.begin("GET", "/movement/resume")
    world.until(lambda: commands(world, PAUSE, since))
    resume.hang_up()
    world.pass_time(5.0)
    assert speed(world) > 5.0
    assert world.ask("POST", "/movement/go_to_ned", {"x": 0, "y": 50, "z": -8}).outcome == "200"


def test_brake_undoes_an_order_to_arm(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    world.in_mode("GUIDED")
    world.pass_time(3.0)
    since = world.now
    world.begin("GET", "/command/arm")
    world.until(lambda: commands(world, ARM, since))
    world.ask("GET", "/command/brake")
    world.pass_time(3.0)
    assert not world.copter.armed


@pytest.mark.parametrize("how", ["&lease=12&client=a", "&on_disconnect=hold"])
def test_end_of_a_takeoff_that_another_station_has_taken_sends_nothing(on_ground: World, how: str) -> None:
    world = on_ground
    takeoff = world.begin("GET", f"/command/takeoff?alt=60{how}")
    world.pass_time(6.0)
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    place = round((PLACE[0] + 0.01) * 1e7), round(PLACE[1] * 1e7), 12.0
    world.arriving.append(
        mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, frame, 0b110111111000, *place, *(0.0,) * 8)
    )
    world.pass_time(5.0)
    assert world.host.registry.find(1).has_foreign_target and speed(world) > 5.0
    since = world.now
    if "hold" in how:
        takeoff.hang_up()
    world.pass_time(8.0)
    assert [m for m in world.orders(since) if m.get_type().startswith("SET_POSITION")] == [] and speed(world) > 5.0
