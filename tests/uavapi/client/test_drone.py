"""The client's verbs and properties, at the real application."""

from __future__ import annotations

import math
from typing import Any

import pytest

from mavproxy_uavapi.client import Drone, Fleet, Ned, Position, Unreachable, connect, connect_fleet
from mavproxy_uavapi.client.errors import error_of
from mavproxy_uavapi.core.errors import (
    Aborted,
    Invalid,
    ModeChanged,
    NotArmed,
    OutsideEnvelope,
    Stale,
    Superseded,
    UavApiError,
)
from mavproxy_uavapi.http.callers.call import Service
from tests.support.virtual_time import FastLoop


def test_properties_are_what_the_vehicle_reports(ours: Drone, flying: Any, loop: FastLoop) -> None:
    loop.pass_time(0.5)
    assert ours.id == 1
    assert ours.position.alt == pytest.approx(20, abs=0.5)
    assert (ours.armed, ours.mode, ours.is_connected) == (True, "GUIDED", True)
    assert ours.heading == pytest.approx(0, abs=1)
    assert ours.ned.down == pytest.approx(-20, abs=0.5)
    assert 0 <= ours.velocity.length < 1


def test_property_that_is_too_old_raises(ours: Drone, flying: Any, loop: FastLoop) -> None:
    flying.power_off()
    loop.pass_time(6.0)
    with pytest.raises(Stale, match="GLOBAL_POSITION_INT"):
        _ = ours.position
    assert not ours.is_connected


def test_message_that_was_never_reported_is_stale(ours: Drone) -> None:
    with pytest.raises(Stale, match="not reported"):
        ours.telemetry.fields("RANGEFINDER")


def test_other_components_of_the_system_do_not_count(ours: Drone) -> None:
    before = ours.position
    ours.telemetry.hear("HEARTBEAT", 154, {"autopilot": 8, "type": 26, "base_mode": 0, "custom_mode": 0})
    ours.telemetry.hear("GLOBAL_POSITION_INT", 154, {"lat": 0, "lon": 0, "relative_alt": 0})
    assert (ours.position, ours.armed) == (before, True)


def test_go_to_is_done_on_arrival(ours: Drone, loop: FastLoop) -> None:
    loop.pass_time(0.5)
    target = ours.position + Ned(30, 10, -5)
    loop.run(ours.go_to(target, heading=10))
    loop.pass_time(0.5)
    assert ours.position.distance(target) < 1.8


def test_cancelled_movement_ends_and_the_vehicle_stops(
    ours: Drone, flying: Any, loop: FastLoop, service: Service
) -> None:
    loop.pass_time(0.5)
    going = loop.create_task(ours.go_to(ours.position + Ned(1000, 0, 0)))
    loop.pass_time(2.0)
    assert service.host.jobs.running()
    going.cancel()
    loop.pass_time(5.0)
    assert going.cancelled()
    assert not service.host.jobs.running()
    last = flying.setpoints()[-1]
    assert (last.vx, last.vy, last.vz) == (0, 0, 0)


@pytest.mark.parametrize(("before", "heading"), [(1.0, 359.0), (359.0, 1.0)])
def test_heading_across_north_is_reached_the_short_way(
    ours: Drone, flying: Any, loop: FastLoop, before: float, heading: float
) -> None:
    flying.yaw = math.radians(before)
    loop.pass_time(1.0)
    started = loop.time()
    loop.run(ours.turn_to(heading))
    assert abs((ours.heading - heading + 180.0) % 360.0 - 180.0) <= 5.0
    assert loop.time() - started < 5.0


def test_velocity_is_kept_until_it_is_cancelled(ours: Drone, flying: Any, loop: FastLoop) -> None:
    travelling = loop.create_task(ours.travel(Ned(2, 0, 0)))
    loop.pass_time(20.0)
    assert not travelling.done()
    assert {setpoint.vx for setpoint in flying.setpoints()[1:]} == {2}
    travelling.cancel()
    loop.pass_time(3.0)
    assert flying.setpoints()[-1].vx == 0


def test_velocity_with_a_duration_ends(ours: Drone, flying: Any, loop: FastLoop) -> None:
    loop.run(ours.travel_body(1, 0, duration=2.0))
    assert [setpoint.vx for setpoint in flying.setpoints()][-2:] == [1, 0]  # it points north


def test_command_is_that_of_the_newest_movement(ours: Drone, loop: FastLoop) -> None:
    assert loop.run(ours.command()) is None
    travelling = loop.create_task(ours.travel(Ned(2, 0, 0), 60.25))
    loop.pass_time(1.0)
    command = loop.run(ours.command())
    assert command is not None and (command.verb, command.request["duration"]) == ("/movement/travel_at_ned", 60.25)
    travelling.cancel()


def test_check_says_why_a_movement_would_be_refused_and_moves_nothing(
    ours: Drone, flying: Any, loop: FastLoop
) -> None:
    loop.run(ours.check(ours.position))
    with pytest.raises(OutsideEnvelope, match="away"):
        loop.run(ours.check(Position(0.0, 0.0, 10.0)))
    assert flying.setpoints() == []


def test_landing_ends_disarmed(ours: Drone, loop: FastLoop) -> None:
    loop.run(ours.land())
    assert ours.armed is False


def test_cancelled_landing_is_aborted_on_the_vehicle(
    ours: Drone, flying: Any, loop: FastLoop, service: Service
) -> None:
    landing = loop.create_task(ours.land())
    loop.pass_time(3.0)
    assert ours.mode == "LAND"
    landing.cancel()
    loop.pass_time(6.0)
    assert landing.cancelled()
    assert isinstance(service.host.jobs.all()[0].error, Aborted)
    assert flying.mode == "BRAKE"


def test_newer_movement_supersedes(ours: Drone, loop: FastLoop) -> None:
    loop.pass_time(0.5)
    first = loop.create_task(ours.go_to(ours.position + Ned(500, 0, 0)))
    loop.pass_time(1.0)
    loop.run(ours.go_to(ours.position + Ned(0, 5, 0)))
    assert isinstance(first.exception(), Superseded)


def test_pilots_switch_is_an_error_of_its_own(ours: Drone, flying: Any, loop: FastLoop) -> None:
    loop.pass_time(0.5)
    going = loop.create_task(ours.go_to(ours.position + Ned(500, 0, 0)))
    loop.pass_time(1.0)
    flying.mode = "LOITER"
    loop.pass_time(2.0)
    assert isinstance(going.exception(), ModeChanged)


def test_value_out_of_range_is_invalid(ours: Drone, loop: FastLoop) -> None:
    with pytest.raises(Invalid, match="heading"):
        loop.run(ours.go_to(ours.position, heading=400))


def test_status_says_what_a_pilot_wants_to_know(ours: Drone, loop: FastLoop) -> None:
    status = loop.run(ours.status())
    assert (status.kind, status.mode, status.armed, status.link_alive) == ("copter", "GUIDED", True, True)


def test_nothing_at_the_address_is_unreachable(loop: FastLoop) -> None:
    async def connecting() -> None:
        async with connect("http://127.0.0.1:9", "", timeout=1.0):
            pass

    with pytest.raises(Unreachable, match="127.0.0.1:9"):
        loop.run(connecting())


def test_verb_on_the_ground_says_why_not(loop: FastLoop, url: str, drone: Any) -> None:
    async def flight() -> None:
        async with connect(url, "") as ours:
            await ours.takeoff(5)

    with pytest.raises(NotArmed):
        loop.run(flight())


def test_fleet_is_by_system_id(loop: FastLoop, url: str, flying: Any) -> None:
    async def two(*urls: str) -> list[int]:
        async with connect_fleet(*urls, token="") as fleet:
            assert isinstance(fleet, Fleet)
            return [fleet[system].id for system in fleet]

    assert loop.run(two(url)) == [1]
    with pytest.raises(ValueError, match="same vehicle"):
        loop.run(two(url, url))


def test_errors_keep_the_autopilots_texts() -> None:
    error = error_of(500, {"detail": "refused", "code": "rejected", "ack": "DENIED", "statustext": ["PreArm: no"]})
    assert (error.ack, error.statustext) == ("DENIED", ["PreArm: no"])  # type: ignore[attr-defined]
    assert type(error_of(418, {"detail": "tea", "code": "teapot"})) is UavApiError
    assert type(error_of(409, {"detail": "old", "code": "superseded"})) is Superseded
