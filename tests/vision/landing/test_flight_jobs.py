"""How flights are stopped and unloaded, and how a newer one takes over."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import Invalid, ModeChanged
from mavproxy_uavapi.core.link.messages import NedTarget, VelocityTarget
from mavproxy_vision.landing.mission import MissionPlan
from tests.support.landing import (
    FAR_TAG,
    SMALL,
    SWITCH_MODE,
    TAG,
    TAKEOFF,
    height,
    holds,
    sent,
    silent,
    unheard,
)
from tests.support.vision_world import VisionWorld

# -- stopped while the autopilot flies for us ------------------------------------------------------------------


@pytest.mark.parametrize("action", ["land", "rtl"])
def test_stopped_in_what_a_failed_landing_does_it_holds(flying, action):
    world = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure=action)
    job = world.land()
    world.until(lambda: world.mode == action.upper(), step=0.05)
    world.pass_time(1.0)
    assert world.stop()
    assert str(world.outcome(job)) == "stopped; the vehicle is commanded to hold"
    assert holds(world, "BRAKE")


def test_stopped_in_the_pilots_mode_nothing_is_sent_and_nothing_else_is_reported(flying):
    world = flying()
    job = world.land()
    world.pass_time(2.0)
    world.copter.sticks.move(3, 1500)
    world.copter.set_mode(5)
    mark = len(world.sent)
    world.until(lambda: world.known.mode == "LOITER" or not job.running, step=0.05)
    if job.running:
        world.stop()
    world.outcome(job)
    world.pass_time(2.0)
    assert world.mode == "LOITER"
    assert not [m for m in sent(world, "COMMAND_LONG", mark) if m.command == SWITCH_MODE]


@pytest.mark.parametrize("after", [0.0, 0.3, 0.8, 1.5])
def test_a_mission_that_is_stopped_at_its_takeoff_does_not_take_off(make_world, after):
    world = make_world(sim_tags=TAG, **SMALL)
    world.switch_on()
    world.open_eye()
    job = world.fly(world.vision.mission(world.known, MissionPlan(alt=5, north=8, east=-5)))
    world.until(lambda: any(m.command == TAKEOFF for m in sent(world, "COMMAND_LONG")), step=0.05)
    world.pass_time(after)
    world.stop()
    world.outcome(job)
    world.pass_time(8.0)
    assert height(world) < 1.5


def test_one_lost_message_does_not_keep_it_from_holding(flying):
    world = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure="land")
    job = world.land()
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(1.0)
    deliver, lost = world.arrive, []

    def lossy(message: Any) -> None:
        if message.get_type() == "COMMAND_LONG" and message.command == SWITCH_MODE and not lost:
            lost.append(message)
        else:
            deliver(message)

    world.arrive = lossy
    world.stop()
    world.outcome(job)
    assert holds(world, "BRAKE")
    assert lost


def test_unloaded_in_the_autopilots_land_it_lands(flying):
    world = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure="land")
    job = world.land()
    world.until(lambda: world.known.mode == "LAND", step=0.05)
    world.unload()
    assert "left alone: it is in LAND" in str(world.outcome(job))
    mark = len(world.sent)
    world.until(lambda: not world.copter.armed, step=0.05)
    assert world.mode == "LAND"
    assert not sent(world, "SET_POSITION_TARGET_LOCAL_NED", mark)


def test_a_flight_whose_request_was_still_read_does_not_begin_after_unloading(flying):
    world = flying()
    world.vision.abort_all()
    mark = len(world.sent)
    job = world.land()
    world.pass_time(2.0)
    assert str(job.error) == "vision was unloaded"
    assert sent(world, "SET_POSITION_TARGET_LOCAL_NED", mark) == []


def test_a_mission_that_is_stopped_holds_before_it_writes_its_track(flying):
    world = flying()
    world.vision._directory = lambda: (_ for _ in ()).throw(RuntimeError("no home directory"))
    job = world.fly(world.vision.mission(world.known, MissionPlan(alt=20, north=60, east=0)))
    world.pass_time(4.0)
    assert world.stop()
    error = world.outcome(job)
    assert "commanded to hold" in str(error)
    assert holds(world)
    assert world.vision.report.track == "not written: no home directory"


@pytest.mark.parametrize(("setting", "fastest"), [(2.0, 2.5), (0.0, None)])
def test_a_mission_flies_to_its_place_at_its_own_speed(flying, setting, fastest):
    world = flying(mission_speed=setting)
    world.fly(world.vision.mission(world.known, MissionPlan(alt=5, north=40, east=0, on_tag=False)))
    speeds = []
    for _ in range(100):
        world.pass_time(0.1)
        velocity = world.known.state.messages["GLOBAL_POSITION_INT"].message
        speeds.append(math.hypot(velocity.vx, velocity.vy) / 100)
    assert max(speeds) < fastest if fastest else max(speeds) > 4
    world.stop()


@pytest.mark.parametrize("ended", ["stop", "unload"])
def test_a_flight_that_is_ended_while_it_is_prepared_never_begins(make_world, ended):
    world = make_world(sim_tags=TAG, precision_landing=True, **SMALL)
    world.switch_on()
    world.open_eye()
    hear = world.come
    silent(world, "PARAM_VALUE")
    plan = MissionPlan(alt=5, north=8, east=-5, method="landing_target")
    job = world.fly(world.vision.mission(world.known, plan), "/vision/mission")
    world.pass_time(0.3)
    getattr(world, ended)()
    world.come = hear
    assert world.outcome(job).code == "aborted"
    world.pass_time(20.0)
    assert not world.copter.armed


@pytest.mark.parametrize("action", ["land", "rtl"])
def test_what_is_ended_before_telemetry_shows_its_mode_is_held_all_the_same(flying, action):
    world = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure=action)
    hear = unheard(world, action.upper())
    job = world.land()
    world.until(lambda: world.mode == action.upper(), step=0.05)
    world.pass_time(0.2)
    assert world.stop() == "stopped; the vehicle is commanded to hold"
    world.pass_time(0.02)
    world.come = hear
    world.outcome(job)
    assert holds(world, "BRAKE")


# -- newer flights ---------------------------------------------------------------------------------------------


def test_a_landing_that_supersedes_another_sees(flying):
    world = flying(sim_tags=FAR_TAG)
    first = world.land()
    world.pass_time(2.0)
    second = world.land()
    assert world.outcome(second).startswith("Landed on tag 0")
    assert world.outcome(first).code == "superseded"


def test_a_flight_that_is_refused_leaves_the_one_under_way_alone(flying):
    world = flying(sim_tags=FAR_TAG)
    first = world.land()
    world.pass_time(2.0)
    refused = world.outcome(world.land(99999))
    assert isinstance(refused, Invalid)
    assert world.vision.running
    assert world.outcome(first).startswith("Landed on tag 0")


def test_a_flight_that_is_refused_in_land_does_not_hide_the_one_under_way(flying):
    world = flying()
    first = world.land()
    world.until(lambda: world.known.mode == "LAND", step=0.05)
    assert isinstance(world.outcome(world.fly(world.vision.searching(world.known, 3, None))), ModeChanged)
    assert world.vision.running
    assert world.vision.report.verb == "land"
    assert world.outcome(first).startswith("Landed on tag 0")


def test_a_landing_that_cannot_be_flown_leaves_the_movement_under_way_alone(flying):
    world = flying()  # its PLND_TYPE was 0 at boot

    async def go(job: Any) -> None:
        await world.known.go_to(job, NedTarget(30.0, 0.0, -8.0), wait=True)

    under_way = world.fly(go, "/movement/go_to_ned_wait")
    world.pass_time(2.0)
    for _ in range(2):  # the parameter is right after the first, and still nothing that the autopilot has read
        assert "reboot" in str(world.outcome(world.land(method="landing_target")))
    assert world.outcome(under_way) == "done"
    assert world.at.north == pytest.approx(30, abs=1.5)


def test_a_landing_that_takes_over_stops_what_was_flown(flying):
    world = flying(sim_tags=FAR_TAG)

    async def drive(job: Any) -> None:
        await world.known.travel(job, VelocityTarget(0.0, 3.0, 0.0), duration=20)

    world.fly(drive, "/movement/travel")
    world.pass_time(2.0)
    add_tag_id = world.tracker.add_tag_id

    async def slowly(number: int) -> None:
        await asyncio.sleep(2.0)
        await add_tag_id(number)

    world.tracker.add_tag_id = slowly
    mark = len(world.sent)
    world.land()
    world.pass_time(0.2)
    reported = sent(world, "SET_POSITION_TARGET_LOCAL_NED", mark)
    assert reported
    assert (reported[-1].vx, reported[-1].vy, reported[-1].vz) == (0, 0, 0)


# -- another vehicle -------------------------------------------------------------------------------------------


def other_vehicle(world: VisionWorld) -> None:
    """A second copter on the link, parked elsewhere and turned round."""
    count = [0]

    def say() -> None:
        count[0] += 1
        if count[0] % 40:
            return
        at = int((world.now - 900) * 1000)
        for message in (
            mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3),
            mavlink.MAVLink_attitude_message(at, 0, 0, math.radians(173), 0, 0, 0),
            mavlink.MAVLink_local_position_ned_message(at, 40, 30, 0, 0, 0, 0),
            mavlink.MAVLink_global_position_int_message(at, 0, 0, 0, 0, 0, 0, 0, 0),
        ):
            world.say(message, system=2)

    world.each_step.append(say)


def test_a_change_of_mavproxys_vehicle_does_not_change_who_lands(flying):
    world = flying(sim_tags=FAR_TAG)
    other_vehicle(world)
    job = world.land()
    world.pass_time(1.5)
    world.host.registry.current = 2
    result = world.outcome(job)
    assert str(result).startswith("Landed on tag 0"), result
    assert math.hypot(world.at.north - 1.6, world.at.east + 1.2) < 0.2
    assert {m.target_system for m in sent(world, "SET_POSITION_TARGET_LOCAL_NED")} == {1}


def test_vehicle_of_the_setting_lands_whichever_is_mavproxys(flying):
    world = flying(sim_tags=FAR_TAG, vehicle=1)
    other_vehicle(world)
    world.host.registry.current = 2
    world.pass_time(1.5)
    assert (world.tracker.carrier.system, world.tracker.carrier.vehicle().state.system, world.known.state.system) == (
        1,
        1,
        1,
    )
    result = world.outcome(world.land())
    assert str(result).startswith("Landed on tag 0"), result
