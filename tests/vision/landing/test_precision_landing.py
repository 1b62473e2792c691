"""LANDING_TARGET in LAND, and the PLND parameters that are set for it and given back."""

from __future__ import annotations

import asyncio
import math
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
    until,
)

pytestmark = pytest.mark.matrix


@pytest.mark.parametrize(("forward", "right"), [(1.0, 0.5), (-1.0, 0.5), (0.3, -2.0)])
def test_the_angles_of_landing_target_mean_the_same_as_its_position(forward, right):
    message = landing_target(1.0, vector(forward, right, 4.0), Attitude())
    reported = (-math.tan(message.angle_y), math.tan(message.angle_x))  # as AC_PrecLand_MAVLink.cpp reads them
    assert reported == pytest.approx((forward / 4.0, right / 4.0))
    assert (message.x, message.y, message.z) == pytest.approx((forward, right, 4.0))


# -- stopped, and taken over -----------------------------------------------------------------------------------


def test_stopped_in_land_by_landing_target_it_holds_and_its_parameters_are_as_before(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(rig)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(2.0)
    assert rig.stop()
    rig.outcome(job)
    assert holds(rig, "BRAKE")
    assert landing_parameters(rig) == before


@pytest.mark.parametrize("switch_after", [0.3, 1.0])  # s of silence, of which 1.2 s would have it taken back
def test_a_pilot_who_takes_it_while_the_telemetry_is_silent_keeps_it(flying, switch_after):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.copter.mode == "LAND")
    rig.pass_time(1.5)
    hear, rig.host._receive = rig.host._receive, lambda _message: None
    rig.pass_time(switch_after)
    pilot(rig, MODES["LOITER"])
    began = len(rig.wire.sent)
    rig.pass_time(3.0 - switch_after)
    rig.host._receive = hear
    rig.pass_time(3.0)
    switches = [m for m in rig.wire.sent[began:] if m.get_type() == "COMMAND_LONG" and m.command == SWITCH_MODE]
    assert switches == [] and rig.mode == "LOITER"
    assert isinstance(rig.outcome(job), ModeChanged)


def test_a_pilot_who_takes_it_as_the_tag_is_lost_keeps_it(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.copter.mode == "LAND")
    rig.pass_time(1.5)
    rig.eye.blind = lambda _detection: True
    hear = unheard(rig, "LOITER")
    rig.pass_time(1.0)
    pilot(rig, MODES["LOITER"])
    rig.pass_time(1.5)
    rig.host._receive = hear
    assert isinstance(rig.outcome(job), ModeChanged) and rig.mode == "LOITER"


def test_stopped_and_unloaded_in_one_breath_it_holds_and_its_parameters_are_as_before(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(rig)
    rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)

    flights, abort_all = rig.flights, rig.flights.abort_all
    flights.abort_all = lambda: (flights.stop("stopped"), abort_all())
    rig.unload(last=True)
    assert holds(rig, "BRAKE")
    assert landing_parameters(rig) == before


def test_closing_messages_of_an_unloaded_module_are_removed_once_its_parameters_are_restored(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    before, closing_messages = landing_parameters(rig), rig.host.closing_messages
    rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)
    hear = rig.host._receive
    silent(rig, "PARAM_VALUE")
    rig.unload()
    rig.pass_time(5.0)
    assert rig.flights.closing_messages in closing_messages
    rig.host._receive = hear
    until(rig, lambda: rig.flights.closing_messages not in closing_messages)
    assert landing_parameters(rig) == before


def test_what_is_on_its_way_to_land_by_landing_target_refuses_movements(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    hear = unheard(rig, "LAND")
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(0.2)
    other = rig.begin(lambda one: rig.copter.go_to(one, NedTarget(30, 0, -9)), "/movement/go_to_ned")
    assert rig.outcome(other).code == "busy"
    rig.host._receive = hear
    assert rig.outcome(job).startswith("Landed on tag 0")


def test_a_landing_target_that_supersedes_another_gives_back_what_was_before_both(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(rig)
    rig.land(method="landing_target")
    until(rig, lambda: rig.simulator.parameters["PLND_ENABLED"] == 1)
    second = rig.land(method="landing_target")
    during: list[float] = []
    rig.each_step.append(
        lambda: during.append(rig.simulator.parameters["PLND_ENABLED"]) if rig.mode == "LAND" else None
    )
    assert rig.outcome(second).startswith("Landed on tag 0")
    assert set(during[:-50]) == {1}
    assert landing_parameters(rig) == before


@pytest.mark.parametrize("pause", [long(0.0), 1.1])
def test_parameters_are_given_back_after_two_landings_in_a_row(flying, pause):
    rig = flying(alt=5.0, precision_landing=True, **LARGE)
    for name, value in (("PLND_RET_MAX", 4), ("PLND_ALT_MAX", 8), ("PLND_STRICT", 2), ("PLND_ALT_MIN", 0.75)):
        rig.simulator.parameters.set(name, value)
    before = landing_parameters(rig)
    hear = rig.host._receive
    late = [rig.loop.call_later(0, int)]

    def slowly(message: Any) -> None:
        if message.get_type() == "PARAM_VALUE":
            late.append(rig.loop.call_at(max(rig.loop.time() + 0.15, late[-1].when() + 1e-6), hear, message))
        else:
            hear(message)

    rig.host._receive = slowly
    first = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.stop()
    rig.outcome(first)
    rig.pass_time(pause)
    until(rig, lambda: rig.copter.mode == "BRAKE")
    rig.outcome(rig.begin(lambda job: rig.copter.set_mode(job, "GUIDED"), "/command/guided"))
    during: list[dict[str, float]] = []
    rig.each_step.append(
        lambda: during.append(landing_parameters(rig)) if rig.mode == "LAND" and rig.flights.running else None
    )
    assert rig.outcome(rig.land(method="landing_target")).startswith("Landed on tag 0")
    expected = {name: WANTED[name] for name in LANDING_PARAMETERS}
    assert during[100] == expected
    rig.pass_time(20.0)
    assert landing_parameters(rig) == before


@pytest.mark.parametrize("answers", ["slow", "lost"])
def test_pilot_who_switches_while_parameters_are_set_ends_that(flying, answers):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    for name, value in (("PLND_RET_MAX", 4), ("PLND_ALT_MAX", 8), ("PLND_STRICT", 2), ("PLND_ALT_MIN", 0.75)):
        rig.simulator.parameters.set(name, value)
    before, hear = landing_parameters(rig), rig.host._receive

    def hampered(message: Any) -> None:
        if message.get_type() != "PARAM_VALUE":
            hear(message)
        elif answers == "slow":
            rig.loop.call_later(0.5, hear, message)

    job = rig.land(method="landing_target")
    until(rig, lambda: sent(rig, "PARAM_SET"))
    rig.host._receive = hampered
    pilot(rig, 5)
    until(rig, lambda: rig.copter.mode == "LOITER")
    mark = len(rig.wire.sent)
    rig.pass_time(0.1)
    assert isinstance(rig.outcome(job), ModeChanged)
    rig.pass_time(2.0)
    rig.host._receive = hear
    rig.pass_time(20.0)
    assert [m.param_id for m in sent(rig, "PARAM_SET", mark) if m.param_value != before[m.param_id]] == []
    assert landing_parameters(rig) == before
    assert rig.mode == "LOITER"


def test_closing_messages_are_not_cut_short_by_the_next_flight(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)
    deliver = rig.wire.deliver

    async def in_turns(message: Any, _system: int) -> None:  # MAVProxy's main loop turns every 20 ms
        await asyncio.sleep(0.02)
        deliver(message)

    rig.wire.send = in_turns
    rig.stop()
    rig.pass_time(0.05)
    job._task.cancel()
    assert holds(rig, "BRAKE")


def test_a_landing_that_is_stopped_before_it_took_over_leaves_the_one_under_way_alone(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    first = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "GUIDED" and rig.simulator.parameters["PLND_ENABLED"] == 1)
    ask = rig.copter.parameters.read

    async def slowly(names: Any) -> Any:
        await asyncio.sleep(5.0)
        return await ask(names)

    rig.copter.parameters.read = slowly
    second = rig.land(method="landing_target")
    rig.pass_time(0.2)
    rig.abort(second)
    rig.copter.parameters.read = ask
    assert rig.outcome(first).startswith("Landed on tag 0")


# -- what goes wrong in LAND -----------------------------------------------------------------------------------


def test_without_positions_land_is_taken_back_and_ends(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(2.0)
    silent(rig, "LOCAL_POSITION_NED")
    until(rig, lambda: rig.mode == "GUIDED", 10)
    error = rig.outcome(job)
    assert isinstance(error, LandingFailed)
    rig.pass_time(5.0)
    assert rig.simulator.parameters["PLND_ENABLED"] == 0


def test_a_landing_by_landing_target_ends_at_the_time_limit(flying):
    rig = flying(alt=5.0, precision_landing=True, time_limit=10, **LARGE)
    rig.simulator.parameters.set("LAND_SPD_MS", 0.3)
    rig.simulator.parameters.set("LAND_SPD_HIGH_MS", 0.3)
    error = rig.outcome(rig.land(method="landing_target"))
    assert isinstance(error, LandingFailed)
    assert "not landed within 10 s" in str(error)
    assert error.report["action"] == "rtl"


def test_parameters_are_given_back_when_a_lost_link_returns(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(rig)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)
    rig.simulator.faults.silence(rig.simulator.copter.now, 7.0, sending=True, receiving=True)
    assert isinstance(rig.outcome(job), LinkLost)
    assert landing_parameters(rig) != before
    rig.pass_time(20.0)
    assert landing_parameters(rig) == before


@pytest.mark.parametrize("stuck", ["PLND_ENABLED", long("PLND_ALT_MAX")])
def test_a_parameter_that_cannot_be_given_back_does_not_keep_it_from_returning(flying, stuck):
    rig = flying(alt=4.5, precision_landing=True, attempts=1, **LARGE)
    rig.simulator.parameters.set("PLND_ALT_MAX", 8)
    before = landing_parameters(rig)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.eye.blind = lambda _: True
    parameters = rig.simulator.parameters
    take = parameters.set
    parameters.set = lambda name, value: take(name, parameters[name] if name == stuck else value)
    error = rig.outcome(job)
    assert isinstance(error, LandingFailed)
    assert error.report["action"] == "rtl"
    assert ("does not take PLND_ENABLED = 0" in str(error)) == (stuck == "PLND_ENABLED")
    parameters.set = take  # it was a bad link, say
    rig.pass_time(30.0)
    assert landing_parameters(rig) == before


def test_a_landing_that_succeeded_is_one_even_when_the_battery_is_pulled_at_once(flying):
    rig = flying(precision_landing=True, **LARGE)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    until(rig, lambda: rig.simulator.copter.armed is False)
    rig.pass_time(2.5)  # what tells a landing from a fall
    rig.simulator.faults.silence(rig.simulator.copter.now, 1000, sending=True, receiving=True)
    assert rig.outcome(job).startswith("Landed on tag 0")


def test_motors_that_stop_in_flight_are_no_landing(flying):
    rig = flying(alt=6.0, precision_landing=True, **LARGE)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.5)
    rig.wire.deliver(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0))
    error = rig.outcome(job)
    assert isinstance(error, NotArmed)
    assert "fell" in str(error)


def test_a_target_that_is_no_number_is_not_reported_and_the_landing_goes_on_by_itself(flying):
    rig = flying(alt=4.5, precision_landing=True, **LARGE)
    before = landing_parameters(rig)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.5)
    rig.tracker.target.place[:] = math.nan
    assert "a number in it is not finite" in str(rig.outcome(job))
    rig.pass_time(3.0)
    assert rig.mode == "LAND"
    assert landing_parameters(rig) == before
    assert all(map(is_finite, rig.wire.sent))


def test_pilot_who_takes_it_while_precision_landing_is_switched_off_keeps_it(flying: Any) -> None:
    rig = flying(precision_landing=True, alt=5.0, attempts=1)
    rig.eye.blind = lambda pose: -pose[0][2] < 3.0
    rig.each_step.append(lambda: setattr(rig.eye, "blind", lambda _: True) if -rig.truth.down < 3.0 else None)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    until(rig, lambda: rig.mode == "GUIDED")
    since = len(rig.wire.sent)
    while not sent(rig, "PARAM_REQUEST_READ", since):
        rig.pass_time(0.01)
    hear = rig.host._receive
    silent(rig, "HEARTBEAT")
    since = len(rig.wire.sent)
    pilot(rig, MODES["LOITER"])
    rig.pass_time(0.9)
    rig.host._receive = hear
    assert rig.outcome(job).code == "mode_changed"
    modes = [message for message in sent(rig, "COMMAND_LONG", since) if message.command == SWITCH_MODE]
    assert modes == [] and rig.mode == "LOITER"
