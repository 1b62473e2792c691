"""Commands at the worst moment, in virtual time: each asked when another one is half done."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.files import rehearsals
from tests.support.faulty_link import every
from tests.support.make_world import MakeWorld
from tests.support.world import PLACE, World

pytestmark = pytest.mark.matrix

ARM, PAUSE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_PAUSE_CONTINUE
MODE = mavlink.MAV_CMD_DO_SET_MODE
GO = "/movement/go_to_ned_wait"
FAR = {"x": 300, "y": 0, "z": -8}
TRACK_ROW = "(1, {}, {}, 590000, 0, 65535, 0, 0, 3, 10)"
TRACK = {"track": TRACK_ROW.format(*(round(degrees * 1e7) for degrees in PLACE)), "ground": 584}


@pytest.fixture
def cold(make_world: MakeWorld) -> World:
    """Disarmed in STABILIZE, its estimator not ready for 30 s."""

    def stage(world: World) -> None:
        world.boot()
        world.fault("ekf_bad", seconds=30.0)
        world.simulator.run(1.0)

    return make_world(stage)


def speed(world: World) -> float:
    return math.hypot(*world.copter.body.velocity)


def test_arm_against_a_disarm_on_its_way_is_busy(on_ground: World) -> None:
    disarm = on_ground.begin("GET", "/command/disarm")
    on_ground.pass_time(0.03)
    assert on_ground.ask("GET", "/command/arm").outcome == "409 busy"
    assert on_ground.answer(disarm).outcome == "200"
    assert not on_ground.copter.armed


# -- an arm that waits ------------------------------------------------------------------------------------


def test_arm_on_its_way_is_undone_by_the_closing_message(make_world: MakeWorld) -> None:
    world = make_world(World.boot)
    world.in_mode("GUIDED")
    world.pass_time(3.0)
    world.begin("GET", "/command/arm")
    world.until(lambda: any(getattr(message, "command", None) == ARM for message in world.orders()))

    async def unload() -> list[Any]:
        world.host.jobs.abort_remote("the API is stopping")
        return [message for message, _ in world.host.endings.closing_messages()]

    (message,) = world.run(unload())
    assert (message.command, message.param1) == (ARM, 0)


@pytest.mark.parametrize("verb", ["disarm", "land", "rtl", "brake"])
def test_what_stops_ends_an_arm_that_waits(cold: World, verb: str) -> None:
    waiting = cold.begin("GET", "/command/arm")
    cold.loop.pass_time(3.0)
    cold.begin("GET", f"/command/{verb}")
    cold.loop.pass_time(60.0)
    assert not cold.copter.armed
    assert cold.answer(waiting).outcome == "409 superseded"


@pytest.mark.parametrize("verb", ["arm", "track"])
@pytest.mark.parametrize("dark", [0.5, 4.0])
def test_arm_that_waits_does_not_outlive_a_reboot(make_world: MakeWorld, verb: str, dark: float) -> None:
    """Who changes the battery stands beside the vehicle."""

    def unready(world: World) -> None:
        world.boot()
        world.simulator.run(20.0)
        world.fault("ekf_bad", seconds=6.0)
        world.simulator.run(1.0)

    world = make_world(unready)
    arm = world.begin("GET", "/command/arm") if verb == "arm" else world.begin("POST", "/mission/fly-track", TRACK)
    world.pass_time(3.0)
    world.reboot(dark)
    assert world.answer(arm).outcome == "409 not_armed"
    world.pass_time(20.0)
    assert not world.copter.armed


@pytest.mark.parametrize("verb", ["arm", "track"])
def test_arm_that_waits_leaves_a_vehicle_alone_that_another_station_arms(make_world: MakeWorld, verb: str) -> None:
    """It is in GUIDED already: the track would take off under the hands of whoever has armed it."""

    def unready(world: World) -> None:
        world.boot()
        world.in_mode("GUIDED")
        world.hears = lambda message: message.get_type() != "SYS_STATUS"  # which tells that it is ready

    world = make_world(unready)
    arm = world.begin("GET", "/command/arm") if verb == "arm" else world.begin("POST", "/mission/fly-track", TRACK)
    world.pass_time(3.0)
    world.pilot_command(ARM, 1)
    assert world.answer(arm, 5.0).outcome == "409 mode_changed"
    world.pass_time(5.0)
    assert world.copter.armed and world.at[2] > -0.1 and world.orders(world.now - 5.0) == []


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.06, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.7, 2.1, 2.6])
@pytest.mark.parametrize("slow", [None, MODE, ARM])
def test_pilots_switch_between_any_two_messages_of_arm_keeps_his_mode(
    make_world: MakeWorld, delay: float, slow: int | None
) -> None:
    world = make_world(lambda world: world.boot())
    if slow is not None:
        world.fault("delay_acks", command=slow, seconds=1.0)
    waiting = world.begin("GET", "/command/arm")
    world.pass_time(delay)
    world.fault("pilot_mode", mode="ALT_HOLD")
    reply = world.answer(waiting)
    world.pass_time(3.0)
    assert world.copter.mode.name == "ALT_HOLD" or reply.outcome == "200" and not delay
    if reply.outcome != "200":
        assert reply.outcome == "409 mode_changed"


# -- stop -------------------------------------------------------------------------------------------------


def test_stop_of_a_takeoff_that_spools_up_keeps_it_down_until_resume(on_ground: World) -> None:
    climbing = on_ground.begin("GET", "/command/takeoff?alt=10")
    on_ground.pass_time(0.5)
    assert on_ground.ask("GET", "/movement/stop").outcome == "200"
    on_ground.pass_time(5.0)
    assert -on_ground.at[2] < 1.0
    assert on_ground.ask("GET", "/movement/resume").outcome == "200"
    assert on_ground.answer(climbing).outcome == "200"
    assert -on_ground.at[2] == pytest.approx(10, abs=0.6)


def test_stop_in_a_climb_and_land_after_it_lands(on_ground: World) -> None:
    climbing = on_ground.begin("GET", "/command/takeoff?alt=10")
    on_ground.pass_time(4.0)
    assert on_ground.ask("GET", "/movement/stop").outcome == "200"
    assert on_ground.ask("GET", "/command/land").outcome == "200"
    assert on_ground.answer(climbing).outcome == "409 superseded"


def test_movement_that_is_deleted_in_a_pause_does_not_go_on_after_it(world: World) -> None:
    requested = world.ask("POST", GO + "?wait=false", FAR)
    world.pass_time(2.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    world.ask("DELETE", requested.headers["location"])
    world.pass_time(1.0)
    world.ask("GET", "/movement/resume")
    world.pass_time(3.0)
    before = world.at
    world.pass_time(5.0)
    assert math.dist(before, world.at) < 1.0


@pytest.mark.parametrize("somebody_rehearses", [False, True])
def test_stop_whose_client_hangs_up_stops(
    world: World, monkeypatch: pytest.MonkeyPatch, *, somebody_rehearses: bool
) -> None:
    monkeypatch.setattr(rehearsals, "is_under_way", lambda: somebody_rehearses)
    world.begin("POST", GO, FAR)
    world.pass_time(2.0)
    stopping = world.begin("GET", "/movement/stop")
    stopping.hang_up()
    world.pass_time(5.0)
    assert speed(world) < 0.3
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"


def test_two_stops_and_one_resume(world: World) -> None:
    going = world.begin("POST", GO, {"x": 40, "y": 0, "z": -8})
    world.pass_time(2.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    assert world.ask("GET", "/movement/stop").outcome == "200"
    assert world.ask("GET", "/movement/resume").outcome == "200"
    assert world.answer(going).outcome == "200"


def test_second_stop_during_the_first_keeps_the_movement(world: World) -> None:
    going = world.begin("POST", GO, {"x": 60, "y": 0, "z": -8})
    world.pass_time(2.0)
    first = world.begin("GET", "/movement/stop")
    world.pass_time(0.05)
    second = world.begin("POST", "/fleet/stop", {"vehicles": [1]})
    assert {world.answer(first).outcome, world.answer(second).outcome} <= {"200", "409 superseded"}
    assert world.ask("GET", "/movement/resume").outcome == "200"
    assert world.answer(going).outcome == "200"


def test_job_of_a_stop_that_is_deleted_leaves_the_vehicle_still(world: World) -> None:
    going = world.begin("POST", GO, FAR)
    world.pass_time(2.0)
    requested = world.ask("GET", "/movement/stop?wait=false")
    world.ask("DELETE", requested.headers["location"])
    world.pass_time(5.0)
    assert speed(world) < 0.3
    going.hang_up()


def test_refused_stop_is_reported_and_the_movement_goes_on(world: World) -> None:
    going = world.begin("POST", GO, {"x": 40, "y": 0, "z": -8})
    world.pass_time(1.0)
    world.fault("refuse", command=PAUSE, result=4, text="no", count=1)
    assert world.ask("GET", "/movement/stop").outcome == "500 rejected"
    assert world.answer(going).outcome == "200"


def test_stop_whose_acks_are_lost_stops(world: World) -> None:
    world.begin("POST", GO, FAR)
    world.pass_time(2.0)
    world.fault("lose_acks", command=PAUSE)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    world.pass_time(2.0)
    assert speed(world) < 0.3
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"


def test_stop_that_never_reaches_the_vehicle_does_not_say_that_it_stopped(world: World) -> None:
    world.begin("POST", GO, FAR)
    world.pass_time(2.0)
    world.fault("drop", message="COMMAND_LONG", command=PAUSE)
    reply = world.ask("GET", "/movement/stop")
    assert reply.outcome != "200"


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_guided_after_a_stop_whose_zero_velocity_is_lost_does_not_fly_on(world: World, lost: int) -> None:
    stopped_on_its_way(world)
    world.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED", count=lost)
    before = world.at
    assert world.ask("GET", "/command/guided").outcome == "200"
    world.pass_time(10.0)
    assert math.dist(before, world.at) < 1.0


def test_guided_after_a_stop_that_is_lost_leaves_it_stopped(world: World) -> None:
    stopped_on_its_way(world)
    world.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED")
    before = world.at
    assert world.ask("GET", "/command/guided").outcome == "504 timeout"
    world.pass_time(10.0)
    assert math.dist(before, world.at) < 1.0
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"


@pytest.mark.parametrize("after", [0.1, 0.5, 1.0, 2.0])
def test_pilot_who_switches_while_guided_ends_a_stop_gets_nothing_more(world: World, after: float) -> None:
    stopped_on_its_way(world)
    world.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED")
    ending = world.begin("GET", "/command/guided")
    world.pass_time(after)
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(1.2)
    since = world.now
    world.pass_time(10.0)
    assert world.answer(ending).outcome == "409 mode_changed"
    assert world.orders(since) == []
    assert world.copter.mode.name == "LOITER"


def stopped_on_its_way(world: World) -> None:
    """It goes far away, and `stop` holds it on the way."""
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "200"
    world.pass_time(5.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"


# -- landings ---------------------------------------------------------------------------------------------


def test_guided_against_a_land_on_its_way_is_busy_and_it_lands(world: World) -> None:
    world.fault("drop", message="COMMAND_LONG", command=MODE, count=2)
    landing = world.begin("GET", "/command/land")
    world.pass_time(0.5)
    assert world.ask("GET", "/command/guided").outcome == "409 busy"
    assert world.answer(landing).outcome == "200"


def test_rtl_superseded_by_land_while_every_second_message_is_lost_lands(world: World) -> None:
    lossy(world)
    returning = world.begin("GET", "/command/rtl")
    world.pass_time(0.3)
    landing = world.begin("GET", "/command/land")
    assert world.answer(landing).outcome == "200"
    assert world.answer(returning).outcome in {"409 superseded", "409 mode_changed"}
    assert not world.copter.armed
    assert world.copter.mode.name == "LAND"


def lossy(world: World) -> None:
    """Lose every second message to the vehicle."""
    loses = every(2)
    world.reaches = lambda _message: loses()


@pytest.mark.parametrize(("first", "then"), list(itertools.permutations(["land", "rtl", "brake"], 2)))
@pytest.mark.parametrize("after", [0.0, 0.05, 1.0])
def test_the_newer_of_two_that_stop_wins(world: World, first: str, then: str, after: float) -> None:
    older = world.begin("GET", f"/command/{first}")
    if after:
        world.pass_time(after)
    newer = world.begin("GET", f"/command/{then}")
    assert world.answer(newer).outcome == "200"
    assert world.copter.mode.name == then.upper()
    is_done = {"200"} if first == "brake" else set()  # in BRAKE as soon as a heartbeat shows it
    assert world.answer(older).outcome in {"409 superseded", "409 mode_changed"} | is_done


def test_landing_deleted_before_its_mode_shows_ends_in_brake_or_hold(world: World) -> None:
    world.fault("delay_acks", command=MODE, seconds=0.5)
    requested = world.ask("GET", "/command/land?wait=false")
    world.pass_time(0.05)
    world.ask("DELETE", requested.headers["location"])
    world.pass_time(10.0)
    assert world.copter.armed
    assert abs(world.at[2] + 8) < 1.5
    assert world.copter.mode.name in {"GUIDED", "BRAKE"}


# -- others -----------------------------------------------------------------------------------------------


def test_job_that_a_delete_began_may_be_deleted_and_the_vehicle_stays(world: World) -> None:
    requested = world.ask("POST", GO + "?wait=false", FAR)
    world.pass_time(3.0)
    deleting = world.begin("DELETE", requested.headers["location"])
    for _ in range(5):
        world.pass_time(0.1)
        running = [job for job in world.ask("GET", "/jobs").body["jobs"] if job["state"] == "running"]
        for job in running:
            world.begin("DELETE", f"/jobs/{job['job']}")
    world.pass_time(8.0)
    assert speed(world) < 0.3
    assert [job["verb"] for job in world.ask("GET", "/jobs").body["jobs"] if job["state"] == "running"] == []
    assert world.answer(deleting).outcome == "200"


def test_pilot_who_takes_over_and_gives_back_ends_the_movement_for_good(world: World) -> None:
    going = world.begin("POST", GO, FAR)
    world.pass_time(2.0)
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(0.1)
    world.fault("pilot_mode", mode="GUIDED")
    reply = world.answer(going, 200)
    assert reply.outcome in {"409 mode_changed", "409 superseded"}


def test_hold_after_a_delete_gives_way_to_the_pilot(world: World) -> None:
    requested = world.ask("POST", GO + "?wait=false", FAR)
    world.pass_time(3.0)
    world.begin("DELETE", requested.headers["location"])
    world.pass_time(0.3)
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(1.5)
    since = world.now
    world.pass_time(5.0)
    assert world.orders(since) == []
    assert world.copter.mode.name == "LOITER"


def test_forced_disarm_goes_before_a_landing_on_its_way(world: World) -> None:
    world.fault("drop", message="COMMAND_LONG", command=MODE, count=2)
    world.begin("GET", "/command/land")
    world.pass_time(0.1)
    assert world.ask("GET", "/command/disarm?force=true").outcome == "200"
    assert not world.copter.armed
