"""How a flight ends from outside, and what else has the vehicle: stops, newer flights, another vehicle, silence."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import Invalid, LinkLost, ModeChanged, NotArmed
from mavproxy_uavapi.core.mavlink.link import is_finite
from mavproxy_uavapi.core.vehicle.messages import NedTarget, VelocityTarget
from mavproxy_uavapi.sim.mission import Item
from mavproxy_vision.errors import LandingFailed
from mavproxy_vision.geometry.frames import Attitude, vector
from mavproxy_vision.landing.mission import MissionPlan
from mavproxy_vision.landing.precision_landing import WANTED, landing_target
from mavproxy_vision.landing.state_machine import Landing, LandingCommand, Phase

TAG = "0:0.30@0.8,-0.6"
FAR_TAG = "0:0.30@1.6,-1.2"
LARGE = {"tags": "0:0.6", "sim_tags": "0:0.6@0.8,-0.6"}
SMALL = {"width": 320, "height": 240, "fps": 12.0, "sim_noise": 3.0, "sim_jitter": 0.0}
SWITCH_MODE, TAKEOFF = 176, 22
PLND = ("PLND_ENABLED", "PLND_STRICT", "PLND_RET_MAX", "PLND_ALT_MIN", "PLND_ALT_MAX")


@pytest.fixture
def flying(lockstep: Any) -> Any:
    """A vehicle some metres above home: `flying(alt=6, sim_tags=…)`."""

    def make(alt: float = 5.0, **settings: Any) -> Any:
        rig = lockstep(**{"sim_tags": TAG, **SMALL, **settings})
        rig.start(alt)
        return rig

    return make


def height(rig: Any) -> float:
    return -float(rig.truth.down)


def until(rig: Any, condition: Any, limit: float = 60.0) -> None:
    for _ in range(round(limit / 0.05)):
        if condition():
            return
        rig.pass_time(0.05)
    raise AssertionError("it did not happen")


def sent(rig: Any, kind: str, since: int = 0) -> list[Any]:
    return [message for message in rig.wire.sent[since:] if message.get_type() == kind]


def plnd(rig: Any) -> dict[str, float]:
    return {name: rig.simulator.parameters[name] for name in PLND}


def silent(rig: Any, name: str) -> None:
    """From now on nobody hears that message."""
    hear = rig.host._receive
    rig.host._receive = lambda message: None if message.get_type() == name else hear(message)


def unheard(rig: Any, mode: str) -> Any:
    """From now on nobody hears a heartbeat of that mode; what has to be put back to hear it."""
    hear = rig.host._receive
    rig.host._receive = lambda message: (
        None if message.get_type() == "HEARTBEAT" and message.custom_mode == MODES[mode] else hear(message)
    )
    return hear


def holds(rig: Any, mode: str = "GUIDED", seconds: float = 10.0) -> bool:
    """Whether it stays where it is, armed, in that mode: what the autopilot flew by itself is left by BRAKE."""
    rig.pass_time(3.0)
    before = height(rig)
    rig.pass_time(seconds)
    return rig.mode == mode and rig.simulator.copter.armed and abs(height(rig) - before) < 0.5


# -- stopped while the autopilot flies for us ----------------------------------------------------------------


@pytest.mark.parametrize("action", ["land", "rtl"])
def test_stopped_in_what_a_failed_landing_does_it_holds(flying, action):
    rig = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure=action)
    job = rig.land()
    until(rig, lambda: rig.mode == action.upper())
    rig.pass_time(1.0)
    assert rig.stop()
    assert str(rig.outcome(job)) == "stopped; the vehicle is told to hold"
    assert holds(rig, "BRAKE")


def test_stopped_in_land_by_landing_target_it_holds_and_plnd_is_as_before(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    before = plnd(rig)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(2.0)
    assert rig.stop()
    rig.outcome(job)
    assert holds(rig, "BRAKE")
    assert plnd(rig) == before


def test_stopped_in_the_pilots_mode_nothing_is_sent_and_nothing_else_is_said(flying):
    rig = flying()
    job = rig.land()
    rig.pass_time(2.0)
    rig.simulator.copter.sticks.move(3, 1500)
    rig.simulator.copter.set_mode(5)
    mark = len(rig.wire.sent)
    until(rig, lambda: rig.copter.mode == "LOITER" or not job.running)
    if job.running:
        rig.stop()
    rig.outcome(job)
    rig.pass_time(2.0)
    assert rig.mode == "LOITER"
    assert not [m for m in sent(rig, "COMMAND_LONG", mark) if m.command == SWITCH_MODE]


@pytest.mark.parametrize("after", [0.0, 0.3, 0.8, 1.5])
def test_a_mission_that_is_stopped_at_its_takeoff_does_not_take_off(lockstep, after):
    rig = lockstep(sim_tags=TAG, **SMALL)
    rig.switch_on()
    rig.open_eye()
    job = rig.begin(rig.flights.errand(rig.copter, MissionPlan(alt=5, north=8, east=-5)))
    until(rig, lambda: any(m.command == TAKEOFF for m in sent(rig, "COMMAND_LONG")))
    rig.pass_time(after)
    rig.stop()
    rig.outcome(job)
    rig.pass_time(8.0)
    assert height(rig) < 1.5


def test_one_lost_message_does_not_keep_it_from_holding(flying):
    rig = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure="land")
    job = rig.land()
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)
    deliver, lost = rig.wire.deliver, []

    def lossy(message: Any) -> None:
        if message.get_type() == "COMMAND_LONG" and message.command == SWITCH_MODE and not lost:
            lost.append(message)
        else:
            deliver(message)

    rig.wire.deliver = lossy
    rig.stop()
    rig.outcome(job)
    assert holds(rig, "BRAKE")
    assert lost


def test_stopped_and_unloaded_in_one_breath_it_holds_and_plnd_is_as_before(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    before = plnd(rig)
    rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)

    flights, abort_all = rig.flights, rig.flights.abort_all
    flights.abort_all = lambda: (flights.stop("stopped"), abort_all())
    rig.unload(last=True)
    assert holds(rig, "BRAKE")
    assert plnd(rig) == before


def test_last_words_of_an_unloaded_module_go_when_its_parameters_are_given_back(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    before, words = plnd(rig), rig.host.last_words
    rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)
    hear = rig.host._receive
    silent(rig, "PARAM_VALUE")
    rig.unload()
    rig.pass_time(5.0)
    assert rig.flights.last_words in words
    rig.host._receive = hear
    until(rig, lambda: rig.flights.last_words not in words)
    assert plnd(rig) == before


def test_unloaded_in_the_autopilots_land_it_lands(flying):
    rig = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure="land")
    job = rig.land()
    until(rig, lambda: rig.mode == "LAND")
    rig.unload()
    assert "left alone: it is in LAND" in str(rig.outcome(job))
    mark = len(rig.wire.sent)
    until(rig, lambda: not rig.simulator.copter.armed)
    assert rig.mode == "LAND"
    assert not sent(rig, "SET_POSITION_TARGET_LOCAL_NED", mark)


def test_a_mission_that_is_stopped_holds_before_it_writes_its_track(flying):
    rig = flying()
    rig.flights._directory = lambda: (_ for _ in ()).throw(RuntimeError("no home directory"))
    job = rig.begin(rig.flights.errand(rig.copter, MissionPlan(alt=20, north=60, east=0)))
    rig.pass_time(4.0)
    assert rig.stop()
    error = rig.outcome(job)
    assert "told to hold" in str(error)
    assert holds(rig)
    assert rig.flights.report.track == "not written: no home directory"


# -- every flight, ended in every way ------------------------------------------------------------------------

FLIGHTS = ["land", "landing_target", "search", "takeoff", "leg"]


def under_way(lockstep: Any, name: str) -> tuple[Any, Any]:
    """A flight of that kind in its middle, and its job."""
    precise = name == "landing_target"
    rig = lockstep(**{**SMALL, "sim_tags": TAG if name == "land" else "", **(LARGE if precise else {})}, plnd=precise)
    if name in ("takeoff", "leg"):
        rig.switch_on()
        rig.open_eye()
        errand = MissionPlan(alt=10, north=60, east=0, on_tag=False)
        job = rig.begin(rig.flights.errand(rig.copter, errand), "/vision/mission")
        until(rig, lambda: any(m.command == TAKEOFF for m in sent(rig, "COMMAND_LONG")))
        until(rig, lambda: rig.truth.north > 2.0 if name == "leg" else height(rig) > 0.5)
        return rig, job
    rig.start(7.0)
    rig.before = plnd(rig)
    if name == "search":
        job = rig.begin(rig.flights.searching(rig.copter, None, None), "/vision/search")
        until(rig, lambda: "searching" in rig.flights.phase)
        rig.pass_time(1.5)
        return rig, job
    job = rig.land(method="landing_target" if precise else "velocity")
    until(rig, lambda: rig.copter.mode == "LAND" if precise else "descending" in rig.flights.phase)
    rig.pass_time(1.0)
    return rig, job


def pilot(rig: Any, mode: int) -> None:
    """The pilot switches; for AUTO there is a mission."""
    rig.simulator.copter.sticks.move(3, 1500)
    item = Item(mavlink.MAV_CMD_NAV_LOITER_UNLIM, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, 0, 0, 0, 0, 0, 0, 10.0)
    rig.simulator.copter.mission.replace([item, item])
    assert rig.simulator.copter.set_mode(mode)


def client(rig: Any, verb: Any) -> None:
    """Somebody else's verb."""
    rig.begin(lambda job: verb(rig.copter, job), "/command/other")
    rig.pass_time(0.2)


def defect(rig: Any, _job: Any) -> None:
    """A bug in what flies: the next thing that the flight asks fails."""
    rig.loop.set_exception_handler(lambda _loop, _context: None)  # it is told there, too

    def broken(*_: Any) -> Any:
        del rig.copter.held_by, rig.tracker.now  # once: what sees to the vehicle afterwards asks too
        raise ZeroDivisionError("a defect")

    rig.copter.held_by, rig.tracker.now = broken, broken
    rig.pass_time(0.3)


# How it ends, the error of its client, and the mode that follows what is flown in GUIDED, and what is flown in LAND.
ENDS: dict[str, tuple[Any, str, str, str]] = {
    "DELETE": (lambda rig, job: rig.abort(job), "aborted", "GUIDED", "BRAKE"),
    "vision stop": (lambda rig, _: rig.stop(), "aborted", "GUIDED", "BRAKE"),
    "unload": (lambda rig, _: rig.unload(), "aborted", "GUIDED", "LAND"),
    "unload of the last module": (lambda rig, _: rig.unload(last=True), "aborted", "GUIDED", "LAND"),
    "defect": (defect, "internal", "GUIDED", "LAND"),
    "another search": (
        lambda rig, _: rig.begin(rig.flights.searching(rig.copter, 3, 2.0)), "superseded", "GUIDED", "",
    ),
    "movement": (
        lambda rig, _: client(rig, lambda copter, job: copter.go_to(job, NedTarget(30, 0, -9))),
        "superseded", "GUIDED", "",
    ),
    "rtl": (lambda rig, _: client(rig, lambda copter, job: copter.rtl(job)), "superseded", "RTL", "RTL"),
    "land": (lambda rig, _: client(rig, lambda copter, job: copter.land(job)), "superseded", "LAND", "LAND"),
    "brake": (
        lambda rig, _: client(rig, lambda copter, job: copter.set_mode(job, "BRAKE")), "superseded", "BRAKE", "BRAKE",
    ),
    "LOITER by the pilot": (lambda rig, _: pilot(rig, 5), "mode_changed", "LOITER", "LOITER"),
    "RTL by the pilot": (lambda rig, _: pilot(rig, 6), "mode_changed", "RTL", "RTL"),
    "AUTO by the pilot": (lambda rig, _: pilot(rig, 3), "mode_changed", "AUTO", "AUTO"),
    "disarm": (
        lambda rig, _: client(rig, lambda copter, job: copter.disarm(job, force=True)), "superseded", "", "",
    ),
    "silence": (
        lambda rig, _: rig.simulator.faults.silence(rig.simulator.copter.now, 8.0, sending=True, receiving=True),
        "link_lost", "GUIDED", "LAND",
    ),
}  # fmt: skip
REFUSED_IN_LAND = ("another search", "movement")
NOT_IN_A_TAKEOFF = ("another search", "movement")  # 409 busy
MODES = {"LAND": 9, "RTL": 6, "BRAKE": 17, "GUIDED": 4}


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("name", FLIGHTS)
def test_what_follows_a_flight_is_what_the_table_says(lockstep, name, end):
    rig, job = under_way(lockstep, name)
    act, code, after_guided, after_land = ENDS[end]
    refused = end in REFUSED_IN_LAND if name == "landing_target" else name == "takeoff" and end in NOT_IN_A_TAKEOFF
    mode = after_land if name == "landing_target" else after_guided
    act(rig, job)
    if refused:  # the flight goes on
        rig.pass_time(0.5)
        assert job.running
        return
    error = rig.outcome(job)
    assert error.code == code, error
    began = height(rig)
    rig.pass_time(0.3)
    mark = len(rig.wire.sent)
    rig.pass_time(12.0)
    if mode not in ("LAND", "RTL"):  # else it has landed, or not yet
        assert rig.simulator.copter.armed == (end != "disarm")
    if mode:
        assert rig.mode == mode
    if mode in ("GUIDED", "BRAKE") and end not in REFUSED_IN_LAND and end != "silence":
        assert math.hypot(*rig.simulator.copter.body.velocity[:2]) < 0.3
        assert height(rig) < began + 4.0  # a climb of 2.5 m/s ends at 1 m/s/s
    if name == "landing_target":
        assert plnd(rig) == rig.before
    flown = [m for m in rig.wire.sent[mark:] if m.get_type() in ("SET_POSITION_TARGET_LOCAL_NED", "LANDING_TARGET")]
    rest = [m for m in flown if m.get_type() == "LANDING_TARGET" or (m.vx, m.vy, m.vz) != (0, 0, 0)]
    assert end == "another search" or not rest
    switched = {m.param2 for m in sent(rig, "COMMAND_LONG", mark) if m.command == SWITCH_MODE}
    assert switched <= {MODES.get(mode)}


@pytest.mark.parametrize("name", FLIGHTS)
def test_stop_holds_a_flight_and_resume_does_not_take_up_what_it_flew_by(lockstep, name):
    rig, job = under_way(lockstep, name)
    answers = []

    async def begin(verb: Any, path: str) -> Any:
        async def body(one: Any) -> str:
            await verb(one)
            return "done"

        return rig.host.jobs.begin(rig.copter, path, {}, body)

    stop = rig.run(begin(rig.copter.stop, "/movement/stop"))
    answers.append(rig.outcome(stop))
    if name == "landing_target":
        assert answers[0].code == "mode_changed"
        assert job.running
        return
    assert answers == ["done"]
    rig.pass_time(0.3)
    if name in ("takeoff", "leg"):  # it waits, and goes on
        assert job.running
        rig.pass_time(2.0)
        assert float(abs(rig.simulator.copter.body.velocity[0])) < 0.3
    else:
        assert rig.outcome(job).code == "paused"
        assert rig.outcome(rig.land()).code == "paused"
    before = rig.truth
    rig.outcome(rig.run(begin(rig.copter.resume, "/movement/resume")))
    rig.pass_time(3.0)
    moved = math.dist(before, rig.truth)
    assert moved > 1.0 if job.running else moved < 0.3


@pytest.mark.parametrize("ended", ["stop", "unload"])
def test_a_flight_that_is_ended_while_it_is_prepared_never_begins(lockstep, ended):
    rig = lockstep(sim_tags=TAG, plnd=True, **SMALL)
    rig.switch_on()
    rig.open_eye()
    hear = rig.host._receive
    silent(rig, "PARAM_VALUE")
    errand = MissionPlan(alt=5, north=8, east=-5, method="landing_target")
    job = rig.begin(rig.flights.errand(rig.copter, errand), "/vision/mission")
    rig.pass_time(0.3)
    getattr(rig, ended)()
    rig.host._receive = hear
    assert rig.outcome(job).code == "aborted"
    rig.pass_time(20.0)
    assert not rig.simulator.copter.armed


@pytest.mark.parametrize("action", ["land", "rtl"])
def test_what_is_ended_before_telemetry_shows_its_mode_is_held_all_the_same(flying, action):
    rig = flying(alt=6.0, sim_tags="", attempts=1, leash=1.0, on_failure=action)
    hear = unheard(rig, action.upper())
    job = rig.land()
    until(rig, lambda: rig.mode == action.upper())
    rig.pass_time(0.2)
    assert rig.stop() == "stopped; the vehicle is told to hold"
    rig.pass_time(0.02)
    rig.host._receive = hear
    rig.outcome(job)
    assert holds(rig, "BRAKE")


def test_what_is_on_its_way_to_land_by_landing_target_refuses_movements(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    hear = unheard(rig, "LAND")
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(0.2)
    other = rig.begin(lambda one: rig.copter.go_to(one, NedTarget(30, 0, -9)), "/movement/go_to_ned")
    assert rig.outcome(other).code == "busy"
    rig.host._receive = hear
    assert rig.outcome(job).startswith("Landed on tag 0")


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


# -- newer flights -------------------------------------------------------------------------------------------


def test_a_landing_that_supersedes_another_sees(flying):
    rig = flying(sim_tags=FAR_TAG)
    first = rig.land()
    rig.pass_time(2.0)
    second = rig.land()
    assert rig.outcome(second).startswith("Landed on tag 0")
    assert rig.outcome(first).code == "superseded"


def test_a_landing_target_that_supersedes_another_gives_back_what_was_before_both(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    before = plnd(rig)
    rig.land(method="landing_target")
    until(rig, lambda: rig.simulator.parameters["PLND_ENABLED"] == 1)
    second = rig.land(method="landing_target")
    during: list[float] = []
    rig.each_step.append(
        lambda: during.append(rig.simulator.parameters["PLND_ENABLED"]) if rig.mode == "LAND" else None
    )
    assert rig.outcome(second).startswith("Landed on tag 0")
    assert set(during[:-50]) == {1}
    assert plnd(rig) == before


def test_a_flight_that_is_refused_leaves_the_one_under_way_alone(flying):
    rig = flying(sim_tags=FAR_TAG)
    first = rig.land()
    rig.pass_time(2.0)
    refused = rig.outcome(rig.land(99999))
    assert isinstance(refused, Invalid)
    assert rig.flights.running
    assert rig.outcome(first).startswith("Landed on tag 0")


def test_a_flight_that_is_refused_in_land_does_not_hide_the_one_under_way(flying):
    rig = flying()
    first = rig.land()
    until(rig, lambda: rig.mode == "LAND")
    assert isinstance(rig.outcome(rig.begin(rig.flights.searching(rig.copter, 3, None))), ModeChanged)
    assert rig.flights.running
    assert rig.flights.report.verb == "land"
    assert rig.outcome(first).startswith("Landed on tag 0")


def test_a_landing_that_cannot_be_flown_leaves_the_movement_under_way_alone(flying):
    rig = flying()  # its PLND_TYPE was 0 at boot

    async def go(job: Any) -> None:
        await rig.copter.go_to(job, NedTarget(30.0, 0.0, -8.0), wait=True)

    under_way = rig.begin(go, "/movement/go_to_ned_wait")
    rig.pass_time(2.0)
    assert "reboot" in str(rig.outcome(rig.land(method="landing_target")))
    assert rig.outcome(under_way) == "done"
    assert rig.truth.north == pytest.approx(30, abs=1.5)


def test_a_landing_that_takes_over_stops_what_was_flown(flying):
    rig = flying(sim_tags=FAR_TAG)

    async def drive(job: Any) -> None:
        await rig.copter.travel(job, VelocityTarget(0.0, 3.0, 0.0), duration=20)

    rig.begin(drive, "/movement/travel")
    rig.pass_time(2.0)
    want = rig.tracker.want

    async def slowly(number: int) -> None:
        await asyncio.sleep(2.0)
        await want(number)

    rig.tracker.want = slowly
    mark = len(rig.wire.sent)
    rig.land()
    rig.pass_time(0.2)
    told = sent(rig, "SET_POSITION_TARGET_LOCAL_NED", mark)
    assert told
    assert (told[-1].vx, told[-1].vy, told[-1].vz) == (0, 0, 0)


@pytest.mark.parametrize("pause", [0.0, 1.1])
def test_parameters_are_given_back_after_two_landings_in_a_row(flying, pause):
    rig = flying(alt=7.0, plnd=True, **LARGE)
    for name, value in (("PLND_RET_MAX", 4), ("PLND_ALT_MAX", 8), ("PLND_STRICT", 2), ("PLND_ALT_MIN", 0.75)):
        rig.simulator.parameters.set(name, value)
    before = plnd(rig)
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
    rig.each_step.append(lambda: during.append(plnd(rig)) if rig.mode == "LAND" and rig.flights.running else None)
    assert rig.outcome(rig.land(method="landing_target")).startswith("Landed on tag 0")
    wanted = {name: WANTED[name] for name in PLND}
    assert during[100] == wanted
    rig.pass_time(20.0)
    assert plnd(rig) == before


@pytest.mark.parametrize("answers", ["slow", "lost"])
def test_pilot_who_switches_while_parameters_are_set_ends_that(flying, answers):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    for name, value in (("PLND_RET_MAX", 4), ("PLND_ALT_MAX", 8), ("PLND_STRICT", 2), ("PLND_ALT_MIN", 0.75)):
        rig.simulator.parameters.set(name, value)
    before, hear = plnd(rig), rig.host._receive

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
    assert plnd(rig) == before
    assert rig.mode == "LOITER"


def test_a_parting_is_not_cut_short_by_the_next_flight(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
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


# -- another vehicle -----------------------------------------------------------------------------------------


def other_vehicle(rig: Any) -> None:
    """A second copter on the link, parked elsewhere and turned round."""
    encode, decode = mavlink.MAVLink(None, srcSystem=2, srcComponent=1), mavlink.MAVLink(None)
    count = [0]

    def say() -> None:
        count[0] += 1
        if count[0] % 40:
            return
        at = int((rig.loop.time() - 900) * 1000)
        for message in (
            mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3),
            mavlink.MAVLink_attitude_message(at, 0, 0, math.radians(173), 0, 0, 0),
            mavlink.MAVLink_local_position_ned_message(at, 40, 30, 0, 0, 0, 0),
            mavlink.MAVLink_global_position_int_message(at, 0, 0, 0, 0, 0, 0, 0, 0),
        ):
            for decoded in decode.parse_buffer(message.pack(encode)):
                rig.host._receive(decoded)

    rig.each_step.append(say)


def test_a_change_of_mavproxys_vehicle_does_not_change_who_lands(flying):
    rig = flying(sim_tags=FAR_TAG)
    other_vehicle(rig)
    job = rig.land()
    rig.pass_time(1.5)
    rig.host.registry.current = 2
    result = rig.outcome(job)
    assert str(result).startswith("Landed on tag 0"), result
    assert math.hypot(rig.truth.north - 1.6, rig.truth.east + 1.2) < 0.2
    assert {m.target_system for m in sent(rig, "SET_POSITION_TARGET_LOCAL_NED")} == {1}


# -- what is not told, or no number --------------------------------------------------------------------------


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
    assert "has not told where it is" in str(error)
    assert error.report["action"] == "rtl"


def test_without_positions_land_is_taken_back_and_ends(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
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
    rig = flying(alt=7.0, plnd=True, time_limit=10, **LARGE)
    rig.simulator.parameters.set("LAND_SPEED", 30)
    rig.simulator.parameters.set("LAND_SPEED_HIGH", 30)
    error = rig.outcome(rig.land(method="landing_target"))
    assert isinstance(error, LandingFailed)
    assert "not landed within 10 s" in str(error)
    assert error.report["action"] == "rtl"


def test_parameters_are_given_back_when_a_lost_link_returns(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    before = plnd(rig)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.0)
    rig.simulator.faults.silence(rig.simulator.copter.now, 7.0, sending=True, receiving=True)
    assert isinstance(rig.outcome(job), LinkLost)
    assert plnd(rig) != before
    rig.pass_time(20.0)
    assert plnd(rig) == before


@pytest.mark.parametrize("stuck", ["PLND_ENABLED", "PLND_ALT_MAX"])
def test_a_parameter_that_cannot_be_given_back_does_not_keep_it_from_returning(flying, stuck):
    rig = flying(alt=6.0, plnd=True, attempts=1, **LARGE)
    rig.simulator.parameters.set("PLND_ALT_MAX", 8)
    before = plnd(rig)
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
    assert plnd(rig) == before


def test_a_landing_that_succeeded_is_one_even_when_the_battery_is_pulled_at_once(flying):
    rig = flying(plnd=True, **LARGE)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    until(rig, lambda: rig.simulator.copter.armed is False)
    rig.pass_time(2.5)  # what tells a landing from a fall
    rig.simulator.faults.silence(rig.simulator.copter.now, 1000, sending=True, receiving=True)
    assert rig.outcome(job).startswith("Landed on tag 0")


def test_a_return_that_is_refused_is_told_with_the_reason_of_the_landing(flying):
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


def test_a_landing_that_is_stopped_before_it_took_over_leaves_the_one_under_way_alone(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
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


def test_motors_that_stop_in_flight_are_no_landing(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.5)
    rig.wire.deliver(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0))
    error = rig.outcome(job)
    assert isinstance(error, NotArmed)
    assert "fell" in str(error)


def test_another_home_in_flight_changes_no_height(flying):
    rig = flying(alt=4.0, sim_tags="", attempts=3, leash=6.0, on_failure="hold")
    job = rig.land()
    rig.pass_time(2.0)
    rig.tracker._home_down += 4.0
    lowest: list[float] = []
    rig.each_step.append(lambda: lowest.append(height(rig)))
    rig.outcome(job)
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


# -- somebody switches in the middle -------------------------------------------------------------------------


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


@pytest.mark.parametrize(("forward", "right"), [(1.0, 0.5), (-1.0, 0.5), (0.3, -2.0)])
def test_the_angles_of_landing_target_mean_the_same_as_its_position(forward, right):
    message = landing_target(1.0, vector(forward, right, 4.0), Attitude())
    told = (-math.tan(message.angle_y), math.tan(message.angle_x))  # as AC_PrecLand_MAVLink.cpp reads them
    assert told == pytest.approx((forward / 4.0, right / 4.0))
    assert (message.x, message.y, message.z) == pytest.approx((forward, right, 4.0))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_velocity_that_is_no_number_is_not_sent_and_the_vehicle_holds(flying, monkeypatch, bad):
    rig = flying(sim_tags="")
    job = rig.land()
    rig.pass_time(1.0)
    monkeypatch.setattr(Landing, "step", lambda *_: LandingCommand(Phase.LOOK, vector(0, bad, 0)))
    assert "a number in it is not finite" in str(rig.outcome(job))
    assert holds(rig, seconds=3.0)


def test_a_target_that_is_no_number_is_not_told_and_the_landing_goes_on_by_itself(flying):
    rig = flying(alt=6.0, plnd=True, **LARGE)
    before = plnd(rig)
    job = rig.land(method="landing_target")
    until(rig, lambda: rig.mode == "LAND")
    rig.pass_time(1.5)
    rig.tracker.target.place[:] = math.nan
    assert "a number in it is not finite" in str(rig.outcome(job))
    rig.pass_time(3.0)
    assert rig.mode == "LAND"
    assert plnd(rig) == before
    assert all(map(is_finite, rig.wire.sent))


def test_an_id_that_tags_does_not_name_has_the_size_of_the_main_tag_of_now(lockstep):
    rig = lockstep(sim_tags=TAG, **SMALL)
    rig.run(rig.tracker.want(5))
    assert rig.tracker.options(rig.tracker.settings).sizes == {0: 0.3, 5: 0.3}
    rig.put(tags="0:0.6")
    assert rig.tracker.options(rig.tracker.settings).sizes == {0: 0.6, 5: 0.6}
