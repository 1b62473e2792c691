"""What the tests of landings in lock step share: tags, and what is asked of a world."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.mission import Item
from tests.support.vision_world import VisionWorld

TAG = "0:0.30@0.8,-0.6"
FAR_TAG = "0:0.30@1.6,-1.2"
LARGE = {"tags": "0:0.6", "sim_tags": "0:0.6@0.8,-0.6"}
SMALL = {"width": 320, "height": 240, "fps": 12.0, "sim_noise": 3.0, "sim_jitter": 0.0}
SWITCH_MODE, TAKEOFF = 176, 22
LANDING_PARAMETERS = ("PLND_ENABLED", "PLND_STRICT", "PLND_RET_MAX", "PLND_ALT_MIN", "PLND_ALT_MAX")
MODES = {"LAND": 9, "RTL": 6, "BRAKE": 17, "GUIDED": 4, "LOITER": 5}


def height(world: VisionWorld) -> float:
    return -float(world.at.down)


def sent(world: VisionWorld, kind: str, since: int = 0) -> list[Any]:
    return [one.message for one in world.sent[since:] if one.message.get_type() == kind]


def landing_parameters(world: VisionWorld) -> dict[str, float]:
    return {name: world.simulator.parameters[name] for name in LANDING_PARAMETERS}


def silent(world: VisionWorld, name: str) -> None:
    """From now on nobody hears that message."""
    hear = world.come
    world.come = lambda message: None if message.get_type() == name else hear(message)


def unheard(world: VisionWorld, mode: str) -> Any:
    """From now on nobody hears a heartbeat of that mode; what has to be put back to hear it."""
    hear = world.come
    world.come = lambda message: (
        None if message.get_type() == "HEARTBEAT" and message.custom_mode == MODES[mode] else hear(message)
    )
    return hear


def holds(world: VisionWorld, mode: str = "GUIDED", seconds: float = 10.0) -> bool:
    """Whether it stays where it is, armed, in that mode: what the autopilot flew by itself is left by BRAKE."""
    world.pass_time(3.0)
    before = height(world)
    world.pass_time(seconds)
    return world.mode == mode and world.copter.armed and abs(height(world) - before) < 0.5


def pilot(world: VisionWorld, mode: int) -> None:
    """The pilot switches; for AUTO there is a mission."""
    world.copter.sticks.move(3, 1500)
    item = Item(mavlink.MAV_CMD_NAV_LOITER_UNLIM, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, 0, 0, 0, 0, 0, 0, 10.0)
    world.copter.mission.replace([item, item])
    assert world.copter.set_mode(mode)


def long(value: Any) -> Any:
    """A parameter of a test that takes long, and goes the way of another one."""
    return pytest.param(value, marks=pytest.mark.long)
