"""What a flight by velocities sends, and when it gives up."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import Invalid, ModeChanged
from mavproxy_vision.errors import LandingFailed
from mavproxy_vision.geometry.frames import vector
from mavproxy_vision.landing.state_machine import Landing, LandingCommand, Phase
from tests.support.landing import FAR_TAG, LARGE, SWITCH_MODE, height, holds, sent, silent

# -- what is not told, or no number ----------------------------------------------------------------------------


def test_what_is_no_number_never_reaches_a_setpoint(flying):
    world = flying(sim_tags=FAR_TAG)
    job = world.land()
    world.pass_time(1.0)
    hear, count = world.come, [0]

    def poisoned(message: Any) -> None:
        count[0] += 1
        if message.get_type() in ("LOCAL_POSITION_NED", "ATTITUDE") and count[0] % 7 == 0:
            for field in ("vx", "x", "yaw", "roll"):
                if hasattr(message, field):
                    setattr(message, field, math.nan)
        hear(message)

    world.come = poisoned
    assert world.outcome(job).startswith("Landed on tag 0")
    assert all(math.isfinite(m.vx + m.vy + m.vz) for m in sent(world, "SET_POSITION_TARGET_LOCAL_NED"))


def test_without_positions_a_landing_ends(flying):
    world = flying(sim_tags=FAR_TAG)
    job = world.land()
    world.pass_time(2.0)
    silent(world, "LOCAL_POSITION_NED")
    error = world.outcome(job)
    assert isinstance(error, LandingFailed)
    assert "has not reported where it is" in str(error)
    assert error.report["action"] == "rtl"


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_velocity_that_is_no_number_is_not_sent_and_the_vehicle_holds(flying, monkeypatch, bad):
    world = flying(sim_tags="")
    job = world.land()
    world.pass_time(1.0)
    monkeypatch.setattr(Landing, "step", lambda *_: LandingCommand(Phase.LOOK, vector(0, bad, 0)))
    assert "a number in it is not finite" in str(world.outcome(job))
    assert holds(world, seconds=3.0)


def test_a_return_that_is_refused_is_reported_with_the_reason_of_the_landing(flying):
    world = flying(sim_tags="", attempts=1, leash=1.0)
    job = world.land()
    world.pass_time(1.0)
    world.simulator.faults.add("refuse", {"command": SWITCH_MODE})
    error = world.outcome(job)
    assert isinstance(error, LandingFailed)
    assert "no tag in sight" in str(error)
    assert "DO_SET_MODE" in str(error)
    assert error.report["action"] == "hold"
    assert world.mode == "GUIDED"


# -- tags and heights ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("offset", ["0.3,0,0", "0.2,-0.2,0.1"])
def test_a_camera_beside_the_middle_lands_it_too(flying, offset):
    world = flying(alt=4.0, offset=offset)
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert math.hypot(world.at.north - 0.8, world.at.east + 0.6) < 0.25


def test_a_tag_that_fills_the_view_high_up_is_refused(flying):
    world = flying(alt=8.0, tags="0:3", sim_tags="0:3@0.8,-0.6")
    error = world.outcome(world.land())
    assert isinstance(error, Invalid)
    assert "a smaller one beside it" in str(error)
    assert world.mode == "GUIDED"


def test_a_large_tag_that_is_covered_in_its_last_metres_is_climbed_from(flying):
    world = flying(alt=6.0, attempts=1, tags="0:0.9", sim_tags="0:0.9@0.8,-0.6", on_failure="hold")
    phases: list[str] = []

    def watch() -> None:
        phases.append(world.vision.phase)
        if "last metre" in world.vision.phase and height(world) > 1.5:
            world.eye.blind = lambda _: True

    world.each_step.append(watch)
    assert isinstance(world.outcome(world.land()), LandingFailed)
    assert "holding: tag lost" in phases
    assert height(world) > 1.5


def test_a_tag_that_is_lost_on_the_way_down_again_and_again_is_given_up(flying):
    world = flying(attempts=2, on_failure="hold")
    world.eye.blind = lambda pose: -pose[0][2] < 2.5
    error = world.outcome(world.land())
    assert "lost again on the way down after 2 attempts" in str(error)


def test_another_home_in_flight_changes_no_height(flying):
    world = flying(alt=4.0, sim_tags="", attempts=3, leash=6.0, on_failure="hold")
    job = world.land()
    world.pass_time(2.0)
    world.tracker.carrier.home_down += 4.0
    lowest: list[float] = []
    world.each_step.append(lambda: lowest.append(height(world)))
    world.pass_time(8.0)  # it sinks with 1 m/s
    assert job.running
    assert min(lowest) > 3.0


def test_after_a_silence_it_knows_how_high_it_is(flying):
    world = flying(alt=7.0, **LARGE)
    job = world.land()
    world.until(lambda: height(world) < 3.0, step=0.05)
    heights: list[float] = []
    world.each_step.append(lambda: heights.append(height(world)) if "last metre" in world.vision.phase else None)
    world.simulator.faults.silence(world.copter.now, 3.0, sending=True, receiving=True)
    world.outcome(job)
    assert heights[0] < 1.1


def test_a_yaw_rate_after_a_search_turns_it_above_the_tag(flying):
    world = flying(alt=5.0)
    world.go_to(-6.0, 0.0, -5.0)  # the target of long ago
    world.go_to(0.0, 0.0, -5.0)
    world.outcome(world.fly(world.vision.searching(world.known, None, None), "/vision/search"))
    world.pass_time(5.0)  # GUID_TIMEOUT is over too
    before, yaw = world.at, world.copter.body.yaw
    assert (
        world.outcome(world.fly(lambda job: world.known.set_yaw_rate(job, 20.0), "/movement/set_yaw_rate")) == "done"
    )
    world.pass_time(10.0)
    assert math.dist(before, world.at) < 1.0
    assert world.copter.body.yaw != pytest.approx(yaw, abs=0.1)


# -- somebody switches in the middle ---------------------------------------------------------------------------


def test_a_pilot_who_switches_before_the_return_has_it(flying):
    world = flying(sim_tags="", attempts=1, leash=1.0)
    job = world.land()
    ask = type(world.known).limits

    async def slowly(self: Any) -> Any:
        world.copter.sticks.move(3, 1500)
        world.copter.set_mode(5)
        await asyncio.sleep(1.5)
        return await ask(self)

    world.known.limits = slowly.__get__(world.known)
    assert isinstance(world.outcome(job), ModeChanged)
    world.pass_time(3.0)
    assert world.mode == "LOITER"


def test_pilot_in_the_last_metre_ends_it_and_nothing_more_is_sent(flying):
    world = flying()
    job = world.land()
    world.until(lambda: "last metre" in world.vision.phase, step=0.05)
    world.copter.sticks.move(3, 1500)
    world.copter.set_mode(5)
    world.pass_time(0.1)
    mark = len(world.sent)
    assert isinstance(world.outcome(job), ModeChanged)
    world.pass_time(2.0)
    assert not sent(world, "SET_POSITION_TARGET_LOCAL_NED", mark)
    assert world.mode == "LOITER"
