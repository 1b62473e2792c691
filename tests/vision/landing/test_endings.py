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
)
from tests.support.vision_world import VisionWorld

pytestmark = pytest.mark.matrix

FLIGHTS = ["land", "landing_target", "search", "takeoff", "leg"]


def under_way(make_world: Any, name: str) -> tuple[Any, Any]:
    """A flight of that kind in its middle, and its job."""
    precise = name == "landing_target"
    world = make_world(
        **{**SMALL, "sim_tags": TAG if name == "land" else "", **(LARGE if precise else {})},
        precision_landing=precise,
    )
    if name in ("takeoff", "leg"):
        world.switch_on()
        world.open_eye()
        plan = MissionPlan(alt=10, north=60, east=0, on_tag=False)
        job = world.fly(world.vision.mission(world.known, plan), "/vision/mission")
        world.until(lambda: any(m.command == TAKEOFF for m in sent(world, "COMMAND_LONG")), step=0.05)
        world.until(lambda: world.at.north > 2.0 if name == "leg" else height(world) > 0.5, step=0.05)
        return world, job
    world.start(7.0)
    world.before = landing_parameters(world)
    if name == "search":
        job = world.fly(world.vision.searching(world.known, None, None), "/vision/search")
        world.until(lambda: "searching" in world.vision.phase, step=0.05)
        world.pass_time(1.5)
        return world, job
    job = world.land(method="landing_target" if precise else "velocity")
    world.until(lambda: world.known.mode == "LAND" if precise else "descending" in world.vision.phase, step=0.05)
    world.pass_time(1.0)
    return world, job


def client(world: VisionWorld, verb: Any) -> None:
    """Somebody else's verb."""
    world.fly(lambda job: verb(world.known, job), "/command/other")
    world.pass_time(0.2)


def defect(world: VisionWorld, _job: Any) -> None:
    """A bug in what flies: the next thing that the flight asks fails."""
    world.loop.set_exception_handler(lambda _loop, _context: None)  # it is told there, too

    def broken(*_: Any) -> Any:
        del world.known.held_by, world.tracker.carrier.now  # once: what sees to the vehicle afterwards asks too
        raise ZeroDivisionError("a defect")

    world.known.held_by, world.tracker.carrier.now = broken, broken
    world.pass_time(0.3)


# How it ends, the error of its client, and the mode that follows what is flown in GUIDED, and what is flown in LAND.
ENDS: dict[str, tuple[Any, str, str, str]] = {
    "DELETE": (lambda world, job: world.abort(job), "aborted", "GUIDED", "BRAKE"),
    "vision stop": (lambda world, _: world.stop(), "aborted", "GUIDED", "BRAKE"),
    "unload": (lambda world, _: world.unload(), "aborted", "GUIDED", "LAND"),
    "unload of the last module": (lambda world, _: world.unload(last=True), "aborted", "GUIDED", "LAND"),
    "defect": (defect, "internal", "GUIDED", "LAND"),
    "another search": (
        lambda world, _: world.fly(world.vision.searching(world.known, 3, 2.0)), "superseded", "GUIDED", "",
    ),
    "movement": (
        lambda world, _: client(world, lambda copter, job: copter.go_to(job, NedTarget(30, 0, -9))),
        "superseded", "GUIDED", "",
    ),
    "rtl": (lambda world, _: client(world, lambda copter, job: copter.rtl(job)), "superseded", "RTL", "RTL"),
    "land": (lambda world, _: client(world, lambda copter, job: copter.land(job)), "superseded", "LAND", "LAND"),
    "brake": (
        lambda world, _: client(world, lambda copter, job: copter.set_mode(job, "BRAKE")),
        "superseded", "BRAKE", "BRAKE",
    ),
    "LOITER by the pilot": (lambda world, _: pilot(world, 5), "mode_changed", "LOITER", "LOITER"),
    "RTL by the pilot": (lambda world, _: pilot(world, 6), "mode_changed", "RTL", "RTL"),
    "AUTO by the pilot": (lambda world, _: pilot(world, 3), "mode_changed", "AUTO", "AUTO"),
    "disarm": (
        lambda world, _: client(world, lambda copter, job: copter.disarm(job, force=True)), "superseded", "", "",
    ),
    "silence": (
        lambda world, _: world.simulator.faults.silence(world.copter.now, 8.0, sending=True, receiving=True),
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
def test_what_follows_a_flight_is_what_the_table_says(make_world, name, end):
    world, job = under_way(make_world, name)
    act, code, after_guided, after_land = ENDS[end]
    refused = end in REFUSED_IN_LAND if name == "landing_target" else name == "takeoff" and end in NOT_IN_A_TAKEOFF
    mode = after_land if name == "landing_target" else after_guided
    act(world, job)
    if refused:  # the flight goes on
        world.pass_time(0.5)
        assert job.running
        return
    error = world.outcome(job)
    assert error.code == code, error
    began = height(world)
    world.pass_time(0.3)
    mark = len(world.sent)
    world.pass_time(12.0 if end == "silence" else 5.0)
    if mode not in ("LAND", "RTL"):  # else it has landed, or not yet
        assert world.copter.armed == (end != "disarm")
    if mode:
        assert world.mode == mode
    if mode in ("GUIDED", "BRAKE") and end not in REFUSED_IN_LAND and end != "silence":
        assert math.hypot(*world.copter.body.velocity[:2]) < 0.3
        assert height(world) < began + 4.0  # a climb of 2.5 m/s ends at 1 m/s/s
    if name == "landing_target":
        assert landing_parameters(world) == world.before
    streamed = {"SET_POSITION_TARGET_LOCAL_NED", "LANDING_TARGET"}
    flown = [one.message for one in world.sent[mark:] if one.message.get_type() in streamed]
    moving = [m for m in flown if m.get_type() == "LANDING_TARGET" or (m.vx, m.vy, m.vz) != (0, 0, 0)]
    assert end == "another search" or not moving
    switched = {m.param2 for m in sent(world, "COMMAND_LONG", mark) if m.command == SWITCH_MODE}
    assert switched <= {MODES.get(mode)}


@pytest.mark.parametrize("name", FLIGHTS)
def test_stop_holds_a_flight_and_resume_does_not_take_up_what_it_flew_by(make_world, name):
    world, job = under_way(make_world, name)
    answers = []

    async def begin(verb: Any, path: str) -> Any:
        async def body(one: Any) -> str:
            await verb(one)
            return "done"

        return world.host.jobs.begin(world.known, path, {}, body)

    stop = world.run(begin(world.known.stop, "/movement/stop"))
    answers.append(world.outcome(stop))
    if name == "landing_target":
        assert answers[0].code == "mode_changed"
        assert job.running
        return
    assert answers == ["done"]
    world.pass_time(0.3)
    if name in ("takeoff", "leg"):  # it waits, and goes on
        assert job.running
        world.pass_time(2.0)
        assert float(abs(world.copter.body.velocity[0])) < 0.3
    else:
        assert world.outcome(job).code == "paused"
        assert world.outcome(world.land()).code == "paused"
    before = world.at
    world.outcome(world.run(begin(world.known.resume, "/movement/resume")))
    world.pass_time(3.0)
    moved = math.dist(before, world.at)
    assert moved > 1.0 if job.running else moved < 0.3
