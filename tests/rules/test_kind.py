"""The kind of a vehicle: a copter's first heartbeats after a boot have type 0. What was begun or promised stays."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.roles import THE_PROMPT
from tests.support.make_world import MakeWorld
from tests.support.world import World

mavlink = mavutil.mavlink
READINESS = {"EKF_STATUS_REPORT", "SYS_STATUS"}
PLANE = mavlink.MAV_TYPE_FIXED_WING


class Ears:
    """What the host hears.

    Attributes:
        kind: the type that heartbeats have; None for the vehicle's own.
        deaf_to: names of messages that get lost.
    """

    def __init__(self, world: World) -> None:
        self.kind: int | None = None
        self.deaf_to: set[str] = set()
        world.hears = self

    def __call__(self, message: Any) -> bool:
        if message.get_type() == "HEARTBEAT" and self.kind is not None:
            message.type = self.kind
        return message.get_type() not in self.deaf_to


def ears(world: World) -> Ears:
    """Those that the world got."""
    assert isinstance(world.hears, Ears)
    return world.hears


@pytest.fixture
def world(make_world: MakeWorld) -> World:
    world = make_world(lambda world: world.boot())
    Ears(world)
    return world


def waiting_arm(world: World) -> Any:
    """A client's `arm` of a vehicle that does not say that it is ready."""
    ears(world).deaf_to |= READINESS
    for name in READINESS:
        world.host.fleet.vehicles[1].messages.pop(name, None)
    arm = world.begin("GET", "/command/arm")
    world.pass_time(2.0)
    assert not arm.reply.done()
    return arm


def reboot(world: World) -> None:
    """The autopilot reboots; for 2 s it does not know its frame."""
    ears(world).kind = mavlink.MAV_TYPE_GENERIC
    world.reboot(1.0)
    world.pass_time(3.0)
    ears(world).kind = None
    world.pass_time(2.0)


def become(world: World, kind: int | None) -> None:
    ears(world).kind = kind
    world.pass_time(2.0)


def test_reboot_leaves_a_copter_what_it_is(world: World) -> None:
    before = world.host.registry.find(1)
    reboot(world)
    assert world.host.registry.find(1) is before


@pytest.mark.parametrize("happens", [reboot, lambda world: become(world, PLANE)])
def test_disarm_ends_an_arm_that_began_before(world: World, happens: Any) -> None:
    arm = waiting_arm(world)
    happens(world)
    assert world.ask("GET", "/command/disarm").status == 200
    assert world.answer(arm).outcome == "409 superseded"
    ears(world).deaf_to.clear()
    world.pass_time(8.0)
    assert not world.vehicle.armed


@pytest.mark.parametrize("happens", [reboot, lambda world: become(world, PLANE)])
def test_hold_lasts(world: World, happens: Any) -> None:
    world.host.leases.take_hold(world.host.registry.find(1), THE_PROMPT, 0)
    happens(world)
    (report,) = world.ask("GET", "/authority").body["vehicles"]
    assert report["held_by"] == THE_PROMPT.name
    assert world.ask("GET", "/command/arm").outcome == "409 busy"


def test_lease_of_a_hold_still_ends(world: World) -> None:
    assert world.ask("POST", "/authority/take", {"lease": 10}).status == 200
    become(world, PLANE)
    (report,) = world.ask("GET", "/vehicles").body["vehicles"]
    assert report["type"] == "plane" and report["held_by"] is not None
    world.pass_time(11.0)
    (report,) = world.ask("GET", "/vehicles").body["vehicles"]
    assert report["held_by"] is None


def test_vehicle_that_is_stopped_stays_so(make_world: MakeWorld) -> None:
    world = make_world()
    Ears(world)
    assert world.ask("GET", "/movement/stop").status == 200
    become(world, PLANE)
    assert world.ask("GET", "/vehicles/1").body["type"] == "plane"
    become(world, None)
    assert world.ask("POST", "/movement/go_to_ned", {"x": 50, "y": 0, "z": -8}).outcome == "409 paused"
