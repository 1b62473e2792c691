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
from tests.support.landing import FAR_TAG, LARGE, SWITCH_MODE, height, holds, sent, silent, until

# -- what is not told, or no number ----------------------------------------------------------------------------


def test_what_is_no_number_never_reaches_a_setpoint(flying):
    rig = flying(sim_tags=FAR_TAG)
    job = rig.land()
    rig.pass_time(1.0)
    hear, count = rig.host._receive, [0]

    def poisoned(message: Any) -> None:
        count[0] += 1
        if message.get_type() in ("LOCAL_POSITION_NED", "ATTITUDE") and count[0] % 7 == 0:
            for field in ("vx", "x", "yaw", "roll"):
                if hasattr(message, field):
                    setattr(message, field, math.nan)
        hear(message)

    rig.host._receive = poisoned
    assert rig.outcome(job).startswith("Landed on tag 0")
    assert all(math.isfinite(m.vx + m.vy + m.vz) for m in sent(rig, "SET_POSITION_TARGET_LOCAL_NED"))


def test_without_positions_a_landing_ends(flying):
    rig = flying(sim_tags=FAR_TAG)
    job = rig.land()
    rig.pass_time(2.0)
    silent(rig, "LOCAL_POSITION_NED")
    error = rig.outcome(job)
    assert isinstance(error, LandingFailed)
    assert "has not reported where it is" in str(error)
    assert error.report["action"] == "rtl"


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_velocity_that_is_no_number_is_not_sent_and_the_vehicle_holds(flying, monkeypatch, bad):
    rig = flying(sim_tags="")
    job = rig.land()
    rig.pass_time(1.0)
    monkeypatch.setattr(Landing, "step", lambda *_: LandingCommand(Phase.LOOK, vector(0, bad, 0)))
    assert "a number in it is not finite" in str(rig.outcome(job))
    assert holds(rig, seconds=3.0)


def test_a_return_that_is_refused_is_reported_with_the_reason_of_the_landing(flying):
    rig = flying(sim_tags="", attempts=1, leash=1.0)
    job = rig.land()
    rig.pass_time(1.0)
    rig.simulator.faults.add("refuse", {"command": SWITCH_MODE})
    error = rig.outcome(job)
    assert isinstance(error, LandingFailed)
    assert "no tag in sight" in str(error)
    assert "DO_SET_MODE" in str(error)
    assert error.report["action"] == "hold"
    assert rig.mode == "GUIDED"


# -- tags and heights ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("offset", ["0.3,0,0", "0.2,-0.2,0.1"])
def test_a_camera_beside_the_middle_lands_it_too(flying, offset):
    rig = flying(alt=4.0, offset=offset)
    assert rig.outcome(rig.land()).startswith("Landed on tag 0")
    assert math.hypot(rig.truth.north - 0.8, rig.truth.east + 0.6) < 0.25


def test_a_tag_that_fills_the_view_high_up_is_refused(flying):
    rig = flying(alt=8.0, tags="0:3", sim_tags="0:3@0.8,-0.6")
    error = rig.outcome(rig.land())
    assert isinstance(error, Invalid)
    assert "a smaller one beside it" in str(error)
    assert rig.mode == "GUIDED"


def test_a_large_tag_that_is_covered_in_its_last_metres_is_climbed_from(flying):
    rig = flying(alt=6.0, attempts=1, tags="0:0.9", sim_tags="0:0.9@0.8,-0.6", on_failure="hold")
    phases: list[str] = []

    def watch() -> None:
        phases.append(rig.flights.phase)
        if "last metre" in rig.flights.phase and height(rig) > 1.5:
            rig.eye.blind = lambda _: True

    rig.each_step.append(watch)
    assert isinstance(rig.outcome(rig.land()), LandingFailed)
    assert "holding: tag lost" in phases
    assert height(rig) > 1.5


def test_a_tag_that_is_lost_on_the_way_down_again_and_again_is_given_up(flying):
    rig = flying(attempts=2, on_failure="hold")
    rig.eye.blind = lambda pose: -pose[0][2] < 2.5
    error = rig.outcome(rig.land())
    assert "lost again on the way down after 2 attempts" in str(error)


def test_another_home_in_flight_changes_no_height(flying):
    rig = flying(alt=4.0, sim_tags="", attempts=3, leash=6.0, on_failure="hold")
    job = rig.land()
    rig.pass_time(2.0)
    rig.tracker.carrier.home_down += 4.0
    lowest: list[float] = []
    rig.each_step.append(lambda: lowest.append(height(rig)))
    rig.pass_time(8.0)  # it sinks with 1 m/s
    assert job.running
    assert min(lowest) > 3.0


def test_after_a_silence_it_knows_how_high_it_is(flying):
    rig = flying(alt=7.0, **LARGE)
    job = rig.land()
    until(rig, lambda: height(rig) < 3.0)
    heights: list[float] = []
    rig.each_step.append(lambda: heights.append(height(rig)) if "last metre" in rig.flights.phase else None)
    rig.simulator.faults.silence(rig.simulator.copter.now, 3.0, sending=True, receiving=True)
    rig.outcome(job)
    assert heights[0] < 1.1


def test_a_yaw_rate_after_a_search_turns_it_above_the_tag(flying):
    rig = flying(alt=5.0)
    rig.fly_to(-6.0, 0.0, -5.0)  # the target of long ago
    rig.fly_to(0.0, 0.0, -5.0)
    rig.outcome(rig.begin(rig.flights.searching(rig.copter, None, None), "/vision/search"))
    rig.pass_time(5.0)  # GUID_TIMEOUT is over too
    before, yaw = rig.truth, rig.simulator.copter.body.yaw
    assert rig.outcome(rig.begin(lambda job: rig.copter.set_yaw_rate(job, 20.0), "/movement/set_yaw_rate")) == "done"
    rig.pass_time(10.0)
    assert math.dist(before, rig.truth) < 1.0
    assert rig.simulator.copter.body.yaw != pytest.approx(yaw, abs=0.1)


# -- somebody switches in the middle ---------------------------------------------------------------------------


def test_a_pilot_who_switches_before_the_return_has_it(flying):
    rig = flying(sim_tags="", attempts=1, leash=1.0)
    job = rig.land()
    ask = type(rig.copter).limits

    async def slowly(self: Any) -> Any:
        rig.simulator.copter.sticks.move(3, 1500)
        rig.simulator.copter.set_mode(5)
        await asyncio.sleep(1.5)
        return await ask(self)

    rig.copter.limits = slowly.__get__(rig.copter)
    assert isinstance(rig.outcome(job), ModeChanged)
    rig.pass_time(3.0)
    assert rig.mode == "LOITER"


def test_pilot_in_the_last_metre_ends_it_and_nothing_more_is_sent(flying):
    rig = flying()
    job = rig.land()
    until(rig, lambda: "last metre" in rig.flights.phase)
    rig.simulator.copter.sticks.move(3, 1500)
    rig.simulator.copter.set_mode(5)
    rig.pass_time(0.1)
    mark = len(rig.wire.sent)
    assert isinstance(rig.outcome(job), ModeChanged)
    rig.pass_time(2.0)
    assert not sent(rig, "SET_POSITION_TARGET_LOCAL_NED", mark)
    assert rig.mode == "LOITER"
