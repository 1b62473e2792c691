"""Where a plane, a QuadPlane or a rover is when a test begins; the stages of a copter are methods of `World`."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.geodesy import Ned, from_ned
from mavproxy_uavapi.sim.mission import Item
from tests.support.world import World

RELATIVE = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
CLIMBING = 15.0  # s in which a plane reaches TKOFF_ALT
HOVER = 15.0  # m
DRIVING = 4.0  # s in which a rover gathers speed


def cruising(world: World, mode: str = "GUIDED") -> None:
    """A plane that circles at TKOFF_ALT, 50 m."""
    world.boot()
    world.in_mode("TAKEOFF")
    world.by_hand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    world.simulator.run(CLIMBING)
    assert world.vehicle.flying
    hold_mission(world)
    world.in_mode("GUIDED")
    if mode != "GUIDED":
        world.in_mode(mode)


def armed_with_mission(world: World) -> None:
    """Armed on the ground, in GUIDED; a plane holds a mission that ends with a landing."""
    world.armed()
    if world.kind == "plane":
        hold_mission(world)


def held(world: World) -> None:
    """A rover that stands armed in HOLD."""
    world.armed()
    world.in_mode("HOLD")


def driven_away(world: World) -> None:
    """A rover that stands armed in GUIDED, 30 m north of home."""
    world.armed()
    world.vehicle.guided.go_to(Ned(30.0, 0.0, 0.0))
    world.simulator.run(20.0)
    assert abs(world.at[0] - 30.0) < 3.0


def hovering(world: World) -> None:
    """A QuadPlane that hovers 15 m above home."""
    world.armed()
    world.by_hand(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, HOVER)
    world.simulator.run(20.0)
    assert abs(world.at[2] + HOVER) < 1.0


def on_mission(world: World) -> None:
    """A plane or rover on its way to a place 1 km north, in AUTO; the mission ends with a landing sequence."""
    if world.vehicle.mav_type == mavlink.MAV_TYPE_GROUND_ROVER:
        world.armed()
    else:
        cruising(world)
    hold_mission(world)
    world.in_mode("AUTO")
    world.by_hand(mavlink.MAV_CMD_MISSION_START)
    world.simulator.run(DRIVING)


def hold_mission(world: World) -> None:
    """Give it a mission: two places 1 km north and one landing sequence."""
    items = [item(world, mavlink.MAV_CMD_NAV_WAYPOINT, north, 0.0, 60.0) for north in (0.0, 1000.0, 1100.0)]
    if world.vehicle.mav_type != mavlink.MAV_TYPE_GROUND_ROVER:
        items += landing_sequence(world)
    world.vehicle.mission.items[:] = items


def landing_sequence(world: World) -> list[Item]:
    """DO_LAND_START, an approach from the north, and a landing at home."""
    return [
        Item(mavlink.MAV_CMD_DO_LAND_START, RELATIVE, 0, 0, 0, 0, 0, 0, 0),
        item(world, mavlink.MAV_CMD_NAV_WAYPOINT, 400.0, 0.0, 40.0),
        item(world, mavlink.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0),
    ]


def item(world: World, command: int, north: float, east: float, height: float) -> Item:
    """A mission item at a place: m north and east of where the vehicle booted, and above home."""
    place = from_ned(world.vehicle.estimator.start, Ned(north, east, 0.0))
    return Item(command, RELATIVE, 0, 0, 0, 0, round(place.latitude * 1e7), round(place.longitude * 1e7), height)
