"""Vehicles of one MAVProxy keep their distance, whoever commands them; pilots are left alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace.expected_way import expected
from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE
from mavproxy_uavapi.core.roles import THE_PROMPT
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.rules.test_envelope import put
from tests.support.crossing_flights import APART, Fleet
from tests.support.envelopes import field, place
from tests.support.virtual_time import FastLoop
from tests.support.world import item_at

SEPARATION = 8.0  # m
WPL_ITEM = "{}\t{}\t{}\t16\t0\t0\t0\t0\t{}\t{}\t{}\t1\n"
ORDERS = {"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT"}


@pytest.fixture
def make(loop: FastLoop) -> Iterator[Callable[..., Fleet]]:
    """Makes a fleet with some settings."""
    loop.set_default_executor(AtOnce())
    fleets: list[Fleet] = []

    def made(count: int = 2, vehicle: str = "copter", apart: float = APART, **settings: Any) -> Fleet:
        fleets.append(Fleet(loop, count, settings, SEPARATION, vehicle, apart))
        return fleets[-1]

    yield made
    for fleet in fleets:
        fleet.close()


@pytest.fixture
def pair(make: Callable[..., Fleet]) -> Fleet:
    """Two copters, 15 m apart, 10 m above the ground; the second is east of the first."""
    return make(2, separation=SEPARATION)


def to(north: float, east: float, alt: float = 10.0) -> dict[str, Any]:
    lat, lon = place(north, east)
    return {"lat": lat, "long": lon, "alt": alt}


def orders(fleet: Fleet) -> list[Any]:
    return [sent.message for sent in fleet.world.sent if sent.message.get_type() in ORDERS]


def mode(fleet: Fleet, system: int) -> str:
    return str(fleet.world.simulators[system - 1].copter.mode.name)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_random_crossing_flights_never_come_nearer_than_the_setting(make: Callable[..., Fleet], seed: int) -> None:
    fleet = make(4, separation=SEPARATION)
    fleet.fly_at_random(40.0, seed)
    fleet.loop.pass_time(45.0)
    assert (fleet.breaches, fleet.nearest >= SEPARATION) == (0, True)
    assert fleet.outcomes["200"] >= 5


def test_without_the_setting_the_same_flights_come_too_near(make: Callable[..., Fleet]) -> None:
    fleet = make(4)
    fleet.fly_at_random(40.0, 1)
    fleet.loop.pass_time(45.0)
    assert fleet.breaches > 0


def test_way_through_a_hovering_vehicle_is_refused_and_nothing_sent(pair: Fleet) -> None:
    reply = pair.ask(1, "movement/go_to_gps", to(0, 40))
    assert reply.outcome == "409 too_near"
    assert reply.body["near"]["vehicle"] == 2 and reply.body["near"]["at"]["alt"] == pytest.approx(10, abs=0.5)
    assert "vehicle 2" in reply.body["detail"] and orders(pair) == []
    assert pair.ask(1, "movement/go_to_gps", to(0, 40, 45)).outcome == "200"  # climbs past it


def test_a_velocity_and_a_takeoff_count_too(pair: Fleet) -> None:
    assert pair.ask(1, "movement/travel_at_ned", {"vx": 0, "vy": 4, "vz": 0}).outcome == "409 too_near"
    assert pair.ask(1, "movement/travel_at_ned", {"vx": 0, "vy": -4, "vz": 0}).outcome == "200"
    assert pair.ask(2, "command/land").outcome == "200"
    assert pair.ask(1, "movement/stop").outcome == "200" and pair.ask(1, "command/guided").outcome == "200"
    assert pair.ask(1, "movement/go_to_gps_wait", to(0, APART, 12)).outcome == "200"  # it has landed: no traffic
    assert pair.ask(2, "command/arm").outcome == "200"
    assert pair.ask(2, "command/takeoff", {"alt": 10}).outcome == "409 too_near"


def test_a_crossing_that_comes_much_later_is_allowed(pair: Fleet) -> None:
    second = pair.begin(2, "movement/go_to_gps_wait", to(30, APART))
    assert pair.ask(1, "movement/go_to_gps", to(30, APART)).outcome == "409 too_near"
    far = pair.ask(1, "movement/go_to_gps_wait", to(-150, 0))
    assert far.outcome == "200" and pair.world.answer(second).outcome == "200"
    assert pair.nearest >= SEPARATION


def test_a_vehicle_that_turns_back_counts_as_far_as_it_is_carried(pair: Fleet) -> None:
    assert pair.ask(1, "movement/go_to_gps", to(80, 0)).outcome == "200"
    pair.loop.pass_time(5.0)
    assert pair.ask(1, "movement/go_to_gps", to(-80, 0)).outcome == "200"
    turned_at = pair.at(pair.world.simulators[0])[0]
    path, _ = expected(pair.world.host.registry.find(1), 1.0)
    carried_to = path.ends[0]
    carried = (carried_to[0] - place(0, 0)[0]) * METRES_PER_DEGREE
    farthest = 0.0
    for _ in range(100):
        pair.loop.pass_time(0.05)
        farthest = max(farthest, pair.at(pair.world.simulators[0])[0])
    assert farthest > turned_at + 5.0
    assert 1.0 < (carried - turned_at) / (farthest - turned_at) < 1.6  # the model brakes with a share in hand


def test_with_wait_a_command_has_its_turn_when_the_way_is_free(make: Callable[..., Fleet]) -> None:
    fleet = make(2, separation=SEPARATION, on_conflict="wait")
    waiting = fleet.begin(1, "movement/go_to_gps_wait", to(0, APART))
    fleet.loop.pass_time(2.0)
    assert not waiting.reply.done() and orders(fleet) == []
    (job,) = fleet.world.ask("GET", "/vehicles/1/jobs").body["jobs"]
    assert job["progress"] == {"waits_for_vehicle": 2}
    assert fleet.ask(2, "movement/go_to_gps_wait", to(40, APART)).outcome == "200"
    assert fleet.world.answer(waiting).outcome == "200"
    assert fleet.nearest >= SEPARATION


def test_a_newer_command_ends_the_wait(make: Callable[..., Fleet]) -> None:
    fleet = make(2, separation=SEPARATION, on_conflict="wait")
    waiting = fleet.begin(1, "movement/go_to_gps_wait", to(0, APART))
    fleet.loop.pass_time(1.0)
    assert fleet.ask(1, "command/brake").outcome == "200"
    assert fleet.world.answer(waiting).outcome == "409 superseded"
    assert fleet.ask(2, "movement/go_to_gps_wait", to(40, APART)).outcome == "200"
    assert mode(fleet, 1) == "BRAKE"


def test_who_waits_for_ever_is_refused(make: Callable[..., Fleet]) -> None:
    fleet = make(2, separation=SEPARATION, on_conflict="wait")
    reply = fleet.ask(1, "movement/go_to_gps_wait", to(0, APART))
    assert reply.outcome == "409 too_near" and orders(fleet) == []


def test_a_vehicle_that_falls_silent_may_be_anywhere_on_its_way(pair: Fleet) -> None:
    assert pair.ask(2, "movement/go_to_gps", to(60, APART)).outcome == "200"
    pair.loop.pass_time(0.5)
    second = pair.world.simulators[1]
    second.faults.silence(second.vehicle.now, math.inf, sending=True, receiving=False)
    pair.loop.pass_time(30.0)  # it has long arrived
    reply = pair.ask(1, "movement/go_to_gps", to(30, APART + 5))
    assert reply.outcome == "409 too_near" and "s old" in reply.body["detail"]


def of_another_station(system: int, north: float, east: float) -> Any:
    lat, lon = place(north, east)
    return mavlink.MAVLink_set_position_target_global_int_message(
        0, system, 1, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 0b110111111000,
        round(lat * 1e7), round(lon * 1e7), 10.0, 0, 0, 0, 0, 0, 0, 0, 0,
    )  # fmt: skip


def test_of_two_that_meet_ours_is_held_and_the_other_left_alone(pair: Fleet) -> None:
    assert pair.ask(2, "movement/go_to_gps_wait", to(40, APART)).outcome == "200"
    flight = pair.begin(1, "movement/go_to_gps_wait", to(80, 0))
    pair.loop.pass_time(4.0)
    pair.by_hand(2, of_another_station(2, 40, -40))
    reply = pair.world.answer(flight)
    assert reply.outcome == "409 too_near" and "stopped (BRAKE)" in reply.body["detail"]
    assert pair.ask(1, "command/guided").outcome == "409 busy"  # it does not stand yet
    pair.loop.pass_time(9.0)
    assert mode(pair, 1) == "BRAKE" and mode(pair, 2) == "GUIDED"
    assert pair.stops == 1
    assert pair.ask(1, "command/guided").outcome == "200"


def test_nobody_deletes_the_stop_before_another_vehicle(pair: Fleet) -> None:
    assert pair.ask(2, "movement/go_to_gps_wait", to(40, APART)).outcome == "200"
    flight = pair.begin(1, "movement/go_to_gps_wait", to(80, 0))
    pair.loop.pass_time(4.0)
    pair.by_hand(2, of_another_station(2, 40, -40))
    assert pair.world.answer(flight).outcome == "409 too_near"
    (stop,) = [job for job in pair.world.host.jobs.running() if job.client == "envelope"]
    for _ in range(20):
        if stop.running:
            assert pair.world.ask("DELETE", f"/jobs/{stop.id}").outcome == "409 busy"
        assert pair.ask(1, "movement/go_to_gps", to(80, 0)).status == 409
        pair.loop.pass_time(0.05)
    pair.loop.pass_time(3.0)
    assert mode(pair, 1) == "BRAKE" and pair.nearest > pair.separation - 2


def test_who_returns_is_not_stopped_and_who_moves_in_its_way_is(pair: Fleet) -> None:
    assert pair.ask(2, "movement/go_to_gps_wait", to(60, APART)).outcome == "200"
    returning = pair.begin(2, "command/rtl")
    pair.loop.pass_time(1.0)
    assert pair.ask(1, "movement/go_to_gps", to(30, APART)).outcome == "409 too_near"
    assert pair.world.answer(returning).outcome == "200"
    assert pair.ask(1, "movement/go_to_gps", to(30, APART)).outcome == "200"


def test_a_mission_is_held_against_the_others_before_it_begins(pair: Fleet) -> None:
    rows = [(0, 1, 0, *place(0, 0), 584), (1, 0, 3, *place(0, APART), 10), (2, 0, 3, *place(40, APART), 10)]
    plan = "QGC WPL 110\n" + "".join(WPL_ITEM.format(*row) for row in rows)
    uploaded = pair.world.ask("POST", "/vehicles/1/mission/waypoints", plan.encode(), "text/plain")
    assert uploaded.outcome == "200"
    assert pair.ask(1, "mission/start").outcome == "409 too_near"
    assert mode(pair, 1) == "GUIDED"
    assert pair.ask(2, "movement/go_to_gps_wait", to(-60, APART)).outcome == "200"
    assert pair.ask(1, "mission/start").outcome == "200"


def other_station(fleet: Fleet) -> None:
    fleet.by_hand(1, of_another_station(1, -20.0, 0.0))


def other_operator(fleet: Fleet) -> None:
    fleet.world.host.leases.take_hold(fleet.world.host.registry.find(1), THE_PROMPT, 0)


def pilot_and_back(fleet: Fleet) -> None:
    fleet.world.in_mode("LOITER")
    fleet.world.pass_time(1.5)
    fleet.world.in_mode("GUIDED")


@pytest.mark.parametrize(
    ("other", "outcome"),
    [
        (other_station, "409 superseded"),
        (other_operator, "409 busy"),
        (pilot_and_back, "409 mode_changed"),
        (lambda _: None, "200"),
    ],
)
def test_command_that_waits_ends_when_somebody_else_has_the_vehicle(
    make: Callable[..., Fleet], other: Callable[[Fleet], None], outcome: str
) -> None:
    fleet = make(2, separation=SEPARATION, on_conflict="wait")
    fleet.world.pass_time(1.0)
    going = fleet.begin(1, "movement/go_to_gps_wait", to(0, 30))
    fleet.world.pass_time(3.0)
    before = len(orders(fleet))
    other(fleet)
    fleet.world.pass_time(10.0)
    assert len(orders(fleet)) == before
    assert fleet.ask(2, "movement/go_to_gps_wait", to(60, 15)).outcome == "200"
    assert fleet.world.answer(going).outcome == outcome


def test_the_way_of_a_mission_that_is_flown_counts_for_the_others(pair: Fleet) -> None:
    assert pair.ask(2, "movement/go_to_gps_wait", to(0, 60)).outcome == "200"
    places = [place(0, 0), place(0, 0), place(150, 0), place(150, -100)]
    rows = [(number, int(not number), 3 * bool(number), *at, 10) for number, at in enumerate(places)]
    plan = "QGC WPL 110\n" + "".join(WPL_ITEM.format(*row) for row in rows)
    uploaded = pair.world.ask("POST", "/vehicles/1/mission/waypoints", plan.encode(), "text/plain")
    assert uploaded.outcome == pair.ask(1, "mission/start").outcome == "200"
    pair.loop.pass_time(4.0)
    assert pair.ask(2, "movement/go_to_gps", to(150, 0)).outcome == "409 too_near"


def test_refused_order_does_not_hide_the_way_that_is_flown(pair: Fleet) -> None:
    assert pair.ask(2, "movement/go_to_gps_wait", to(0, 60)).outcome == "200"
    assert pair.ask(1, "movement/go_to_gps", to(200, 0)).outcome == "200"
    pair.loop.pass_time(3.0)
    assert pair.ask(1, "command/set_mode", {"mode": "ZIGZAG"}).outcome == "500 rejected"
    assert pair.ask(2, "movement/go_to_gps", to(150, 0)).outcome == "409 too_near"


def test_vehicle_its_pilot_takes_while_it_waits_for_others_is_left_alone(pair: Fleet) -> None:
    world = pair.world
    for simulator, count in zip(world.simulators, (3, 150), strict=True):
        simulator.copter.mission.items[:] = [item_at(*place(0, 0))] * count
    world.host.registry.traffic.separation = 0
    put(world, field(3000, 3000))  # missions are read before they may be flown
    auto = world.begin("POST", "/fleet/set_mode", {"vehicles": [1, 2], "mode": "AUTO", "all_or_none": True})
    world.pass_time(1.0)
    world.fault("pilot_mode", mode="LOITER")
    world.until(lambda: world.host.registry.find(1).mode == "LOITER", step=0.05)
    reply = world.answer(auto)
    assert reply.body["vehicles"]["1"]["code"] == "mode_changed", reply.body
    assert mode(pair, 1) == "LOITER"


@pytest.mark.long
def test_plane_that_turns_about_is_kept_from_one_circling_beside_it(make: Callable[..., Fleet]) -> None:
    """They came within 40 m: 196 m beside its way it comes back, and the other one flies on its circle for good."""
    planes = make(2, "plane", 400.0, separation=60.0)
    assert planes.ask(2, "movement/go_to_gps", to(700, -185, 50.0)).outcome == "200"
    planes.loop.pass_time(45.0)
    for _ in range(6):  # wherever on its circle it is
        planes.loop.pass_time(4.0)
        way, _any_time = expected(planes.world.host.registry.find(2), 5.0)
        assert list(way.margins) == [0.0, 100.0], "it turns into nothing"
    there = [{**to(north, 0, 50.0), "command": "NAV_WAYPOINT"} for north in (0, 700, 0)]
    assert planes.ask(1, "mission/waypoints", {"items": there}).outcome == "200"
    assert planes.ask(1, "mission/start").outcome == "409 too_near"
    assert (
        planes.ask(1, "mission/waypoints", {"items": [*there[:1], {**there[1], **to(150, 0, 50.0)}]}).outcome == "200"
    )
    assert planes.ask(1, "mission/start").outcome == "200"
