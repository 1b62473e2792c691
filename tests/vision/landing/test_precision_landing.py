"""LANDING_TARGET in LAND, and the PLND parameters that are set for it and given back."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import LinkLost, ModeChanged, NotArmed
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.telemetry.vehicle_state import is_finite
from mavproxy_vision.errors import LandingFailed
from mavproxy_vision.geometry.frames import Attitude, vector
from mavproxy_vision.landing.precision_landing import WANTED, landing_target
from tests.support.landing import (
    LANDING_PARAMETERS,
    LARGE,
    MODES,
    SWITCH_MODE,
    holds,
    landing_parameters,
    long,
    pilot,
    sent,
    silent,
    unheard,
)
from tests.support.vision_world import VisionWorld

pytestmark = pytest.mark.matrix


@pytest.mark.parametrize(("forward", "right"), [(1.0, 0.5), (-1.0, 0.5), (0.3, -2.0)])
def test_the_angles_of_landing_target_mean_the_same_as_its_position(forward, right):
    message = landing_target(1.0, vector(forward, right, 4.0), Attitude())
    reported = (-math.tan(message.angle_y), math.tan(message.angle_x))  # as AC_PrecLand_MAVLink.cpp reads them
    assert reported == pytest.approx((forward / 4.0, right / 4.0))
    assert (message.x, message.y, message.z) == pytest.approx((forward, right, 4.0))


# -- stopped, and taken over -----------------------------------------------------------------------------------


def test_stopped_in_land_by_landing_target_it_holds_and_its_parameters_are_as_before(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(world)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(2.0)
    assert world.stop()
    world.outcome(job)
    assert holds(world, "BRAKE")
    assert landing_parameters(world) == before


@pytest.mark.parametrize("switch_after", [0.3, 1.0])  # s of silence, of which 1.2 s would have it taken back
def test_a_pilot_who_takes_it_while_the_telemetry_is_silent_keeps_it(flying, switch_after):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    job = world.land(method="landing_target")
    world.until(lambda: world.known.mode == "LAND", step=0.05)
    world.pass_time(1.5)
    hear, world.come = world.come, lambda _message: None
    world.pass_time(switch_after)
    pilot(world, MODES["LOITER"])
    began = len(world.sent)
    world.pass_time(3.0 - switch_after)
    world.come = hear
    world.pass_time(3.0)
    switches = [one for one in world.sent[began:] if one.command == SWITCH_MODE]
    assert switches == [] and world.mode == "LOITER"
    assert isinstance(world.outcome(job), ModeChanged)


def test_a_pilot_who_takes_it_as_the_tag_is_lost_keeps_it(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    job = world.land(method="landing_target")
    world.until(lambda: world.known.mode == "LAND", step=0.05)
    world.pass_time(1.5)
    world.eye.blind = lambda _detection: True
    hear = unheard(world, "LOITER")
    world.pass_time(1.0)
    pilot(world, MODES["LOITER"])
    world.pass_time(1.5)
    world.come = hear
    assert isinstance(world.outcome(job), ModeChanged) and world.mode == "LOITER"


def test_stopped_and_unloaded_in_one_breath_it_holds_and_its_parameters_are_as_before(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(world)
    world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(1.0)

    flights, abort_all = world.vision, world.vision.abort_all
    flights.abort_all = lambda: (flights.stop("stopped"), abort_all())
    world.unload(last=True)
    assert holds(world, "BRAKE")
    assert landing_parameters(world) == before


def test_closing_messages_of_an_unloaded_module_are_removed_once_its_parameters_are_restored(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    before, closing_messages = landing_parameters(world), world.host.closing_messages
    world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(1.0)
    hear = world.come
    silent(world, "PARAM_VALUE")
    world.unload()
    world.pass_time(5.0)
    assert world.vision.closing_messages in closing_messages
    world.come = hear
    world.until(lambda: world.vision.closing_messages not in closing_messages, step=0.05)
    assert landing_parameters(world) == before


def test_what_is_on_its_way_to_land_by_landing_target_refuses_movements(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    hear = unheard(world, "LAND")
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(0.2)
    other = world.fly(lambda one: world.known.go_to(one, NedTarget(30, 0, -9)), "/movement/go_to_ned")
    assert world.outcome(other).code == "busy"
    world.come = hear
    assert world.outcome(job).startswith("Landed on tag 0")


def test_a_landing_target_that_supersedes_another_gives_back_what_was_before_both(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(world)
    world.land(method="landing_target")
    world.until(lambda: world.simulator.parameters["PLND_ENABLED"] == 1, step=0.05)
    second = world.land(method="landing_target")
    during: list[float] = []
    world.each_step.append(
        lambda: during.append(world.simulator.parameters["PLND_ENABLED"]) if world.mode == "LAND" else None
    )
    assert world.outcome(second).startswith("Landed on tag 0")
    assert set(during[:-50]) == {1}
    assert landing_parameters(world) == before


@pytest.mark.parametrize("pause", [long(0.0), 1.1])
def test_parameters_are_given_back_after_two_landings_in_a_row(flying, pause):
    world = flying(alt=5.0, precision_landing=True, **LARGE)
    for name, value in (("PLND_RET_MAX", 4), ("PLND_ALT_MAX", 8), ("PLND_STRICT", 2), ("PLND_ALT_MIN", 0.75)):
        world.simulator.parameters.set(name, value)
    before = landing_parameters(world)
    hear = world.come
    late = [world.loop.call_later(0, int)]

    def slowly(message: Any) -> None:
        if message.get_type() == "PARAM_VALUE":
            late.append(world.loop.call_at(max(world.now + 0.15, late[-1].when() + 1e-6), hear, message))
        else:
            hear(message)

    world.come = slowly
    first = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.stop()
    world.outcome(first)
    world.pass_time(pause)
    world.until(lambda: world.known.mode == "BRAKE", step=0.05)
    world.outcome(world.fly(lambda job: world.known.set_mode(job, "GUIDED"), "/command/guided"))
    during: list[dict[str, float]] = []
    world.each_step.append(
        lambda: during.append(landing_parameters(world)) if world.mode == "LAND" and world.vision.running else None
    )
    assert world.outcome(world.land(method="landing_target")).startswith("Landed on tag 0")
    expected = {name: WANTED[name] for name in LANDING_PARAMETERS}
    assert during[100] == expected
    world.pass_time(20.0)
    assert landing_parameters(world) == before


@pytest.mark.parametrize("answers", ["slow", "lost"])
def test_pilot_who_switches_while_parameters_are_set_ends_that(flying, answers):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    for name, value in (("PLND_RET_MAX", 4), ("PLND_ALT_MAX", 8), ("PLND_STRICT", 2), ("PLND_ALT_MIN", 0.75)):
        world.simulator.parameters.set(name, value)
    before, hear = landing_parameters(world), world.come

    def hampered(message: Any) -> None:
        if message.get_type() != "PARAM_VALUE":
            hear(message)
        elif answers == "slow":
            world.loop.call_later(0.5, hear, message)

    job = world.land(method="landing_target")
    world.until(lambda: sent(world, "PARAM_SET"), step=0.05)
    world.come = hampered
    pilot(world, 5)
    world.until(lambda: world.known.mode == "LOITER", step=0.05)
    mark = len(world.sent)
    world.pass_time(0.1)
    assert isinstance(world.outcome(job), ModeChanged)
    world.pass_time(2.0)
    world.come = hear
    world.pass_time(20.0)
    assert [m.param_id for m in sent(world, "PARAM_SET", mark) if m.param_value != before[m.param_id]] == []
    assert landing_parameters(world) == before
    assert world.mode == "LOITER"


def test_closing_messages_are_not_cut_short_by_the_next_flight(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(1.0)
    deliver = world.arrive

    async def in_turns(message: Any, _system: int) -> None:  # MAVProxy's main loop turns every 20 ms
        await asyncio.sleep(0.02)
        deliver(message)

    world.send = in_turns
    world.stop()
    world.pass_time(0.05)
    job._task.cancel()
    assert holds(world, "BRAKE")


def test_a_landing_that_is_stopped_before_it_took_over_leaves_the_one_under_way_alone(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    first = world.land(method="landing_target")
    world.until(lambda: world.mode == "GUIDED" and world.simulator.parameters["PLND_ENABLED"] == 1, step=0.05)
    ask = world.known.parameters.read

    async def slowly(names: Any) -> Any:
        await asyncio.sleep(5.0)
        return await ask(names)

    world.known.parameters.read = slowly
    second = world.land(method="landing_target")
    world.pass_time(0.2)
    world.abort(second)
    world.known.parameters.read = ask
    assert world.outcome(first).startswith("Landed on tag 0")


# -- what goes wrong in LAND -----------------------------------------------------------------------------------


def test_without_positions_land_is_taken_back_and_ends(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(2.0)
    silent(world, "LOCAL_POSITION_NED")
    world.until(lambda: world.mode == "GUIDED", 10, step=0.05)
    error = world.outcome(job)
    assert isinstance(error, LandingFailed)
    world.pass_time(5.0)
    assert world.simulator.parameters["PLND_ENABLED"] == 0


def test_a_landing_by_landing_target_ends_at_the_time_limit(flying):
    world = flying(alt=5.0, precision_landing=True, time_limit=10, **LARGE)
    world.simulator.parameters.set("LAND_SPD_MS", 0.3)
    world.simulator.parameters.set("LAND_SPD_HIGH_MS", 0.3)
    error = world.outcome(world.land(method="landing_target"))
    assert isinstance(error, LandingFailed)
    assert "not landed within 10 s" in str(error)
    assert error.report["action"] == "rtl"


def test_parameters_are_given_back_when_a_lost_link_returns(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(world)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(1.0)
    world.simulator.faults.silence(world.copter.now, 7.0, sending=True, receiving=True)
    assert isinstance(world.outcome(job), LinkLost)
    assert landing_parameters(world) != before
    world.pass_time(20.0)
    assert landing_parameters(world) == before


@pytest.mark.parametrize("stuck", ["PLND_ENABLED", long("PLND_ALT_MAX")])
def test_a_parameter_that_cannot_be_given_back_does_not_keep_it_from_returning(flying, stuck):
    world = flying(alt=4.5, precision_landing=True, attempts=1, **LARGE)
    world.simulator.parameters.set("PLND_ALT_MAX", 8)
    before = landing_parameters(world)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.eye.blind = lambda _: True
    parameters = world.simulator.parameters
    take = parameters.set
    parameters.set = lambda name, value: take(name, parameters[name] if name == stuck else value)
    error = world.outcome(job)
    assert isinstance(error, LandingFailed)
    assert error.report["action"] == "rtl"
    assert ("does not take PLND_ENABLED = 0" in str(error)) == (stuck == "PLND_ENABLED")
    parameters.set = take  # it was a bad link, say
    world.pass_time(30.0)
    assert landing_parameters(world) == before


def test_a_landing_that_succeeded_is_one_even_when_the_battery_is_pulled_at_once(flying):
    world = flying(precision_landing=True, **LARGE)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.until(lambda: world.copter.armed is False, step=0.05)
    world.pass_time(2.5)  # what tells a landing from a fall
    world.simulator.faults.silence(world.copter.now, 1000, sending=True, receiving=True)
    assert world.outcome(job).startswith("Landed on tag 0")


def test_motors_that_stop_in_flight_are_no_landing(flying):
    world = flying(alt=6.0, precision_landing=True, **LARGE)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(1.5)
    world.deliver(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0))
    error = world.outcome(job)
    assert isinstance(error, NotArmed)
    assert "fell" in str(error)


def test_a_target_that_is_no_number_is_not_reported_and_the_landing_goes_on_by_itself(flying):
    world = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(world)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.pass_time(1.5)
    world.tracker.target.place[:] = math.nan
    assert "a number in it is not finite" in str(world.outcome(job))
    world.pass_time(3.0)
    assert world.mode == "LAND"
    assert landing_parameters(world) == before
    assert all(is_finite(one.message) for one in world.sent)


def test_pilot_who_takes_it_while_precision_landing_is_switched_off_keeps_it(
    flying: Callable[..., VisionWorld],
) -> None:
    world = flying(precision_landing=True, alt=5.0, attempts=1)
    world.eye.blind = lambda pose: -pose[0][2] < 3.0
    world.each_step.append(lambda: setattr(world.eye, "blind", lambda _: True) if -world.at.down < 3.0 else None)
    job = world.land(method="landing_target")
    world.until(lambda: world.mode == "LAND", step=0.05)
    world.until(lambda: world.mode == "GUIDED", step=0.05)
    since = len(world.sent)
    while not sent(world, "PARAM_REQUEST_READ", since):
        world.pass_time(0.01)
    hear = world.come
    silent(world, "HEARTBEAT")
    since = len(world.sent)
    pilot(world, MODES["LOITER"])
    world.pass_time(0.9)
    world.come = hear
    assert world.outcome(job).code == "mode_changed"
    modes = [message for message in sent(world, "COMMAND_LONG", since) if message.command == SWITCH_MODE]
    assert modes == [] and world.mode == "LOITER"
