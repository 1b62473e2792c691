"""Landings on pads that move, with `vision set target moving`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import NotSupported
from mavproxy_uavapi.rehearsal.virtual_link import VirtualLink
from mavproxy_uavapi.sim.options import Options
from mavproxy_uavapi.sim.simulator import Simulator
from mavproxy_vision.errors import LandingFailed
from mavproxy_vision.geometry.frames import Mount
from tests.support.moving_pads import CROSS_SEA, RISES, SWELL, TAG, at_sea, contact, straight, turning
from tests.support.vision_world import VisionWorld

pytestmark = pytest.mark.matrix

LAND_SPEED = 0.5  # m/s, ArduCopter's
SWELLING = 0.95  # m/s: of the last metre, and of a pad that falls on a swell
PADS = {"resting": straight(0.0), "1 m/s": straight(1.0), "3 m/s": straight(3.0), "turning": turning(3.0, 15.0)}


@pytest.fixture
def above(make_world: Callable[..., VisionWorld]) -> Callable[..., VisionWorld]:
    """A vehicle above a pad that may move: `above(**settings)`."""

    def make(**settings: Any) -> VisionWorld:
        tag = f"0:0.30@{TAG[0]},{TAG[1]}"
        world = make_world(**{"sim_tags": tag, "target": "moving", "precision_landing": True, **settings})
        world.start(5.0)
        world.pass_time(1.0)
        return world

    return make


@pytest.mark.parametrize(
    "name", ["1 m/s", "turning", *(pytest.param(name, marks=pytest.mark.long) for name in ("resting", "3 m/s"))]
)
def test_it_lands_on_a_pad_that_moves(above, name):
    touched, outcome = contact(above(), PADS[name])
    assert "Landed" in str(outcome)
    assert touched.offset < 0.25
    assert touched.sink < 0.5
    assert touched.slip < 0.4


@pytest.mark.parametrize(
    ("speed", "waves", "since", "most"),
    [(0.0, SWELL, 0.0, LAND_SPEED), (1.0, CROSS_SEA, 0.0, 0.75), (1.0, SWELL, 4.5, LAND_SPEED)],
    ids=["swell", "cross sea", "falling when it is touched"],
)
def test_it_touches_a_pad_at_sea_no_faster_than_land_touches_the_ground(above, speed, waves, since, most):
    """A pad that falls as fast as the vehicle is touched as late as the landing waits for it."""
    touched, outcome = contact(above(ground=RISES), at_sea(speed, waves, since))
    assert "Landed" in str(outcome)
    assert touched.offset < 0.35
    assert touched.sink < most
    assert touched.slip < 0.4


@pytest.mark.parametrize("speed", [1.0, pytest.param(3.0, marks=pytest.mark.long)])
def test_control_by_default_such_a_pad_is_not_landed_on(above, speed):
    touched, outcome = contact(above(target="resting", on_failure="hold"), straight(speed))
    assert touched is None
    assert isinstance(outcome, LandingFailed)


@pytest.mark.parametrize("height", [3.0, 1.5])
def test_a_picture_that_stands_still_is_told_over_a_pad_that_moves_too(above, height):
    world = above()
    world.each_step.append(lambda: setattr(world.eye, "stuck", world.eye.stuck or -world.at.down < height))
    touched, outcome = contact(world, straight(1.0))
    assert touched is None
    assert "stands still" in str(outcome)


@pytest.mark.parametrize("seconds", [0.2, 1.0])
def test_pictures_that_come_over_and_over_are_no_camera_over_a_pad_that_moves(above, seconds):
    world = above(on_failure="hold")
    world.each_step.append(lambda: setattr(world.eye, "looping", world.eye.looping or seconds * (-world.at.down < 3)))
    touched, outcome = contact(world, straight(1.0))
    assert touched is None
    assert "the camera: frozen" in str(outcome)


@pytest.mark.parametrize(
    ("metres", "most"), [pytest.param(2.3, LAND_SPEED, marks=pytest.mark.long), (1.5, LAND_SPEED), (0.5, SWELLING)]
)
def test_over_a_tag_that_sinks_as_fast_as_the_vehicle_it_ends_softly_and_says_why(above, metres, most):
    """From that height on the tag stays so many m below, into the ground; higher up its size tells.

    On the last metre nothing tells such a tag from a pad that a swell lets fall.
    """
    world, fastest = above(on_failure="hold"), [0.0]
    world.eye.walk = lambda _time: (0.0, 0.0, min(-world.at.down - metres, 0.0))

    def watch():
        if -0.1 < world.at.down < 0:
            fastest[0] = max(fastest[0], world.copter.body.velocity_down)

    world.each_step.append(watch)
    began = world.now
    outcome = world.outcome(world.land())
    assert isinstance(outcome, LandingFailed)
    assert "the tag sinks" in str(outcome) or "the tag was" in str(outcome)
    assert fastest[0] < most
    assert world.now - began < 30.0


TELLS = {
    "ATTITUDE": ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"),
    "LOCAL_POSITION_NED": ("x", "y", "z", "vx", "vy", "vz"),
}


def telemetry(world: VisionWorld, name: str, change: Any) -> None:
    """From now on each message of that name is heard as `change(numbers of all until now)` makes it."""
    hear, told = world.come, []

    def receive(message: Any) -> None:
        if message.get_type() == name:
            told.append(tuple(getattr(message, field) for field in TELLS[name]))
            for field, number in zip(TELLS[name], change(told), strict=True):
                setattr(message, field, number)
        hear(message)

    world.come = receive


def attitudes(world: VisionWorld, change: Any) -> None:
    telemetry(world, "ATTITUDE", change)


def ever_later(world: VisionWorld) -> None:
    since = world.now
    world.eye.late = lambda time: 0.3 * (time - since)


def turned(world: VisionWorld) -> None:
    world.eye.source.renderer.mount = Mount(yaw=90.0)


def long_lens(world: VisionWorld) -> None:
    renderer = world.eye.source.renderer
    renderer.model = replace(renderer.model, fx=1.2 * renderer.model.fx, fy=1.2 * renderer.model.fy)


FAULTS = {
    "frames ever later": ever_later,
    "frames 0.4 s late": lambda world: setattr(world.eye, "late", lambda _time: 0.4),
    "a turned camera": turned,
    "a lens a fifth longer than told": long_lens,
    "a turned compass": lambda world: attitudes(
        world, lambda told: (*told[-1][:2], told[-1][2] + 1.0, *told[-1][3:])
    ),
    "an attitude that is late": lambda world: attitudes(world, lambda told: told[max(len(told) - 13, 0)]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_makes_the_tag_seem_to_sway_is_told_before_the_descent(above, fault):
    world = above(on_failure="hold")
    FAULTS[fault](world)
    touched, outcome = contact(world, straight(0.5))
    assert touched is None
    assert "sways" in str(outcome) or "`mount`" in str(outcome)
    assert math.hypot(world.at.north, world.at.east) < 8.0
    assert -world.at.down > 4.0


@pytest.mark.parametrize("seconds", [0.04, 1.5, pytest.param(8.0, marks=pytest.mark.long)])
def test_an_attitude_that_stands_still_in_flight_is_told_within_seconds(above, seconds):
    world = above(on_failure="hold")
    began = world.now
    attitudes(world, lambda told: told[min(len(told), round(25 * seconds)) - 1])
    touched, outcome = contact(world, straight(1.0))
    assert touched is None
    assert "attitude stands still" in str(outcome) or "the attitude is wrong" in str(outcome)
    assert world.now - began < seconds + 4.0


@pytest.mark.parametrize("height", [3.0, 0.9])
def test_a_position_that_stands_still_in_flight_leads_nowhere(above, height):
    world, still = above(on_failure="hold"), []

    def change(told: Any) -> Any:
        if -world.at.down < height and not still:
            still.append(told[-1])
        return still[0] if still else told[-1]

    telemetry(world, "LOCAL_POSITION_NED", change)
    began = world.now
    touched, outcome = contact(world, straight(1.0))
    assert touched is None
    assert "position stands still" in str(outcome)
    assert world.now - began < 20.0
    assert -world.at.down < height


@pytest.mark.parametrize("late", [lambda _since: 0.4, lambda since: 0.3 * since], ids=["0.4 s", "ever later"])
def test_frames_that_come_late_from_a_metre_on_do_not_land_beside_the_pad_in_silence(above, late):
    world, since = above(on_failure="hold"), []
    world.each_step.append(lambda: since.append(world.now) if not since and -world.at.down < 1.2 else None)
    world.eye.late = lambda time: late(time - since[0]) if since else 0.0
    touched, outcome = contact(world, straight(1.0))
    assert since
    assert isinstance(outcome, LandingFailed) or touched.offset < 0.25


def test_over_a_pad_an_attitude_that_arrives_late_lands_beside_nothing(above):
    world = above(on_failure="hold")
    hear = world.come
    world.come = lambda message: (
        world.loop.call_later(0.3, hear, message) if message.get_type() == "ATTITUDE" else hear(message)
    )
    touched, outcome = contact(world, straight(1.0))
    assert isinstance(outcome, LandingFailed) or touched.offset < 0.25


def below(world: VisionWorld, height: float, begin: Any) -> None:
    """Call it once, when the vehicle is lower than that."""
    begun: list[bool] = []
    world.each_step.append(lambda: (begun.append(True), begin()) if not begun and -world.at.down < height else None)


def turns_a_third(world: VisionWorld) -> None:
    world.eye.source.renderer.mount = Mount(yaw=30.0)


def drifting_compass(world: VisionWorld) -> None:
    since = world.now

    def change(told: Any) -> Any:
        roll, pitch, yaw, *rates = told[-1]
        return roll, pitch, math.remainder(yaw + 0.5 * (world.now - since), math.tau), *rates

    attitudes(world, change)


def half_speed(world: VisionWorld) -> None:
    since = world.now
    world.eye.late = lambda time: 0.5 * (time - since)


def dead(world: VisionWorld) -> None:
    world.eye.dead = True


def biased(world: VisionWorld) -> None:
    def change(told: Any) -> Any:
        *place, north, east, down = told[-1]
        return *place, north + 0.3, east, down

    telemetry(world, "LOCAL_POSITION_NED", change)


@pytest.mark.parametrize(
    ("fault", "height"),
    [
        pytest.param(turns_a_third, 0.9, marks=pytest.mark.long),
        (drifting_compass, 0.8),
        (half_speed, 0.9),
        (dead, 0.9),
        (turns_a_third, 0.7),
        (biased, 0.7),
    ],
)
def test_a_landing_that_ends_beside_a_pad_by_a_fault_of_the_last_metre_is_no_success(above, fault, height):
    world = above(on_failure="hold", time_limit=60)
    below(world, height, lambda: fault(world))
    touched, outcome = contact(world, straight(1.0))
    assert isinstance(outcome, LandingFailed) or touched.offset < 0.25


@pytest.mark.parametrize("height", [0.7, 0.5])
def test_a_vehicle_that_stands_and_by_its_own_velocity_moves_has_landed_near_a_tag(above, height):
    world = above(target="resting")
    below(world, height, lambda: biased(world))
    assert "Landed near tag 0" in world.outcome(world.land())
    assert "0.3 m/s" in world.vision.report.warning


@pytest.mark.parametrize(
    ("beside", "height"), [(0.4, 2.5), (0.85, 1.2), (0.85, 1.6), pytest.param(0.8, 2.5, marks=pytest.mark.long)]
)
def test_an_equal_tag_elsewhere_that_replaces_the_first_one_is_held_for(above, beside, height):
    world = above()
    renderer = world.eye.source.renderer
    other = replace(renderer.tags[0], north=renderer.tags[0].north + beside)
    below(world, height, lambda: setattr(renderer, "tags", (other,)))
    touched, outcome = contact(world, straight(0.0))
    assert touched is None
    assert isinstance(outcome, LandingFailed)
    assert outcome.report["action"] == "hold"


@pytest.mark.long
def test_control_a_pad_that_brakes_is_landed_on(above):
    world, drive = above(), straight(2.0)

    def walk(time: float) -> tuple[float, float, float]:
        north, east, _ = drive(min(time, 8.0))
        braking = min(max(time - 8.0, 0.0), 2.0)
        metres = 2.0 * braking - braking**2 / 2
        return north + metres * math.cos(0.6), east + metres * math.sin(0.6), 0.0

    touched, outcome = contact(world, walk)
    assert "Landed" in str(outcome)
    assert touched.offset < 0.25


@pytest.mark.parametrize("height", [1.0, 0.9, 0.8])
def test_a_velocity_that_is_off_from_a_metre_on_leads_along_for_less_than_a_minute(above, height):
    world, off = above(on_failure="hold"), []

    def change(told: Any) -> Any:
        *place, north, east, down = told[-1]
        return *place, north + (0.3 if off else 0.0), east, down

    telemetry(world, "LOCAL_POSITION_NED", change)
    below(world, height, lambda: off.append(True))
    began = world.now
    touched, outcome = contact(world, straight(1.0))
    assert isinstance(outcome, LandingFailed) or touched.offset < 0.25
    assert world.now - began < 60.0


def test_by_frames_that_a_vehicle_may_land_by_no_pad_that_moves_is_followed(above):
    world = above(latency=320, sim_latency=320)
    touched, outcome = contact(world, straight(1.0))
    assert touched is None
    assert "at most 250 ms" in str(outcome)


class Driving:
    """A rover of the same MAVProxy, system id 11, that starts beside the copter and carries a tag."""

    def __init__(self, world: VisionWorld, speed: float) -> None:
        step = world.simulator.options.step
        self.simulator = Simulator(Options(vehicle="rover", sysid=11, ready_after=1.0, step=step))
        self._world, self._speed = world, speed
        self._to_copter = VirtualLink([self.simulator])
        self.simulator.run(3.0)
        world.join(self.simulator)
        arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        world.arrive(mavlink.MAVLink_command_long_message(11, 1, arm, 0, 1, 0, 0, 0, 0, 0, 0))
        world.arrive(mavlink.MAVLink_request_data_stream_message(11, 1, 0, 4, 1))
        world.each_step.append(self._drive)

    def _drive(self) -> None:
        vehicle, only_velocity = self.simulator.vehicle, 0b0000_1101_1100_0111
        if vehicle.mode.name != "GUIDED":
            vehicle.set_mode(15)
        self._world.arrive(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 11, 1, 1, only_velocity, 0, 0, 0, self._speed, 0, 0, 0, 0, 0, 0, 0
            )
        )
        copter = self._world.simulator
        for message in self._to_copter.heard():
            answer = copter.decks.hear(message, copter.vehicle.now)
            if answer is not None:
                self._to_copter.deliver(answer)

    @property
    def body(self) -> Any:
        return self.simulator.vehicle.body


def test_a_copter_lands_on_a_rover_of_the_same_mavproxy_that_drives(above):
    """As docs/vision.md says to try it; the rover's roof is as high as the ground."""
    world = above(sim_tags="0:0.30@v11")
    rover = Driving(world, 1.0)
    world.pass_time(0.8)
    assert str(world.outcome(world.land())).startswith("Landed on tag 0, 0.0")
    for _ in range(2):
        north, east, _ = world.copter.body.position - np.array(rover.body.position)
        assert math.hypot(north, east) < 0.25
        assert rover.body.velocity_north > 0.8
        world.pass_time(10.0)


def test_landing_target_is_refused_on_a_pad_that_moves(above):
    world = above()
    assert isinstance(world.outcome(world.land(method="landing_target")), NotSupported)
