"""While the border's brake is on its way: what others ask for, a lease that runs out, the pilot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import ModeChanged
from mavproxy_uavapi.core.oversight.endings import Policy
from tests.rules.test_envelope import put
from tests.support.envelopes import field
from tests.support.make_world import MakeWorld
from tests.support.world import World

HALF = 60.0  # m
LEASED = "?lease=3&client=a"


def nearing(make_world: MakeWorld) -> World:
    """A copter that flies towards the border, half of the way."""
    world = make_world()
    put(world, field(HALF, 400))
    world.pass_time(3.0)
    world.begin("POST", "/movement/go_to_ned_wait", {"x": 0, "y": 59, "z": -8})
    world.until(lambda: world.at[1] > 36, step=0.05)
    return world


def braking(make_world: MakeWorld, query: str = "") -> World:
    """A copter that the border stops, 0.6 s after that has begun: it does not stand yet."""
    world = nearing(make_world)
    world.begin("POST", f"/movement/go_to_ned_wait{query}", {"x": 50, "y": world.at[1], "z": -8})
    world.until(lambda: protecting(world), step=0.01)
    world.pass_time(0.6)
    assert protecting(world) and speed(world) > 0.5
    return world


def protecting(world: World) -> list[Any]:
    return [job for job in world.host.jobs.running() if job.client == "envelope"]


def speed(world: World) -> float:
    return float(sum(axis**2 for axis in world.copter.body.velocity) ** 0.5)


@pytest.mark.parametrize(
    ("path", "mode"),
    [("/command/land", "LAND"), ("/command/rtl", "RTL"), ("/command/brake", "BRAKE"), ("/movement/stop", "BRAKE")],
)
def test_what_stops_or_lands_it_waits_until_the_border_has_stopped_it(
    make_world: MakeWorld, path: str, mode: str
) -> None:
    world = braking(make_world)
    wire = world.begin("GET", path)
    world.pass_time(0.3)
    assert not wire.reply.done() and world.vehicle.mode.name == "BRAKE"
    world.until(lambda: not protecting(world), step=0.05)
    assert speed(world) < 0.4
    world.until(lambda: wire.reply.done() or world.vehicle.mode.name != "BRAKE", step=0.02)
    assert world.vehicle.mode.name == mode
    assert world.answer(wire).outcome == "200"


def test_stop_does_not_claim_to_stand_after_a_refused_border_stop(make_world: MakeWorld) -> None:
    world = nearing(make_world)
    world.fault("refuse", command=mavlink.MAV_CMD_DO_SET_MODE, result=mavlink.MAV_RESULT_FAILED)
    world.begin("POST", "/movement/go_to_ned_wait", {"x": 50, "y": world.at[1], "z": -8})
    world.until(lambda: protecting(world), step=0.01)
    stop = world.begin("GET", "/movement/stop")
    assert world.answer(stop).outcome != "200" or speed(world) < 0.5
    world.pass_time(5.0)
    assert speed(world) < 0.5


@pytest.mark.parametrize("path", ["/command/guided", "/command/set_mode?mode=AUTO", "/movement/resume"])
def test_what_moves_it_is_busy_until_the_border_has_stopped_it(make_world: MakeWorld, path: str) -> None:
    world = braking(make_world)
    assert world.ask("GET", path).status == 409
    assert world.vehicle.mode.name == "BRAKE" and protecting(world)


@pytest.mark.parametrize("stop", ["/command/land", "/movement/stop"])
@pytest.mark.parametrize("path", ["/command/guided", "/command/set_mode?mode=AUTO"])
def test_what_moves_it_does_not_overtake_a_stop_that_waited_for_the_border(
    make_world: MakeWorld, path: str, stop: str
) -> None:
    world = braking(make_world)
    stopping = world.begin("GET", stop)
    world.until(lambda: not protecting(world), step=0.01)
    assert world.ask("GET", path).outcome == "409 busy"
    assert world.answer(stopping).outcome == "200"


def test_landing_that_waits_for_the_border_leaves_the_vehicle_to_its_pilot(make_world: MakeWorld) -> None:
    world = braking(make_world)
    wire = world.begin("GET", "/command/land")
    world.pass_time(0.1)
    world.fault("pilot_mode", mode="LOITER")
    assert world.answer(wire).outcome == "409 mode_changed"
    assert world.vehicle.mode.name == "LOITER"


@pytest.mark.matrix
@pytest.mark.parametrize("seconds", [0.0, 4.0])
@pytest.mark.parametrize(("policy", "mode"), [(Policy.LAND, "LAND"), (Policy.RTL, "RTL"), (Policy.HOLD, "BRAKE")])
def test_lease_that_runs_out_at_the_border_acts_when_the_vehicle_stands(
    make_world: MakeWorld, policy: Policy, mode: str, seconds: float
) -> None:
    world = braking(make_world, f"?lease={0.5 + seconds:g}&client=a")
    world.host.endings.on_lease_end = policy
    world.until(lambda: not protecting(world), step=0.05)
    assert world.vehicle.mode.name == "BRAKE"
    world.pass_time(seconds + 3.0)
    assert world.vehicle.mode.name == mode


def test_lease_that_runs_out_at_the_border_leaves_the_vehicle_to_its_pilot(make_world: MakeWorld) -> None:
    world = braking(make_world, "?lease=0.5&client=a")
    world.host.endings.on_lease_end = Policy.LAND
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(6.0)
    assert world.vehicle.mode.name == "LOITER"


def test_nobody_ends_the_borders_brake_by_a_delete(make_world: MakeWorld) -> None:
    world = braking(make_world)
    (job,) = protecting(world)
    answer = world.ask("DELETE", f"/jobs/{job.id}")
    assert answer.status == 409 and "protects the vehicle" in answer.body["detail"]
    world.until(lambda: not job.running, step=0.05)
    assert speed(world) < 0.4 and job.error is None


@pytest.mark.parametrize(
    ("deed", "mode"),
    [
        (lambda world: world.fault("pilot_mode", mode="ALT_HOLD"), "ALT_HOLD"),
        (lambda world: world.by_hand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196), "GUIDED"),
    ],
    ids=["switch", "disarming"],
)
def test_border_hears_what_its_pilot_did_since_the_last_heartbeat(
    make_world: MakeWorld, deed: Callable[[World], None], mode: str
) -> None:
    world = nearing(make_world)
    world.begin("POST", "/movement/go_to_ned_wait", {"x": 50, "y": world.at[1], "z": -8})
    world.hears = lambda message: message.get_type() != "HEARTBEAT"
    deed(world)
    world.until(lambda: protecting(world), step=0.01)
    (job,) = protecting(world)
    world.hears = lambda _message: True
    world.pass_time(3.0)
    assert isinstance(job.error, ModeChanged) and world.vehicle.mode.name == mode
