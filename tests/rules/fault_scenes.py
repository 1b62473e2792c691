"""What the fault matrix asks of a vehicle, where the vehicle is then, and what goes wrong."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.store import ALL, API
from mavproxy_uavapi.core.link import messages
from tests.support import stages
from tests.support.envelopes import feature, square
from tests.support.flights import ASKING
from tests.support.world import World

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
NAMED = re.findall(r"mavlink\.(MAV_CMD_\w+)", inspect.getsource(messages))
COMMANDS = sorted({getattr(mavlink, name) for name in NAMED} - ASKING)  # what a verb may send
UNDER_WAY = 3.0  # s after which something happens to a flight
WAITING = 0.5  # s after which something happens to a command that is waiting for its ack
DEAF = 1.0  # s for which the vehicle does not hear that command
STANDS_FOR = 8.0  # s
TOLD_ONCE = ("HOME_POSITION", "PARAM_VALUE", "MISSION_COUNT", "MISSION_ITEM_INT", "STATUSTEXT")
DARK = 2.0  # s that a reboot takes
OVERHEAR = (1, 190)  # another component of the vehicle
CAMERA = {"width": 240, "height": 180, "fps": 8.0, "sim_noise": 0.0, "sim_blur": 0.0, "sim_jitter": 0.0}
TAG_BELOW, TAG_BESIDE = "0:0.30@0.6,-0.4", "0:0.30@0.5,3"  # in view at once, or when it was searched for
PLACE = (-35.363261, 149.165230)  # where it stands: the simulator's default home


class Request(NamedTuple):
    """How a verb is asked for, and where its vehicle is before: far is a flight that is not over soon."""

    stage: str
    near: dict[str, Any] | str
    far: dict[str, Any] | str | None = None
    camera: dict[str, Any] | None = None


def track(north: float) -> str:
    """A track of one place, so many degrees north of home and 10 m above it: CentMesh's tuple."""
    return str((1, round((PLACE[0] + north) * 1e7), round(PLACE[1] * 1e7), 594000, 0, 65535, 0, 0, 3, 10))


REQUESTS = {
    "arm": Request("boot", ""),
    "takeoff": Request("armed", "?alt=4", "?alt=100"),
    "land": Request("flying", "", ""),
    "rtl": Request("flying", "", ""),
    "go_to_ned_wait": Request("flying", {"x": 6, "y": 3, "z": -9}, {"x": 300, "y": 0, "z": -9}),
    "go_to_gps_wait": Request(
        "flying",
        {"lat": PLACE[0] + 6e-5, "long": PLACE[1], "alt": 9},
        {"lat": PLACE[0] + 3e-3, "long": PLACE[1], "alt": 9},
    ),
    "drive_wait": Request("flying", {"x": 6, "y": 3, "z": -1}, {"x": 300, "y": 0, "z": 0}),
    "drive_body_wait": Request("flying", {"front": 6, "right": 3}, {"front": 300, "right": 0}),
    "travel, with duration": Request(
        "flying", {"vx": 1, "vy": 0, "vz": 0, "duration": 5}, {"vx": 1, "vy": 0, "vz": 0, "duration": 60}
    ),
    "travel_at_body, with duration": Request(
        "flying", {"front": 1, "right": 0, "duration": 5}, {"front": 1, "right": 0, "duration": 60}
    ),
    "fly-track": Request("flying", {"track": track(6e-5), "ground": 584}, {"track": track(3e-3), "ground": 584}),
    "set_heading": Request("flying", "?heading=90"),
    "set_yaw_rate": Request("flying", "?yaw_rate=20"),
    "stop": Request("flying", ""),
    "resume": Request("stopped", ""),
    "brake": Request("flying", ""),
    "guided": Request("loitering", ""),
    "set_mode": Request("flying", "?mode=ALT_HOLD"),
    "set_home": Request("flying", ""),
    **dict.fromkeys(
        ("set_air_speed", "set_ground_speed", "set_climb_speed", "set_descent_speed"), Request("flying", "?new_v=2")
    ),
}
REQUESTS |= {
    "vision/land": Request("above a tag", {}, {}, {**CAMERA, "sim_tags": TAG_BELOW}),
    "vision/search": Request("above a tag", {}, {}, {**CAMERA, "sim_tags": TAG_BESIDE}),
    "vision/mission": Request(
        "flying",
        {"alt": 6, "north": 6, "east": 3, "tag": False},
        {"alt": 6, "north": 300, "east": 0, "tag": False},
        {**CAMERA, "fps": 0.5},  # it looks for nothing
    ),
    "prompt: uavapi fly": REQUESTS["fly-track"],
    "script: go_to_ned_wait": REQUESTS["go_to_ned_wait"],
    "script: land": REQUESTS["land"],
}
FAR_NORTH = {"x": 900, "y": 0, "z": -50}
REQUESTS |= {
    "plane: arm": Request("boot", ""),
    "plane: takeoff": Request("armed", "?alt=70", "?alt=70"),
    "plane: land": Request("cruising", "", ""),
    "plane: rtl": Request("cruising", "", ""),
    "plane: go_to_gps_wait": Request(
        "cruising",
        {"lat": PLACE[0] + 1e-3, "long": PLACE[1], "alt": 60},
        {"lat": PLACE[0] + 9e-3, "long": PLACE[1], "alt": 60},
    ),
    "plane: stop": Request("cruising", ""),
    "plane: guided": Request("circling", ""),
    "plane: set_ground_speed": Request("cruising", "?new_v=15"),
    "quadplane: takeoff": Request("armed", "?alt=15&vtol=true", "?alt=60&vtol=true"),
    "quadplane: land": Request("hovering", "", ""),
    "quadplane: rtl": Request("hovering", "", ""),
    "quadplane: stop": Request("hovering", ""),
    "rover: arm": Request("boot", ""),
    "rover: rtl": Request("driven away", "", ""),
    "rover: go_to_ned_wait": Request("armed", {"x": 12, "y": 6, "z": 0}, {"x": 300, "y": 0, "z": 0}),
    "rover: travel, with duration": REQUESTS["travel, with duration"]._replace(stage="armed"),
    "rover: stop": Request("armed", ""),
    "rover: guided": Request("held", ""),
    "rover: set_reverse": Request("armed", "?reverse=true"),
    "rover: set_ground_speed": Request("armed", "?new_v=2"),
}
REQUESTS["prompt: vision land"] = REQUESTS["vision/land"]
# Verbs that are made of others, of which the last one is refused.
OF_OTHERS = {
    "plane: takeoff",
    "fly-track",
    "vision/land",
    "vision/mission",
    "prompt: vision land",
    "prompt: uavapi fly",
}
STAGES: dict[str, Callable[[World], None]] = {
    "boot": lambda world: world.boot(),
    "armed": lambda world: world.armed(),
    "flying": lambda world: world.flying(),
    "above a tag": lambda world: world.flying(height=3.5),
    "loitering": lambda world: world.flying("LOITER"),
    "stopped": lambda world: world.flying(),
    "cruising": stages.cruising,
    "circling": lambda world: stages.cruising(world, "LOITER"),
    "hovering": stages.hovering,
    "held": stages.held,
    "driven away": stages.driven_away,
}
PILOTS_MODES = {
    # While the vehicle is in GUIDED, and in another mode.
    "copter": ("LOITER", "ALT_HOLD"),
    "plane": ("FBWB", "FBWB"),
    "quadplane": ("QHOVER", "QHOVER"),
    "rover": ("MANUAL", "ACRO"),
}
# Where the vehicle is instead, because that is what goes wrong.
INSTEAD = {
    "during a take-off": stages.armed_with_mission,
    "in AUTO": lambda world: world.on_mission() if world.kind == "copter" else stages.on_mission(world),
}


def about_each_command(world: World, name: str, **fields: Any) -> None:
    for command in COMMANDS:
        world.fault(name, command=command, **fields)


def lose_the_first_acks(world: World) -> None:
    for command in COMMANDS:
        world.fault("lose_acks", command=command, count=1 if command == TAKEOFF else 2)


def accept_for_another(world: World) -> None:
    about_each_command(world, "foreign_ack", result=mavlink.MAV_RESULT_ACCEPTED, **_overheard())
    about_each_command(world, "refuse", result=mavlink.MAV_RESULT_DENIED, text="Not now.")


def be_busy_once(world: World) -> None:
    """A vehicle on the ground is busy with what arming waits for; its mode it changes all the same."""
    for command in COMMANDS if world.vehicle.armed else (ARM,):
        world.fault("refuse", command=command, result=mavlink.MAV_RESULT_TEMPORARILY_REJECTED, count=1)


def _overheard() -> dict[str, int]:
    system, component = OVERHEAR
    return {"system": system, "component": component}


def put_envelope(world: World) -> None:
    """It ends 1.5 m beside the vehicle and half a metre above it."""
    north, east, down = world.at
    area = feature("box", square(1.5, north, east), ceiling=0.5 - down)
    world.host.envelopes.put(API, ALL, formats.of_geojson({"type": "FeatureCollection", "features": [area]}, "a box"))
    world.pass_time(1.5)  # in which the vehicle is asked how it brakes


def lose_what_is_told_once(world: World) -> None:
    """The first one of each such message."""
    left, hears = dict.fromkeys(TOLD_ONCE, 1), world.hears

    def hears_the_others(message: Any) -> bool:
        name = message.get_type()
        left[name] = left.get(name, 0) - 1
        return left[name] < 0 and hears(message)

    world.hears = hears_the_others
    for name in TOLD_ONCE:
        world.host.registry.find(1).state.messages.pop(name, None)


def double(world: World) -> None:
    """It has been there for so long that it is noticed."""
    world.double()
    world.until(lambda: world.host.fleet.vehicles[1].are_two(world.now), 15.0, step=0.2)
    world.sent.clear()


# What is so already when the request comes.
BEFORE: dict[str, Callable[[World], None]] = {
    "ack lost": lose_the_first_acks,
    "acks lost for good": lambda world: about_each_command(world, "lose_acks"),
    "late ack": lambda world: about_each_command(world, "delay_acks", seconds=2.0),
    "foreign acceptance": accept_for_another,
    "foreign refusal": lambda world: about_each_command(
        world, "foreign_ack", result=mavlink.MAV_RESULT_DENIED, **_overheard()
    ),
    "refused": lambda world: about_each_command(world, "refuse", result=mavlink.MAV_RESULT_DENIED, text="Not now."),
    "busy once": be_busy_once,
    "outside the envelope": put_envelope,
    "in progress": lambda world: about_each_command(world, "in_progress", seconds=4.0),
    "told once, lost": lose_what_is_told_once,
    "two autopilots": double,
}


def main_loop_stands(world: World, _wire: Any) -> None:
    world.stand(True)
    world.loop.call_later(STANDS_FOR, world.stand, False)


def another_station(world: World, _wire: Any) -> None:
    if world.vehicle.mode.name == "GUIDED":
        world.fault("other_station", position=ELSEWHERE)


# What happens while the verb waits.
MEANWHILE: dict[str, Callable[[Any, Any], None]] = {
    "link silence": lambda world, wire: world.fault("silence"),
    "main loop stands": main_loop_stands,
    "reboot": lambda world, wire: world.reboot(DARK),
    "pilot's mode": lambda world, wire: world.fault(
        "pilot_mode", mode=PILOTS_MODES[world.kind][world.vehicle.mode.name != "GUIDED"]
    ),
    "disarmed": lambda world, wire: world.fault("pilot_disarm"),
    "client gone": lambda world, wire: wire.hang_up(),
    "another station flies it": another_station,
}
# How a verb shows that has gone on without its client.
DONE: dict[str, Callable[[World], bool]] = {
    **dict.fromkeys(
        ("land", "rtl", "script: land", "vision/land", "vision/mission"),
        lambda world: not world.copter.armed and world.at[2] > -0.1,
    ),
    "vision/search": lambda world: world.copter.armed and math.hypot(world.at[0] - 0.5, world.at[1] - 3.0) < 2.0,
    "brake": lambda world: world.copter.mode.name == "BRAKE",
    "stop": lambda world: world.copter.guided.paused,
    "resume": lambda world: not world.copter.guided.paused,
    **dict.fromkeys(("plane: land", "quadplane: land"), lambda world: not world.vehicle.armed),
    **dict.fromkeys(("plane: rtl", "rover: rtl"), lambda world: world.vehicle.mode.name == "RTL"),
    "plane: stop": lambda world: world.vehicle.mode.name == "LOITER",
    "rover: stop": lambda world: world.vehicle.mode.name == "HOLD" and abs(world.vehicle.body.speed) < 0.5,
}
ELSEWHERE = [-80.0, 40.0, -12.0]  # m NED
