"""Takeoffs at the worst moment, in virtual time: two at once, one that is stopped or deleted, movements in one."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.world import World

pytestmark = pytest.mark.matrix

TAKEOFF, PAUSE = mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_DO_PAUSE_CONTINUE
FAR = {"x": 300, "y": 0, "z": -8}


@pytest.mark.parametrize("after", [0.0, 0.02, 0.1, 0.5, 1.0, 1.5, 2.0, 3.0])
def test_two_takeoffs_at_once_agree_on_one_height(on_ground: World, after: float) -> None:
    first = on_ground.begin("GET", "/command/takeoff?alt=10")
    if after:
        on_ground.pass_time(after)
    second = on_ground.begin("GET", "/command/takeoff?alt=20")
    outcomes = on_ground.answer(first).outcome, on_ground.answer(second).outcome
    on_ground.pass_time(15.0)
    assert outcomes in {("200", "409 busy"), ("409 superseded", "200")}
    assert -on_ground.at[2] == pytest.approx(10 if outcomes[0] == "200" else 20, abs=1.0)


@pytest.mark.parametrize("after", [0.1, 0.3, 1.0, 1.5, 1.6, 1.7, 1.8, 1.9, 2.0, 2.5])
@pytest.mark.parametrize("acks", ["come", "are lost"])
def test_second_takeoff_is_busy_as_soon_as_the_first_is_sent(on_ground: World, after: float, acks: str) -> None:
    if acks == "are lost":
        on_ground.fault("lose_acks", command=TAKEOFF)
    first = on_ground.begin("GET", "/command/takeoff?alt=10")
    on_ground.pass_time(after)
    assert on_ground.ask("GET", "/command/takeoff?alt=20").outcome == "409 busy"
    assert on_ground.answer(first).outcome == "200"
    assert -on_ground.at[2] == pytest.approx(10, abs=1.0)


def test_lease_of_a_takeoff_acts_though_a_second_one_was_asked_for(on_ground: World) -> None:
    first = on_ground.begin("GET", "/command/takeoff?alt=60&lease=5&client=first")
    on_ground.pass_time(1.8)
    assert on_ground.ask("GET", "/command/takeoff?alt=65&client=second").outcome == "409 busy"
    assert on_ground.answer(first).outcome == "409 aborted"
    on_ground.pass_time(10.0)
    assert -on_ground.at[2] < 20.0
    assert math.hypot(*on_ground.copter.body.velocity) < 0.3


def test_takeoff_stopped_on_the_ground_may_be_replaced_by_another(on_ground: World) -> None:
    first = on_ground.begin("GET", "/command/takeoff?alt=10")
    on_ground.pass_time(0.5)
    assert on_ground.ask("GET", "/movement/stop").outcome == "200"
    assert on_ground.ask("GET", "/command/takeoff?alt=5").outcome == "200"
    assert on_ground.answer(first).outcome == "409 superseded"
    assert -on_ground.at[2] == pytest.approx(5, abs=0.5)


@pytest.mark.parametrize("alt", [0.1, 0.3, 0.5])
def test_takeoff_to_less_than_its_tolerance_is_not_done_on_the_ground(on_ground: World, alt: float) -> None:
    assert on_ground.ask("GET", f"/command/takeoff?alt={alt}").outcome == "200"
    assert not on_ground.copter.on_ground
    assert -on_ground.at[2] == pytest.approx(alt, abs=0.3)


def test_takeoff_after_one_that_was_refused_takes_off(on_ground: World) -> None:
    on_ground.fault("refuse", command=TAKEOFF, result=4, text="no", count=1)
    assert on_ground.ask("GET", "/command/takeoff?alt=10").outcome == "500 rejected"
    assert on_ground.ask("GET", "/command/takeoff?alt=5").outcome == "200"


@pytest.mark.parametrize("after", [0.0, 0.02, 0.06, 0.3, 0.8, 1.5, 2.0, 2.5])
def test_takeoff_that_is_deleted_stays_below_two_metres(on_ground: World, after: float) -> None:
    requested = on_ground.ask("GET", "/command/takeoff?alt=20&wait=false")
    if after:
        on_ground.pass_time(after)
    on_ground.ask("DELETE", requested.headers["location"])
    on_ground.pass_time(10.0)
    assert -on_ground.at[2] < 4.0
    assert math.hypot(*on_ground.copter.body.velocity) < 0.3


def test_takeoff_deleted_before_it_lifts_off_is_paused_and_the_pause_ends(on_ground: World) -> None:
    requested = on_ground.ask("GET", "/command/takeoff?alt=20&wait=false")
    on_ground.pass_time(0.5)
    since = on_ground.now
    on_ground.ask("DELETE", requested.headers["location"])
    orders = on_ground.orders(since - 0.001)
    pauses = [m.param1 for m in orders if m.get_type() == "COMMAND_LONG" and m.command == PAUSE]
    assert orders[0].get_type() == "COMMAND_LONG"
    assert pauses == [0, 1]
    assert on_ground.ask("GET", "/command/takeoff?alt=5").outcome == "200"


def test_deleted_takeoff_with_its_first_hold_lost_holds_all_the_same(on_ground: World) -> None:
    requested = on_ground.ask("GET", "/command/takeoff?alt=20&wait=false")
    on_ground.pass_time(0.5)
    on_ground.fault("drop", message="SET_POSITION_TARGET_LOCAL_NED", count=2)
    on_ground.ask("DELETE", requested.headers["location"])
    on_ground.pass_time(10.0)
    assert -on_ground.at[2] < 4.0


MOVEMENTS = {
    "/movement/go_to_ned": {"x": 30, "y": 0, "z": -20},
    "/movement/travel_at_ned": {"vx": 8, "vy": 0, "vz": 0, "duration": 6},
    "/movement/travel_at_body": {"front": 8, "right": 0, "down": 0},
    "/movement/set_heading": {"heading": 90},
    "/movement/set_yaw_rate": {"yaw_rate": 30},
}


def hangs_up(world: World) -> None:
    """The client of a takeoff hangs up in its climb."""
    climbing = world.begin("GET", "/command/takeoff?alt=20")
    world.pass_time(3.0)
    climbing.hang_up()
    world.pass_time(0.2)


def another_station_takes_off(world: World) -> None:
    world.pilot_command(TAKEOFF, 0, 0, 0, 0, 0, 0, 20)
    world.pass_time(3.2)


def takes_too_long(world: World) -> None:
    """The timeout of a takeoff passes in its climb."""
    assert world.ask("GET", "/command/takeoff?alt=20&timeout=3").outcome == "504 timeout"


def guided_supersedes_it(world: World) -> None:
    """`guided` supersedes the job of a takeoff, which goes on."""
    climbing = world.begin("GET", "/command/takeoff?alt=20")
    world.pass_time(3.2)
    assert world.ask("GET", "/command/guided").outcome == "200"
    assert world.answer(climbing).outcome == "409 superseded"


@pytest.mark.parametrize("path", MOVEMENTS)
@pytest.mark.parametrize("stage", [hangs_up, another_station_takes_off, takes_too_long, guided_supersedes_it])
def test_movement_in_a_takeoff_that_no_job_flies_is_busy(
    on_ground: World, stage: Callable[[Any], None], path: str
) -> None:
    stage(on_ground)
    since = on_ground.now
    method = "GET" if "heading" in path or "yaw" in path else "POST"
    query = "?" + "&".join(f"{name}={value}" for name, value in MOVEMENTS[path].items()) if method == "GET" else ""
    reply = on_ground.ask(method, path + query, None if query else MOVEMENTS[path])
    assert reply.outcome == "409 busy"
    assert on_ground.orders(since) == []
    on_ground.pass_time(20.0)
    assert -on_ground.at[2] == pytest.approx(20, abs=0.5)
    assert on_ground.ask("POST", "/movement/go_to_ned_wait", {"x": 5, "y": 0, "z": -20}).outcome == "200"


def test_no_movement_goes_out_between_the_ground_and_the_end_of_a_takeoff(on_ground: World) -> None:
    climbing = on_ground.begin("GET", "/command/takeoff?alt=20")
    on_ground.pass_time(0.5)
    climbing.hang_up()
    for _ in range(200):
        on_ground.pass_time(0.1)
        if on_ground.ask("POST", "/movement/travel_at_ned", {"vx": 8, "vy": 0, "vz": 0}).outcome != "409 busy":
            break
    assert -on_ground.at[2] > 19.0


def test_movement_while_a_takeoff_is_stopped_is_paused(on_ground: World) -> None:
    on_ground.begin("GET", "/command/takeoff?alt=20")
    on_ground.pass_time(4.0)
    assert on_ground.ask("GET", "/movement/stop").outcome == "200"
    assert on_ground.ask("POST", "/movement/go_to_ned", FAR).outcome == "409 paused"


def test_movement_after_a_takeoff_that_its_pilot_has_ended_is_flown(on_ground: World) -> None:
    """The last report of the takeoff is from before the pilot's mode."""
    climbing = on_ground.begin("GET", "/command/takeoff?alt=20")
    on_ground.pass_time(5.0)
    on_ground.hears = lambda message: message.get_type() != "EXTENDED_SYS_STATE"
    on_ground.in_mode("LOITER")
    assert on_ground.answer(climbing).outcome == "409 mode_changed"
    assert on_ground.ask("GET", "/command/guided").outcome == "200"
    assert on_ground.ask("POST", "/movement/go_to_ned", FAR).outcome == "200"
