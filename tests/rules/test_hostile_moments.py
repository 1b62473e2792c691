"""Commands at the worst moment, in virtual time: each asked when another one is half done."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.vehicle.messages import FORCE_DISARM
from tests.support.world import PLACE

ARM, TAKEOFF, PAUSE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF, 193
MODE = mavlink.MAV_CMD_DO_SET_MODE
GO = "/movement/go_to_ned_wait"
FAR = {"x": 300, "y": 0, "z": -8}


@pytest.fixture
def world(make_world: Any) -> Any:
    return make_world()


@pytest.fixture
def on_ground(make_world: Any) -> Any:
    """Armed in GUIDED."""
    return make_world(lambda world: world.armed())


@pytest.fixture
def cold(make_world: Any) -> Any:
    """Disarmed in STABILIZE, its estimator not ready for 30 s."""

    def stage(world: Any) -> None:
        world.boot()
        world.fault("ekf_bad", seconds=30.0)
        world.simulator.run(1.0)

    return make_world(stage)


def speed(world: Any) -> float:
    return math.hypot(*world.copter.body.velocity)


# -- an arm that waits ------------------------------------------------------------------------------------


@pytest.mark.parametrize("verb", ["disarm", "land", "rtl", "brake"])
def test_what_stops_ends_an_arm_that_waits(cold: Any, verb: str) -> None:
    waiting = cold.begin("GET", "/command/arm")
    cold.loop.pass_time(3.0)
    cold.begin("GET", f"/command/{verb}")
    cold.loop.pass_time(60.0)
    assert not cold.copter.armed
    assert cold.answer(waiting).outcome == "409 superseded"


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.06, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.7, 2.1, 2.6])
@pytest.mark.parametrize("slow", [None, MODE, ARM])
def test_pilots_switch_between_any_two_messages_of_arm_keeps_his_mode(
    make_world: Any, delay: float, slow: int | None
) -> None:
    world = make_world(lambda world: world.boot())
    if slow is not None:
        world.fault("delay_acks", command=slow, seconds=1.0)
    waiting = world.begin("GET", "/command/arm")
    world.loop.pass_time(delay)
    world.fault("pilot_mode", mode="ALT_HOLD")
    reply = world.answer(waiting)
    world.loop.pass_time(3.0)
    assert world.copter.mode.name == "ALT_HOLD" or reply.outcome == "200" and not delay
    if reply.outcome != "200":
        assert reply.outcome == "409 mode_changed"


# -- stop -------------------------------------------------------------------------------------------------


def test_stop_while_a_takeoff_spools_up_keeps_it_down_and_resume_finishes_it(on_ground: Any) -> None:
    climbing = on_ground.begin("GET", "/command/takeoff?alt=10")
    on_ground.loop.pass_time(0.5)
    assert on_ground.ask("GET", "/movement/stop").outcome == "200"
    on_ground.loop.pass_time(5.0)
    assert -on_ground.at[2] < 1.0
    assert on_ground.ask("GET", "/movement/resume").outcome == "200"
    assert on_ground.answer(climbing).outcome == "200"
    assert -on_ground.at[2] == pytest.approx(10, abs=0.6)


def test_stop_in_a_climb_and_land_after_it_lands(on_ground: Any) -> None:
    climbing = on_ground.begin("GET", "/command/takeoff?alt=10")
    on_ground.loop.pass_time(4.0)
    assert on_ground.ask("GET", "/movement/stop").outcome == "200"
    assert on_ground.ask("GET", "/command/land").outcome == "200"
    assert on_ground.answer(climbing).outcome == "409 superseded"


def test_movement_that_is_deleted_in_a_pause_does_not_go_on_after_it(world: Any) -> None:
    requested = world.ask("POST", GO + "?wait=false", FAR)
    world.loop.pass_time(2.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    world.ask("DELETE", requested.headers["location"])
    world.loop.pass_time(1.0)
    world.ask("GET", "/movement/resume")
    world.loop.pass_time(3.0)
    before = world.at
    world.loop.pass_time(5.0)
    assert math.dist(before, world.at) < 1.0


def test_stop_whose_client_hangs_up_stops(world: Any) -> None:
    world.begin("POST", GO, FAR)
    world.loop.pass_time(2.0)
    stopping = world.begin("GET", "/movement/stop")
    stopping.hang_up()
    world.loop.pass_time(5.0)
    assert speed(world) < 0.3
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"


def test_two_stops_and_one_resume(world: Any) -> None:
    going = world.begin("POST", GO, {"x": 40, "y": 0, "z": -8})
    world.loop.pass_time(2.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    assert world.ask("GET", "/movement/stop").outcome == "200"
    assert world.ask("GET", "/movement/resume").outcome == "200"
    assert world.answer(going).outcome == "200"


def test_second_stop_requested_while_the_first_is_on_its_way_keeps_the_movement(world: Any) -> None:
    going = world.begin("POST", GO, {"x": 60, "y": 0, "z": -8})
    world.loop.pass_time(2.0)
    first = world.begin("GET", "/movement/stop")
    world.loop.pass_time(0.05)
    second = world.begin("GET", "/movement/stop?again=1")
    assert {world.answer(first).outcome, world.answer(second).outcome} <= {"200", "409 superseded"}
    assert world.ask("GET", "/movement/resume").outcome == "200"
    assert world.answer(going).outcome == "200"


def test_job_of_a_stop_that_is_deleted_leaves_the_vehicle_still(world: Any) -> None:
    going = world.begin("POST", GO, FAR)
    world.loop.pass_time(2.0)
    requested = world.ask("GET", "/movement/stop?wait=false")
    world.ask("DELETE", requested.headers["location"])
    world.loop.pass_time(5.0)
    assert speed(world) < 0.3
    going.hang_up()


def test_stop_that_the_vehicle_refuses_is_reported_and_the_movement_goes_on(world: Any) -> None:
    going = world.begin("POST", GO, {"x": 40, "y": 0, "z": -8})
    world.loop.pass_time(1.0)
    world.fault("refuse", command=PAUSE, result=4, text="no", count=1)
    assert world.ask("GET", "/movement/stop").outcome == "500 rejected"
    assert world.answer(going).outcome == "200"


def test_stop_whose_acks_are_lost_stops(world: Any) -> None:
    world.begin("POST", GO, FAR)
    world.loop.pass_time(2.0)
    world.fault("lose_acks", command=PAUSE)
    assert world.ask("GET", "/movement/stop").outcome == "200"
    world.loop.pass_time(2.0)
    assert speed(world) < 0.3
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"


def test_stop_that_never_reaches_the_vehicle_does_not_say_that_it_stopped(world: Any) -> None:
    world.begin("POST", GO, FAR)
    world.loop.pass_time(2.0)
    world.fault("drop", message="COMMAND_LONG", command=PAUSE)
    reply = world.ask("GET", "/movement/stop")
    assert reply.outcome != "200"


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_guided_after_a_stop_whose_zero_velocity_is_lost_does_not_fly_on(world: Any, lost: int) -> None:
    stopped_on_its_way(world)
    world.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED", count=lost)
    before = world.at
    assert world.ask("GET", "/command/guided").outcome == "200"
    world.loop.pass_time(10.0)
    assert math.dist(before, world.at) < 1.0


def test_guided_after_a_stop_whose_zero_velocities_are_all_lost_leaves_it_stopped(world: Any) -> None:
    stopped_on_its_way(world)
    world.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED")
    before = world.at
    assert world.ask("GET", "/command/guided").outcome == "504 timeout"
    world.loop.pass_time(10.0)
    assert math.dist(before, world.at) < 1.0
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"


@pytest.mark.parametrize("after", [0.1, 0.5, 1.0, 2.0])
def test_pilot_who_switches_while_guided_ends_a_stop_gets_nothing_more(world: Any, after: float) -> None:
    stopped_on_its_way(world)
    world.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED")
    ending = world.begin("GET", "/command/guided")
    world.loop.pass_time(after)
    world.fault("pilot_mode", mode="LOITER")
    world.loop.pass_time(1.2)
    since = world.loop.time()
    world.loop.pass_time(10.0)
    assert world.answer(ending).outcome == "409 mode_changed"
    assert world.orders(since) == []
    assert world.copter.mode.name == "LOITER"


def stopped_on_its_way(world: Any) -> None:
    """It goes far away, and `stop` holds it on the way."""
    assert world.ask("POST", "/movement/go_to_ned", FAR).outcome == "200"
    world.loop.pass_time(5.0)
    assert world.ask("GET", "/movement/stop").outcome == "200"


# -- landings ---------------------------------------------------------------------------------------------


def test_guided_against_a_land_on_its_way_is_busy_and_it_lands(world: Any) -> None:
    world.fault("drop", message="COMMAND_LONG", command=MODE, count=2)
    landing = world.begin("GET", "/command/land")
    world.loop.pass_time(0.5)
    assert world.ask("GET", "/command/guided").outcome == "409 busy"
    assert world.answer(landing).outcome == "200"


def test_rtl_superseded_by_land_while_every_second_message_is_lost_lands(world: Any) -> None:
    lossy(world)
    returning = world.begin("GET", "/command/rtl")
    world.loop.pass_time(0.3)
    landing = world.begin("GET", "/command/land")
    assert world.answer(landing).outcome == "200"
    assert world.answer(returning).outcome in {"409 superseded", "409 mode_changed"}
    assert not world.copter.armed
    assert world.copter.mode.name == "LAND"


def lossy(world: Any) -> None:
    """Lose every second message to the vehicle."""
    deliver, number = world._deliver, 0

    def every_second(message: Any) -> None:
        nonlocal number
        number += 1
        if number % 2 == 0:
            deliver(message)

    world._deliver = every_second


@pytest.mark.parametrize(("first", "then"), list(itertools.permutations(["land", "rtl", "brake"], 2)))
@pytest.mark.parametrize("after", [0.0, 0.05, 1.0])
def test_the_newer_of_two_that_stop_wins(world: Any, first: str, then: str, after: float) -> None:
    older = world.begin("GET", f"/command/{first}")
    if after:
        world.loop.pass_time(after)
    newer = world.begin("GET", f"/command/{then}")
    assert world.answer(newer).outcome == "200"
    assert world.copter.mode.name == then.upper()
    is_done = {"200"} if first == "brake" else set()  # in BRAKE as soon as a heartbeat shows it
    assert world.answer(older).outcome in {"409 superseded", "409 mode_changed"} | is_done


def test_deleting_a_landing_before_its_mode_is_shown_ends_in_brake_or_guided_hold(world: Any) -> None:
    world.fault("delay_acks", command=MODE, seconds=0.5)
    requested = world.ask("GET", "/command/land?wait=false")
    world.loop.pass_time(0.05)
    world.ask("DELETE", requested.headers["location"])
    world.loop.pass_time(10.0)
    assert world.copter.armed
    assert abs(world.at[2] + 8) < 1.5
    assert world.copter.mode.name in {"GUIDED", "BRAKE"}


# -- take-offs --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("after", [0.0, 0.02, 0.1, 0.5, 1.0, 1.5, 2.0, 3.0])
def test_two_takeoffs_at_once_agree_on_one_height(on_ground: Any, after: float) -> None:
    first = on_ground.begin("GET", "/command/takeoff?alt=10")
    if after:
        on_ground.loop.pass_time(after)
    second = on_ground.begin("GET", "/command/takeoff?alt=20")
    outcomes = on_ground.answer(first).outcome, on_ground.answer(second).outcome
    on_ground.loop.pass_time(15.0)
    assert outcomes in {("200", "409 busy"), ("409 superseded", "200")}
    assert -on_ground.at[2] == pytest.approx(10 if outcomes[0] == "200" else 20, abs=1.0)


@pytest.mark.parametrize("after", [0.1, 0.3, 1.0, 1.5, 1.6, 1.7, 1.8, 1.9, 2.0, 2.5])
@pytest.mark.parametrize("acks", ["come", "are lost"])
def test_second_takeoff_is_busy_as_soon_as_the_first_is_sent(on_ground: Any, after: float, acks: str) -> None:
    if acks == "are lost":
        on_ground.fault("lose_acks", command=TAKEOFF)
    first = on_ground.begin("GET", "/command/takeoff?alt=10")
    on_ground.loop.pass_time(after)
    assert on_ground.ask("GET", "/command/takeoff?alt=20").outcome == "409 busy"
    assert on_ground.answer(first).outcome == "200"
    assert -on_ground.at[2] == pytest.approx(10, abs=1.0)


def test_lease_of_a_takeoff_acts_though_another_client_has_asked_for_a_second_one(on_ground: Any) -> None:
    first = on_ground.begin("GET", "/command/takeoff?alt=60&lease=5&client=first")
    on_ground.loop.pass_time(1.8)
    assert on_ground.ask("GET", "/command/takeoff?alt=65&client=second").outcome == "409 busy"
    assert on_ground.answer(first).outcome == "409 aborted"
    on_ground.loop.pass_time(10.0)
    assert -on_ground.at[2] < 20.0
    assert speed(on_ground) < 0.3


def test_takeoff_that_is_stopped_on_the_ground_may_be_replaced_by_another_one(on_ground: Any) -> None:
    first = on_ground.begin("GET", "/command/takeoff?alt=10")
    on_ground.loop.pass_time(0.5)
    assert on_ground.ask("GET", "/movement/stop").outcome == "200"
    assert on_ground.ask("GET", "/command/takeoff?alt=5").outcome == "200"
    assert on_ground.answer(first).outcome == "409 superseded"
    assert -on_ground.at[2] == pytest.approx(5, abs=0.5)


@pytest.mark.parametrize("alt", [0.1, 0.3, 0.5])
def test_takeoff_to_less_than_its_tolerance_is_not_done_on_the_ground(on_ground: Any, alt: float) -> None:
    assert on_ground.ask("GET", f"/command/takeoff?alt={alt}").outcome == "200"
    assert not on_ground.copter.on_ground
    assert -on_ground.at[2] == pytest.approx(alt, abs=0.3)


def test_takeoff_after_one_that_was_refused_takes_off(on_ground: Any) -> None:
    on_ground.fault("refuse", command=TAKEOFF, result=4, text="no", count=1)
    assert on_ground.ask("GET", "/command/takeoff?alt=10").outcome == "500 rejected"
    assert on_ground.ask("GET", "/command/takeoff?alt=5").outcome == "200"


@pytest.mark.parametrize("after", [0.0, 0.02, 0.06, 0.3, 0.8, 1.5, 2.0, 2.5])
def test_takeoff_that_is_deleted_stays_below_two_metres(on_ground: Any, after: float) -> None:
    requested = on_ground.ask("GET", "/command/takeoff?alt=20&wait=false")
    if after:
        on_ground.loop.pass_time(after)
    on_ground.ask("DELETE", requested.headers["location"])
    on_ground.loop.pass_time(10.0)
    assert -on_ground.at[2] < 4.0
    assert speed(on_ground) < 0.3


def test_takeoff_that_is_deleted_before_it_lifts_off_is_paused_first_and_the_pause_ends(on_ground: Any) -> None:
    requested = on_ground.ask("GET", "/command/takeoff?alt=20&wait=false")
    on_ground.loop.pass_time(0.5)
    since = on_ground.loop.time()
    on_ground.ask("DELETE", requested.headers["location"])
    orders = on_ground.orders(since - 0.001)
    pauses = [m.param1 for m in orders if m.get_type() == "COMMAND_LONG" and m.command == PAUSE]
    assert orders[0].get_type() == "COMMAND_LONG"
    assert pauses == [0, 1]
    assert on_ground.ask("GET", "/command/takeoff?alt=5").outcome == "200"


def test_takeoff_that_is_deleted_with_its_first_hold_lost_holds_all_the_same(on_ground: Any) -> None:
    requested = on_ground.ask("GET", "/command/takeoff?alt=20&wait=false")
    on_ground.loop.pass_time(0.5)
    on_ground.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED", count=2)
    on_ground.ask("DELETE", requested.headers["location"])
    on_ground.loop.pass_time(10.0)
    assert -on_ground.at[2] < 4.0


MOVEMENTS = {
    "/movement/go_to_ned": {"x": 30, "y": 0, "z": -20},
    "/movement/travel_at_ned": {"vx": 8, "vy": 0, "vz": 0, "duration": 6},
    "/movement/travel_at_body": {"front": 8, "right": 0, "down": 0},
    "/movement/set_heading": {"heading": 90},
    "/movement/set_yaw_rate": {"yaw_rate": 30},
}


def hangs_up(world: Any) -> None:
    """The client of a takeoff hangs up in its climb."""
    climbing = world.begin("GET", "/command/takeoff?alt=20")
    world.loop.pass_time(3.0)
    climbing.hang_up()
    world.loop.pass_time(0.2)


def another_station_takes_off(world: Any) -> None:
    world.pilot_command(TAKEOFF, 0, 0, 0, 0, 0, 0, 20)
    world.loop.pass_time(3.2)


def takes_too_long(world: Any) -> None:
    """The timeout of a takeoff passes in its climb."""
    assert world.ask("GET", "/command/takeoff?alt=20&timeout=3").outcome == "504 timeout"


def guided_supersedes_it(world: Any) -> None:
    """`guided` supersedes the job of a takeoff, which goes on."""
    climbing = world.begin("GET", "/command/takeoff?alt=20")
    world.loop.pass_time(3.2)
    assert world.ask("GET", "/command/guided").outcome == "200"
    assert world.answer(climbing).outcome == "409 superseded"


@pytest.mark.parametrize("path", MOVEMENTS)
@pytest.mark.parametrize("stage", [hangs_up, another_station_takes_off, takes_too_long, guided_supersedes_it])
def test_movement_in_a_takeoff_that_no_job_flies_is_busy(
    on_ground: Any, stage: Callable[[Any], None], path: str
) -> None:
    stage(on_ground)
    since = on_ground.loop.time()
    method = "GET" if "heading" in path or "yaw" in path else "POST"
    query = "?" + "&".join(f"{name}={value}" for name, value in MOVEMENTS[path].items()) if method == "GET" else ""
    reply = on_ground.ask(method, path + query, None if query else MOVEMENTS[path])
    assert reply.outcome == "409 busy"
    assert on_ground.orders(since) == []
    on_ground.loop.pass_time(20.0)
    assert -on_ground.at[2] == pytest.approx(20, abs=0.5)
    assert on_ground.ask("POST", "/movement/go_to_ned_wait", {"x": 5, "y": 0, "z": -20}).outcome == "200"


def test_no_movement_goes_out_between_the_ground_and_the_end_of_a_takeoff(on_ground: Any) -> None:
    climbing = on_ground.begin("GET", "/command/takeoff?alt=20")
    on_ground.loop.pass_time(0.5)
    climbing.hang_up()
    for _ in range(200):
        on_ground.loop.pass_time(0.1)
        if on_ground.ask("POST", "/movement/travel_at_ned", {"vx": 8, "vy": 0, "vz": 0}).outcome != "409 busy":
            break
    assert -on_ground.at[2] > 19.0


def test_movement_while_a_takeoff_is_stopped_is_paused(on_ground: Any) -> None:
    on_ground.begin("GET", "/command/takeoff?alt=20")
    on_ground.loop.pass_time(4.0)
    assert on_ground.ask("GET", "/movement/stop").outcome == "200"
    assert on_ground.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"


def test_job_that_a_delete_began_may_be_deleted_and_the_vehicle_stays(world: Any) -> None:
    requested = world.ask("POST", GO + "?wait=false", FAR)
    world.loop.pass_time(3.0)
    deleting = world.begin("DELETE", requested.headers["location"])
    for _ in range(5):
        world.loop.pass_time(0.1)
        running = [job for job in world.ask("GET", "/jobs").body["jobs"] if job["state"] == "running"]
        for job in running:
            world.begin("DELETE", f"/jobs/{job['job']}")
    world.loop.pass_time(8.0)
    assert speed(world) < 0.3
    assert [job["verb"] for job in world.ask("GET", "/jobs").body["jobs"] if job["state"] == "running"] == []
    assert world.answer(deleting).outcome == "200"


# -- the end of a mission ---------------------------------------------------------------------------------


def on_the_way(world: Any, *, lands: bool = False) -> Any:
    """A request for a mission of a waypoint far away, and of a landing there; it waits for the end."""
    items = [{"command": "NAV_WAYPOINT", "lat": PLACE[0] + 0.004, "long": PLACE[1], "alt": 30}]
    if lands:
        items = [{"command": "NAV_LAND", "lat": PLACE[0], "long": PLACE[1], "alt": 0}]
    assert world.ask("POST", "/mission/waypoints", {"items": items}).outcome == "200"
    waiting = world.begin("POST", "/mission/start", {"until_complete": True})
    world.loop.pass_time(4.0)
    assert not waiting.reply.done()
    return waiting


def kill(world: Any) -> None:
    world.pilot_command(ARM, 0, FORCE_DISARM)


def boots(world: Any) -> None:
    world.reboot(1.5)


@pytest.fixture
def high(make_world: Any) -> Any:
    return make_world(lambda world: world.flying(height=30.0))


@pytest.mark.parametrize("end", [kill, boots])
@pytest.mark.parametrize("lands", [False, True])
def test_vehicle_that_loses_its_motors_in_the_last_item_of_its_mission_has_not_completed_it(
    high: Any, end: Callable[[Any], None], lands: bool
) -> None:
    waiting = on_the_way(high, lands=lands)
    end(high)
    assert high.answer(waiting).outcome == "409 not_armed"


def test_mission_that_lands_is_complete_when_it_stands_disarmed(high: Any) -> None:
    waiting = on_the_way(high, lands=True)
    assert high.answer(waiting).outcome == "200"
    assert not high.copter.armed
    assert high.at[2] == pytest.approx(0.0, abs=0.1)


def test_mission_whose_last_item_is_a_waypoint_is_complete_there(high: Any) -> None:
    waiting = on_the_way(high)
    assert high.answer(waiting).outcome == "200"
    assert high.copter.armed
    assert high.at[0] > 430.0


# -- others -----------------------------------------------------------------------------------------------


def test_pilot_who_takes_over_and_gives_back_ends_the_movement_for_good(world: Any) -> None:
    going = world.begin("POST", GO, FAR)
    world.loop.pass_time(2.0)
    world.fault("pilot_mode", mode="LOITER")
    world.loop.pass_time(0.1)
    world.fault("pilot_mode", mode="GUIDED")
    reply = world.answer(going, 200)
    assert reply.outcome in {"409 mode_changed", "409 superseded"}


def test_hold_after_a_delete_gives_way_to_the_pilot(world: Any) -> None:
    requested = world.ask("POST", GO + "?wait=false", FAR)
    world.loop.pass_time(3.0)
    world.begin("DELETE", requested.headers["location"])
    world.loop.pass_time(0.3)
    world.fault("pilot_mode", mode="LOITER")
    world.loop.pass_time(1.5)
    since = world.loop.time()
    world.loop.pass_time(5.0)
    assert world.orders(since) == []
    assert world.copter.mode.name == "LOITER"


def test_forced_disarm_goes_before_a_landing_on_its_way(world: Any) -> None:
    world.fault("drop", message="COMMAND_LONG", command=MODE, count=2)
    world.begin("GET", "/command/land")
    world.loop.pass_time(0.1)
    assert world.ask("GET", "/command/disarm?force=true").outcome == "200"
    assert not world.copter.armed
