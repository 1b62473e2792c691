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
    until,
)

# -- stopped while the autopilot flies for us ------------------------------------------------------------------


@pytest.mark.parametrize("action", ["land", "rtl"])
def test_stopped_in_what_a_failed_landing_does_it_holds(flying, action):
    rig = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure=action)
    job = rig.land()
    until(rig, lambda: rig.mode == action.upper())
    rig.pass_time(1.0)
    assert rig.stop()
    assert str(rig.outcome(job)) == "stopped; the vehicle is commanded to hold"
    assert holds(rig, "BRAKE")


def test_stopped_in_the_pilots_mode_nothing_is_sent_and_nothing_else_is_reported(flying):
    rig = flying()
    job = rig.land()
    rig.pass_time(2.0)
    rig.simulator.copter.sticks.move(3, 1500)
    rig.simulator.copter.set_mode(5)
    mark = len(rig.wire.sent)
    until(rig, lambda: rig.copter.mode == "LOITER" or not job.running)
    if job.running:
        rig.stop()
    rig.outcome(job)
    rig.pass_time(2.0)
    assert rig.mode == "LOITER"
    assert not [m for m in sent(rig, "COMMAND_LONG", mark) if m.command == SWITCH_MODE]


@pytest.mark.parametrize("after", [0.0, 0.3, 0.8, 1.5])
def test_a_mission_that_is_stopped_at_its_takeoff_does_not_take_off(lockstep, after):
    rig = lockstep(sim_tags=TAG, **SMALL)
    rig.switch_on()
    rig.open_eye()
    job = rig.begin(rig.flights.mission(rig.copter, MissionPlan(alt=5, north=8, east=-5)))
    until(rig, lambda: any(m.command == TAKEOFF for m in sent(rig, "COMMAND_LONG")))
    rig.pass_time(after)
    rig.stop()
    rig.outcome(job)
    rig.pass_time(8.0)
    assert height(rig) < 1.5


def test_one_lost_message_does_not_keep_it_from_holding(flying):
    rig = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure="land")
    job = rig.land()
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)
    deliver, lost = rig.wire.deliver, []

    def lossy(message: Any) -> None:
        if message.get_type() == "COMMAND_LONG" and message.command == SWITCH_MODE and not lost:
            lost.append(message)
        else:
            deliver(message)

    rig.wire.deliver = lossy
    rig.stop()
    rig.outcome(job)
    assert holds(rig, "BRAKE")
    assert lost


def test_unloaded_in_the_autopilots_land_it_lands(flying):
    rig = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure="land")
    job = rig.land()
    until(rig, lambda: rig.copter.mode == "LAND")
    rig.unload()
    assert "left alone: it is in LAND" in str(rig.outcome(job))
    mark = len(rig.wire.sent)
    until(rig, lambda: not rig.simulator.copter.armed)
    assert rig.mode == "LAND"
    assert not sent(rig, "SET_POSITION_TARGET_LOCAL_NED", mark)


def test_a_flight_whose_request_was_still_read_does_not_begin_after_unloading(flying):
    rig = flying()
    rig.flights.abort_all()
    mark = len(rig.wire.sent)
    job = rig.land()
    rig.pass_time(2.0)
    assert str(job.error) == "vision was unloaded"
    assert sent(rig, "SET_POSITION_TARGET_LOCAL_NED", mark) == []


def test_a_mission_that_is_stopped_holds_before_it_writes_its_track(flying):
    rig = flying()
    rig.flights._directory = lambda: (_ for _ in ()).throw(RuntimeError("no home directory"))
    job = rig.begin(rig.flights.mission(rig.copter, MissionPlan(alt=20, north=60, east=0)))
    rig.pass_time(4.0)
    assert rig.stop()
    error = rig.outcome(job)
    assert "commanded to hold" in str(error)
    assert holds(rig)
    assert rig.flights.report.track == "not written: no home directory"


@pytest.mark.parametrize(("setting", "fastest"), [(2.0, 2.5), (0.0, None)])
def test_a_mission_flies_to_its_place_at_its_own_speed(flying, setting, fastest):
    rig = flying(mission_speed=setting)
    rig.begin(rig.flights.mission(rig.copter, MissionPlan(alt=5, north=40, east=0, on_tag=False)))
    speeds = []
    for _ in range(100):
        rig.pass_time(0.1)
        velocity = rig.copter.state.messages["GLOBAL_POSITION_INT"].message
        speeds.append(math.hypot(velocity.vx, velocity.vy) / 100)
    assert max(speeds) < fastest if fastest else max(speeds) > 4
    rig.stop()


@pytest.mark.parametrize("ended", ["stop", "unload"])
def test_a_flight_that_is_ended_while_it_is_prepared_never_begins(lockstep, ended):
    rig = lockstep(sim_tags=TAG, precision_landing=True, **SMALL)
    rig.switch_on()
    rig.open_eye()
    hear = rig.host._receive
    silent(rig, "PARAM_VALUE")
    plan = MissionPlan(alt=5, north=8, east=-5, method="landing_target")
    job = rig.begin(rig.flights.mission(rig.copter, plan), "/vision/mission")
    rig.pass_time(0.3)
    getattr(rig, ended)()
    rig.host._receive = hear
    assert rig.outcome(job).code == "aborted"
    rig.pass_time(20.0)
    assert not rig.simulator.copter.armed


@pytest.mark.parametrize("action", ["land", "rtl"])
def test_what_is_ended_before_telemetry_shows_its_mode_is_held_all_the_same(flying, action):
    rig = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure=action)
    hear = unheard(rig, action.upper())
    job = rig.land()
    until(rig, lambda: rig.mode == action.upper())
    rig.pass_time(0.2)
    assert rig.stop() == "stopped; the vehicle is commanded to hold"
    rig.pass_time(0.02)
    rig.host._receive = hear
    rig.outcome(job)
    assert holds(rig, "BRAKE")


# -- newer flights ---------------------------------------------------------------------------------------------


def test_a_landing_that_supersedes_another_sees(flying):
    rig = flying(sim_tags=FAR_TAG)
    first = rig.land()
    rig.pass_time(2.0)
    second = rig.land()
    assert rig.outcome(second).startswith("Landed on tag 0")
    assert rig.outcome(first).code == "superseded"


def test_a_flight_that_is_refused_leaves_the_one_under_way_alone(flying):
    rig = flying(sim_tags=FAR_TAG)
    first = rig.land()
    rig.pass_time(2.0)
    refused = rig.outcome(rig.land(99999))
    assert isinstance(refused, Invalid)
    assert rig.flights.running
    assert rig.outcome(first).startswith("Landed on tag 0")


def test_a_flight_that_is_refused_in_land_does_not_hide_the_one_under_way(flying):
    rig = flying()
    first = rig.land()
    until(rig, lambda: rig.copter.mode == "LAND")
    assert isinstance(rig.outcome(rig.begin(rig.flights.searching(rig.copter, 3, None))), ModeChanged)
    assert rig.flights.running
    assert rig.flights.report.verb == "land"
    assert rig.outcome(first).startswith("Landed on tag 0")


def test_a_landing_that_cannot_be_flown_leaves_the_movement_under_way_alone(flying):
    rig = flying()  # its PLND_TYPE was 0 at boot

    async def go(job: Any) -> None:
        await rig.copter.go_to(job, NedTarget(30.0, 0.0, -8.0), wait=True)

    under_way = rig.begin(go, "/movement/go_to_ned_wait")
    rig.pass_time(2.0)
    for _ in range(2):  # the parameter is right after the first, and still nothing that the autopilot has read
        assert "reboot" in str(rig.outcome(rig.land(method="landing_target")))
    assert rig.outcome(under_way) == "done"
    assert rig.truth.north == pytest.approx(30, abs=1.5)


def test_a_landing_that_takes_over_stops_what_was_flown(flying):
    rig = flying(sim_tags=FAR_TAG)

    async def drive(job: Any) -> None:
        await rig.copter.travel(job, VelocityTarget(0.0, 3.0, 0.0), duration=20)

    rig.begin(drive, "/movement/travel")
    rig.pass_time(2.0)
    add_tag_id = rig.tracker.add_tag_id

    async def slowly(number: int) -> None:
        await asyncio.sleep(2.0)
        await add_tag_id(number)

    rig.tracker.add_tag_id = slowly
    mark = len(rig.wire.sent)
    rig.land()
    rig.pass_time(0.2)
    reported = sent(rig, "SET_POSITION_TARGET_LOCAL_NED", mark)
    assert reported
    assert (reported[-1].vx, reported[-1].vy, reported[-1].vz) == (0, 0, 0)


# -- another vehicle -------------------------------------------------------------------------------------------


def other_vehicle(rig: Any) -> None:
    """A second copter on the link, parked elsewhere and turned round."""
    encode, decode = mavlink.MAVLink(None, srcSystem=2, srcComponent=1), mavlink.MAVLink(None)
    count = [0]

    def say() -> None:
        count[0] += 1
        if count[0] % 40:
            return
        at = int((rig.loop.time() - 900) * 1000)
        for message in (
            mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3),
            mavlink.MAVLink_attitude_message(at, 0, 0, math.radians(173), 0, 0, 0),
            mavlink.MAVLink_local_position_ned_message(at, 40, 30, 0, 0, 0, 0),
            mavlink.MAVLink_global_position_int_message(at, 0, 0, 0, 0, 0, 0, 0, 0),
        ):
            for decoded in decode.parse_buffer(message.pack(encode)):
                rig.host._receive(decoded)

    rig.each_step.append(say)


def test_a_change_of_mavproxys_vehicle_does_not_change_who_lands(flying):
    rig = flying(sim_tags=FAR_TAG)
    other_vehicle(rig)
    job = rig.land()
    rig.pass_time(1.5)
    rig.host.registry.current = 2
    result = rig.outcome(job)
    assert str(result).startswith("Landed on tag 0"), result
    assert math.hypot(rig.truth.north - 1.6, rig.truth.east + 1.2) < 0.2
    assert {m.target_system for m in sent(rig, "SET_POSITION_TARGET_LOCAL_NED")} == {1}


def test_vehicle_of_the_setting_lands_whichever_is_mavproxys(flying):
    rig = flying(sim_tags=FAR_TAG, vehicle=1)
    other_vehicle(rig)
    rig.host.registry.current = 2
    rig.pass_time(1.5)
    assert (rig.tracker.carrier.system, rig.tracker.carrier.vehicle().state.system, rig.copter.state.system) == (
        1,
        1,
        1,
    )
    result = rig.outcome(rig.land())
    assert str(result).startswith("Landed on tag 0"), result
