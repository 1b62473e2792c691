"""How each flight of vision ends in each way: a table of flights by ends, each flown in lock step.

An end is the work of `landing/`, and of the core's jobs and `endings.py`; none of them has the whole table.
"""

from __future__ import annotations

import math
from typing import Any

import pytest

from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_vision.landing.mission import MissionPlan
from tests.support.landing import (
    LARGE,
    MODES,
    SMALL,
    SWITCH_MODE,
    TAG,
    TAKEOFF,
    height,
    landing_parameters,
    pilot,
    sent,
    until,
)

pytestmark = pytest.mark.matrix

FLIGHTS = ["land", "landing_target", "search", "takeoff", "leg"]


def under_way(lockstep: Any, name: str) -> tuple[Any, Any]:
    """A flight of that kind in its middle, and its job."""
    precise = name == "landing_target"
    rig = lockstep(
        **{**SMALL, "sim_tags": TAG if name == "land" else "", **(LARGE if precise else {})},
        precision_landing=precise,
    )
    if name in ("takeoff", "leg"):
        rig.switch_on()
        rig.open_eye()
        plan = MissionPlan(alt=10, north=60, east=0, on_tag=False)
        job = rig.begin(rig.flights.mission(rig.copter, plan), "/vision/mission")
        until(rig, lambda: any(m.command == TAKEOFF for m in sent(rig, "COMMAND_LONG")))
        until(rig, lambda: rig.truth.north > 2.0 if name == "leg" else height(rig) > 0.5)
        return rig, job
    rig.start(7.0)
    rig.before = landing_parameters(rig)
    if name == "search":
        job = rig.begin(rig.flights.searching(rig.copter, None, None), "/vision/search")
        until(rig, lambda: "searching" in rig.flights.phase)
        rig.pass_time(1.5)
        return rig, job
    job = rig.land(method="landing_target" if precise else "velocity")
    until(rig, lambda: rig.copter.mode == "LAND" if precise else "descending" in rig.flights.phase)
    rig.pass_time(1.0)
    return rig, job


def client(rig: Any, verb: Any) -> None:
    """Somebody else's verb."""
    rig.begin(lambda job: verb(rig.copter, job), "/command/other")
    rig.pass_time(0.2)


def defect(rig: Any, _job: Any) -> None:
    """A bug in what flies: the next thing that the flight asks fails."""
    rig.loop.set_exception_handler(lambda _loop, _context: None)  # it is told there, too

    def broken(*_: Any) -> Any:
        del rig.copter.held_by, rig.tracker.carrier.now  # once: what sees to the vehicle afterwards asks too
        raise ZeroDivisionError("a defect")

    rig.copter.held_by, rig.tracker.carrier.now = broken, broken
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
TELLING = ("DELETE", "unload", "movement", "LOITER by the pilot", "silence")  # of what ends a flight
CELLS = [
    pytest.param(name, end, marks=pytest.mark.long if name != "land" and end not in TELLING else ())
    for name in FLIGHTS
    for end in ENDS
]


@pytest.mark.parametrize(("name", "end"), CELLS)
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
    rig.pass_time(12.0 if end == "silence" else 5.0)
    if mode not in ("LAND", "RTL"):  # else it has landed, or not yet
        assert rig.simulator.copter.armed == (end != "disarm")
    if mode:
        assert rig.mode == mode
    if mode in ("GUIDED", "BRAKE") and end not in REFUSED_IN_LAND and end != "silence":
        assert math.hypot(*rig.simulator.copter.body.velocity[:2]) < 0.3
        assert height(rig) < began + 4.0  # a climb of 2.5 m/s ends at 1 m/s/s
    if name == "landing_target":
        assert landing_parameters(rig) == rig.before
    flown = [m for m in rig.wire.sent[mark:] if m.get_type() in ("SET_POSITION_TARGET_LOCAL_NED", "LANDING_TARGET")]
    moving = [m for m in flown if m.get_type() == "LANDING_TARGET" or (m.vx, m.vy, m.vz) != (0, 0, 0)]
    assert end == "another search" or not moving
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
