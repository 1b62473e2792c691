"""What goes wrong in a landing, each with the action expected and a control that shows that the test can fail.

The whole of `landing/` flies here in lock step; tests/end_to_end/test_vision_failures.py flies the same in real time.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.errors import LinkLost, ModeChanged
from mavproxy_vision.errors import LandingFailed, NoCamera
from tests.support.landing import FAR_TAG, LARGE, SWITCH_MODE, TAG, long, sent
from tests.support.vision_world import VisionWorld

pytestmark = pytest.mark.matrix


@pytest.fixture
def flying(flying: Callable[..., VisionWorld]) -> Callable[..., VisionWorld]:
    """As all tests of landings have it, but lower: `flying(alt=6, sim_tags=…)`."""
    return lambda alt=4.0, **settings: flying(alt, **settings)


def landed_off(world: VisionWorld, north: float = 0.8, east: float = -0.6) -> float:
    """Metres between the vehicle, which must stand on the ground, and a place."""
    assert not world.copter.armed
    assert world.at.down == 0
    return math.hypot(world.at.north - north, world.at.east - east)


def setpoints(world: VisionWorld, since: int = 0) -> list[Any]:
    """Velocity setpoints that the vehicle got since the message of that number."""
    return sent(world, "SET_POSITION_TARGET_LOCAL_NED", since)


def told(outcome: str, unit: str) -> float:
    """The number before that unit in a sentence."""
    found = re.search(rf"([\d.]+) {unit}", outcome)
    assert found, outcome
    return float(found[1])


def below(height: float) -> Any:
    """Whether a pose is lower than that."""
    return lambda pose: -pose[0][2] < height


def test_control_it_lands_on_the_tag(flying):
    world = flying()
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert landed_off(world) < 0.2
    assert setpoints(world)[-1].vz > 0  # what GUIDED had last, until a heartbeat showed that no pilot has the vehicle
    report = world.vision.report.as_dict()
    assert report["attempts"] == 1
    assert report["touchdown_error"] == pytest.approx(landed_off(world), abs=0.02)
    assert report["last_offset"] < 0.2


def test_wrong_id_is_not_landed_on(flying):
    world = flying(sim_tags="1:0.30@0.8,-0.6", attempts=2, leash=3.0)
    error = world.outcome(world.land())
    assert isinstance(error, LandingFailed)
    assert "no tag in sight" in str(error)
    assert error.report["action"] == "rtl"
    assert landed_off(world, 0, 0) < 1


def test_two_equal_tags_are_refused_and_the_vehicle_holds(flying):
    world = flying(sim_tags=f"{TAG} 0:0.30@-0.5,0.6")
    error = world.outcome(world.land())
    assert isinstance(error, LandingFailed)
    assert "two tags" in str(error)
    assert world.mode == "GUIDED"
    world.pass_time(3)
    assert world.at.down == pytest.approx(-4, abs=0.5)


def test_a_second_equal_tag_that_comes_into_view_on_the_way_is_held_for(flying):
    world = flying(alt=5.0, sim_tags="0:0.30@1.2,0 0:0.30@2.4,0")  # the second one is not in view from here
    error = world.outcome(world.land())
    assert isinstance(error, LandingFailed)
    assert "two tags" in str(error)
    assert -world.at.down > 1.5


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize("beside", [0.5, 0.7])  # m; the farther one is soon out of the picture
def test_a_second_equal_tag_that_appears_just_above_two_metres_is_told(flying, beside, method):
    world = flying(sim_tags=f"{TAG} 0:0.30@{0.8 + beside},-0.6", precision_landing=method == "landing_target")
    renderer = world.eye.source.renderer
    both, renderer.tags = renderer.tags, renderer.tags[:1]
    world.each_step.append(lambda: setattr(renderer, "tags", both) if -world.at.down < 2.3 else None)
    error = world.outcome(world.land(method=method))
    assert isinstance(error, LandingFailed)
    assert "two tags" in str(error)
    assert -world.at.down > 0.8


def test_of_two_tags_with_different_ids_the_one_that_is_requested_is_landed_on(flying):
    world = flying(sim_tags="1:0.30@0.8,-0.6 0:0.30@-0.5,0.6")
    assert world.outcome(world.land(1)).startswith("Landed on tag 1")
    assert landed_off(world) < 0.2


@pytest.mark.parametrize("height", [long(6), 3])
def test_a_tag_lost_high_up_is_held_for_then_climbed_for_then_searched(flying, height):
    world = flying(alt=height + 1.0, attempts=3, leash=4.0, **LARGE)
    world.eye.blind = below(height)
    phases: list[str] = []
    tops: list[float] = []

    def watch() -> None:
        if not phases or phases[-1] != world.vision.phase:
            phases.append(world.vision.phase)
        tops.append(-world.at.down)

    world.each_step.append(watch)
    # The climb brings it into sight again; from the second time on it is gone for good.
    world.each_step.append(lambda: setattr(world.eye, "blind", lambda _: True) if "climbing" in phases[-1] else None)
    error = world.outcome(world.land())
    assert isinstance(error, LandingFailed)
    order = [phase.split(":")[0] for phase in phases]
    assert order.index("holding") < order.index("climbing to the last fix") < order.index("searching")
    assert max(tops) > height + 0.8
    assert error.report["action"] == "rtl"
    assert error.report["attempts"] == 3


@pytest.mark.parametrize("height", [1.0, 0.4])
def test_a_tag_lost_low_down_is_landed_on_straight(flying, height):
    world = flying()
    world.eye.blind = below(height - 0.05)
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert landed_off(world) < 0.3
    assert "climbing to the last fix" not in world.vision.report.phases


def test_a_short_loss_changes_nothing(flying):
    world = flying()
    began = []

    def blink(pose: Any) -> bool:
        if -pose[0][2] < 3 and not began:
            began.append(world.now)
        return bool(began) and world.now - began[0] < 0.25

    world.eye.blind = blink
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert set(world.vision.report.phases) <= {"looking", "descending", "descending the last metre"}


@pytest.mark.parametrize("fault", ["frozen", "dead"])
def test_a_frozen_or_dead_camera_ends_the_landing(flying, fault):
    world = flying()
    job = world.land()
    world.pass_time(2.5)
    height = -world.at.down
    setattr(world.eye, fault, True)
    error = world.outcome(job)
    assert isinstance(error, LandingFailed)
    assert "the camera: " in str(error)
    assert error.report["action"] == "rtl"
    assert height > 1.5  # else it had been too late to matter


def ranged(world: VisionWorld, hill: float = 0.0, shows: float | None = None) -> None:
    """Give it a rangefinder, over ground that lies `hill` m higher than home; or one that shows the same for ever."""

    def measure() -> None:
        at, height = round(1000 * world.copter.now), -world.at.down - hill
        distance = round(100 * (height if shows is None else shows))
        world.say(mavlink.MAVLink_distance_sensor_message(at, 20, 4000, max(distance, 0), 0, 0, 25, 0))

    world.each_step.append(measure)


def test_a_search_without_a_rangefinder_warns_of_hills(flying):
    world = flying(alt=12.0, sim_tags="", attempts=1)
    error = world.outcome(world.land())
    assert "no rangefinder" in error.report["warning"]
    assert world.vision.report.warning


def test_with_a_rangefinder_a_search_keeps_its_height_above_a_hill(flying):
    world = flying(alt=14.0, sim_tags="", attempts=1)
    ranged(world, hill=7.0)
    lowest = [14.0]
    world.each_step.append(lambda: lowest.append(-world.at.down) if world.mode == "GUIDED" else None)
    error = world.outcome(world.land())
    assert "warning" not in error.report
    assert min(lowest) > 7.0 + 3.0


def test_a_rangefinder_that_is_stuck_does_not_fly_a_search_into_the_ground(flying):
    world = flying(alt=9.0, sim_tags="", attempts=1, on_failure="hold")
    ranged(world, shows=20.0)
    error = world.outcome(world.land())
    assert "no tag in sight" in str(error)
    assert "does not shrink" in error.report["warning"]
    assert -world.at.down > 3.0


def test_a_search_that_meets_the_ground_lands_there(flying):
    world = flying(alt=8.0, sim_tags="", attempts=1)
    job, state = world.land(), type(world.known.state)
    world.pass_time(1.0)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(state, "landed", property(lambda _: True))  # the search has sunk into a hill
        world.pass_time(0.5)
    error = world.outcome(job)
    assert "touched the ground" in str(error)
    assert error.report["action"] == "land"
    assert not world.copter.armed


def test_the_size_of_a_tag_on_a_hill_is_held_against_the_rangefinder(flying):
    outcomes = []
    for size in (0.3, 0.5):  # as `tags` says; the tag has 0.3 m
        world = flying(alt=8.0, tags=f"0:{size}", on_failure="hold")
        world.eye.walk = lambda _time: (0.0, 0.0, 3.5)  # the ground of the tag lies so high, and nobody has said so
        ranged(world, hill=3.5)
        outcomes.append(world.outcome(world.land()))
    assert "is its size" not in str(outcomes[0])
    assert "is its size" in str(outcomes[1])


def test_control_without_a_rangefinder_a_tag_on_a_hill_is_refused_for_its_size(flying):
    world = flying(alt=8.0, on_failure="hold")
    world.eye.walk = lambda _time: (0.0, 0.0, 3.5)
    assert "is its size" in str(world.outcome(world.land()))


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize(
    ("name", "field", "value"),
    [
        ("LOCAL_POSITION_NED", "vx", 3e4),
        ("LOCAL_POSITION_NED", "vz", 1e30),
        ("ATTITUDE", "roll", 1e30),
        ("LOCAL_POSITION_NED", "time_boot_ms", 0),
    ],
)
def test_one_number_that_no_vehicle_has_changes_nothing(flying, name, field, value, method):
    world, told = flying(precision_landing=method == "landing_target"), []
    hear = world.come

    def receive(message: Any) -> None:
        if not told and message.get_type() == name and -world.at.down < 2.5:
            told.append(message)
            setattr(message, field, value)
        hear(message)

    world.come = receive
    assert world.outcome(world.land(method=method)).startswith("Landed on tag 0")
    assert told
    assert landed_off(world) < 0.2


def stuck_below(world: VisionWorld, height: float) -> None:
    """Below that height the picture stands still, though a pixel of it changes, as a clock in it does."""
    world.each_step.append(lambda: setattr(world.eye, "stuck", world.eye.stuck or -world.at.down < height))


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize("height", [long(4.5), 2.6, long(2.0), 1.4])
def test_a_picture_that_stands_still_with_a_running_clock_in_it_is_held_for(flying, height, method):
    world = flying(alt=5.0, precision_landing=method == "landing_target")
    stuck_below(world, height)
    error = world.outcome(world.land(method=method))
    assert isinstance(error, LandingFailed)
    assert "stands still" in str(error)
    assert error.report["action"] == "hold"
    assert world.mode == "GUIDED"
    assert -world.at.down > 0.25


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize("seconds", [0.2, long(1.0), 3.0])
def test_pictures_that_come_over_and_over_are_no_camera(flying, seconds, method):
    world = flying(alt=5.0, on_failure="hold", precision_landing=method == "landing_target")
    job = world.land(method=method)
    world.pass_time(3.5)
    world.eye.looping = seconds
    error = world.outcome(job)
    assert isinstance(error, LandingFailed)
    assert "the camera: frozen" in str(error)
    assert -world.at.down > 1.0


@pytest.mark.parametrize("height", [long(1.2), 0.9, long(0.6)])
def test_a_picture_that_stands_still_low_down_ends_no_faster_than_the_last_metre(flying, height):
    world = flying()
    stuck_below(world, height)
    fastest = [0.0]

    def watch() -> None:
        if -0.1 < world.at.down < 0:
            fastest[0] = max(fastest[0], world.copter.body.velocity_down)

    world.each_step.append(watch)
    outcome = world.outcome(world.land())
    assert fastest[0] < 0.45
    assert "stands still" in str(outcome) or landed_off(world) < 0.2


@pytest.mark.parametrize("height", [0.85, 0.8])
def test_landing_target_says_that_a_picture_stood_still_below_a_metre(flying, height):
    world = flying(precision_landing=True)
    stuck_below(world, height)
    error = world.outcome(world.land(method="landing_target"))
    assert isinstance(error, LandingFailed)
    assert "stands still" in str(error)
    assert error.report["action"] == "land"
    assert not world.copter.armed


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
def test_a_camera_that_dies_on_the_last_metre_is_told_though_it_has_landed(flying, method):
    world = flying(precision_landing=method == "landing_target")
    world.each_step.append(lambda: setattr(world.eye, "dead", world.eye.dead or -world.at.down < 0.8))
    assert "Landed near tag 0" in world.outcome(world.land(method=method))
    assert "no frames" in world.vision.report.warning
    assert "last_offset" not in world.vision.report.as_dict()


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize("speed", [0.12, 0.3])
def test_a_tag_that_moves_is_told_and_held_for(flying, speed, method):
    world = flying(alt=5.0, precision_landing=method == "landing_target", **LARGE)
    since = world.now
    world.eye.walk = lambda time: (speed * (time - since), 0.0)
    error = world.outcome(world.land(method=method))
    assert isinstance(error, LandingFailed)
    assert "the tag moves" in str(error)
    assert "target moving" in str(error)
    assert -world.at.down > 0.8


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize("late", [0.6, long(0.8)])
def test_frames_that_are_later_than_told_are_told_with_their_delay(flying, late, method):
    world = flying(alt=6.0, tags="0:0.6", sim_tags="0:0.6@1.6,-1.2", precision_landing=method == "landing_target")
    world.eye.late = lambda _: late
    outcome = str(world.outcome(world.land(method=method)))
    assert "ms later than their time stamps" in outcome
    assert told(outcome, "ms later") == pytest.approx(1000 * late, abs=150)


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize(("metres", "omega"), [(0.4, 1.5), pytest.param(0.25, 4.0, marks=pytest.mark.long)])
def test_a_tag_that_swings_is_not_taken_for_late_frames(flying, metres, omega, method):
    world = flying(alt=5.0, precision_landing=method == "landing_target", **LARGE)
    world.eye.walk = lambda time: (metres * math.sin(omega * time), 0.0)
    error = world.outcome(world.land(method=method))
    assert isinstance(error, LandingFailed)
    assert "the tag moves" in str(error)
    assert error.report["action"] == "hold"


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize("drift", [0.03, long(-0.03)])
def test_time_stamps_that_drift_are_told(flying, drift, method):
    world = flying(alt=6.0, precision_landing=method == "landing_target")
    since = world.now
    world.eye.misdated = lambda time: drift * (time - since)
    error = world.outcome(world.land(method=method))
    assert isinstance(error, LandingFailed)
    # Where the vehicle leans much, such frames are noticed before their drift is.
    assert "drift" in str(error) or "stamped later" in str(error) or "the frames are late" in str(error)
    assert -world.at.down > 0.8


@pytest.mark.parametrize("verb", ["landing", "searching"])
def test_a_latency_that_nobody_can_fly_by_is_refused_with_one_that_would_do(flying, verb):
    world = flying(fps=20.0, latency=500, sim_latency=500)
    world.pass_time(1.0)
    error = world.outcome(
        world.fly(getattr(world.vision, verb)(world.known, None, *([""] if verb == "landing" else [None])))
    )
    assert isinstance(error, NoCamera)
    assert "500 ms" in str(error)
    assert "at most 450 ms" in str(error)
    assert not setpoints(world)


@pytest.mark.long
def test_control_the_latency_that_it_names_lands(flying):
    world = flying(fps=20.0, latency=450, sim_latency=450)
    world.pass_time(1.0)
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert landed_off(world) < 0.2


@pytest.mark.parametrize("mount", ["90", long("180"), long("-90")])
def test_a_camera_turned_from_what_mount_says_is_noticed(flying, mount):
    world = flying(alt=5.0)
    world.eye.source.renderer.mount = type(world.eye.source.renderer.mount)(yaw=float(mount))
    error = world.outcome(world.land())
    assert isinstance(error, LandingFailed)
    assert "mount" in str(error)
    assert math.hypot(world.at.north - 0.8, world.at.east + 0.6) < 5
    assert world.at.down < -2  # it holds where it noticed


@pytest.mark.parametrize(("height", "yaw"), [(1.2, 90.0), pytest.param(1.0, 180.0, marks=pytest.mark.long)])
def test_a_picture_that_is_turned_low_down_is_told_though_it_has_landed(flying, height, yaw):
    """As a phone does that takes itself for turned."""
    world = flying()
    renderer = world.eye.source.renderer

    def turn() -> None:
        if -world.at.down < height:
            renderer.mount = type(renderer.mount)(yaw=yaw)

    world.each_step.append(turn)
    assert "Landed near tag 0" in world.outcome(world.land())
    assert "the tag left its place" in world.vision.report.warning
    assert landed_off(world) > 0.2  # else it had not been worth telling


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
def test_a_camera_tilted_from_what_mount_says_is_told_with_its_tilt(flying, method):
    world = flying(alt=5.0, precision_landing=method == "landing_target", **LARGE)
    world.eye.source.renderer.mount = type(world.eye.source.renderer.mount)(roll=20.0)
    outcome = str(world.outcome(world.land(method=method)))
    assert "mount" in outcome
    assert told(outcome, "degrees") == pytest.approx(20.0, abs=2.0)


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
def test_a_tag_that_begins_to_move_low_down_is_not_landed_on_in_silence(flying, method):
    world, since = flying(alt=5.0, precision_landing=method == "landing_target", **LARGE), []

    def walk(time: float) -> tuple[float, float]:
        if not since and -world.at.down < 1.5:
            since.append(time)
        return 0.3 * (time - since[0]) if since else 0.0, 0.0

    world.eye.walk = walk
    outcome = world.outcome(world.land(method=method))
    if "near" in str(outcome):  # LAND goes on while the tag is out of sight for a second
        assert "was not seen below" in world.vision.report.warning
        return
    assert "from where it was: it has moved" in str(outcome) or "the tag moves" in str(outcome)
    assert outcome.report["action"] == "hold"


def test_landing_target_warns_when_it_saw_the_tag_from_high_up_only(flying):
    world = flying(precision_landing=True, **LARGE)
    world.eye.blind = below(1.2)
    assert "Landed near tag 0" in world.outcome(world.land(method="landing_target"))
    assert "was not seen below 1.2 m" in world.vision.report.warning


@pytest.mark.parametrize("burst", [0.2, 0.4])
def test_a_machine_that_hears_of_the_vehicle_in_bursts_does_not_suspect_the_mount(flying, burst):
    world = flying(alt=5.0, sim_tags=FAR_TAG)
    world.burst = burst
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert landed_off(world, 1.6, -1.2) < 0.2


@pytest.mark.parametrize("burst", [long(0.18), 0.2, long(0.3)])
def test_by_a_turned_camera_nothing_lands_on_a_busy_machine_either(flying, burst):
    """It may lose the tag before it suspects the mount."""
    world = flying(alt=5.0, sim_tags=FAR_TAG)
    world.burst = burst
    world.eye.source.renderer.mount = type(world.eye.source.renderer.mount)(yaw=180.0)
    error = world.outcome(world.land())
    assert isinstance(error, LandingFailed)
    assert "mount" in str(error) or "no tag in sight" in str(error)


@pytest.mark.parametrize("mount", ["90", "180"])
def test_a_camera_turned_as_mount_says_lands(flying, mount):
    world = flying(mount=mount)
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert landed_off(world) < 0.2


@pytest.mark.parametrize("size", ["0.20", "0.42"])
def test_a_wrong_tag_size_is_refused_with_the_reason(flying, size):
    world = flying(alt=5.0, tags=f"0:{size}")
    error = world.outcome(world.land())
    assert isinstance(error, LandingFailed)
    assert "by its size" in str(error)
    assert "tags" in str(error)
    assert world.mode == "GUIDED"
    assert world.at.down < -2


NESTED = {"tags": "1:0.08 0:0.5@-0.35,0", "sim_tags": "1:0.08@0.8,-0.6 0:0.5@0.8,-0.95"}


def sights(world: VisionWorld) -> list[tuple[float, int]]:
    """Collects height and id of what it descends by."""
    seen: list[tuple[float, int]] = []

    def look() -> None:
        target = world.tracker.target
        if target is not None and target.last is not None and world.vision.phase == "descending":
            seen.append((-world.at.down, target.last.tag))

    world.each_step.append(look)
    return seen


def test_a_small_tag_beside_the_large_one_takes_over_low_down(flying):
    world = flying(alt=5.0, **NESTED)
    seen = sights(world)
    assert world.outcome(world.land()).startswith("Landed on tag 1")
    assert landed_off(world) < 0.2
    assert seen[0][1] == 0  # from 5 m the small one cannot be read
    assert seen[-1][1] == 1
    assert seen[-1][0] < 0.6


@pytest.mark.long
def test_control_without_the_small_tag_the_last_metre_is_blind(flying):
    world = flying(alt=5.0, tags="0:0.5", sim_tags="0:0.5@0.8,-0.6")
    seen = sights(world)
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert seen[-1][1] == 0
    assert seen[-1][0] > 0.8


def test_occlusion_is_waited_out(flying):
    world = flying()
    look = world.eye.source.renderer.look
    covered = type(look)(look.noise, look.blur, look.exposure, 0.5)
    times: list[float] = []

    def hand() -> None:
        if -world.at.down < 3 and not times:
            times.append(world.now)
        over = bool(times) and world.now - times[0] < 1.5
        world.eye.source.renderer.look = covered if over else look

    world.each_step.append(hand)
    assert world.outcome(world.land()).startswith("Landed on tag 0")
    assert "holding: tag lost" in world.vision.report.phases
    assert landed_off(world) < 0.2


def test_link_silence_of_four_seconds_is_rested_out(flying):
    world = flying(alt=7.5, **LARGE)
    job = world.land()
    world.pass_time(2.0)
    world.simulator.faults.silence(world.copter.now, 4.0, sending=True, receiving=True)
    world.pass_time(3.9)
    mark = len(world.sent)
    height = -world.at.down
    assert height > 1.5  # the autopilot itself rests after GUID_TIMEOUT, 3 s
    assert world.outcome(job).startswith("Landed ")
    assert setpoints(world, mark)
    assert landed_off(world) < 0.2


def test_during_link_silence_it_is_commanded_to_rest(flying):
    world = flying(alt=5.0)
    world.land()
    world.pass_time(2.0)
    world.simulator.faults.silence(world.copter.now, 3.5, sending=True, receiving=False)
    world.pass_time(1.5)
    mark = len(world.sent)
    world.pass_time(1.0)
    commanded = setpoints(world, mark)
    assert commanded
    assert all(m.vx == m.vy == m.vz == 0 for m in commanded)


def test_a_lost_link_ends_the_landing_and_nothing_more_is_sent(flying):
    world = flying(alt=5.0)
    job = world.land()
    world.pass_time(2.0)
    world.simulator.faults.silence(world.copter.now, 60.0, sending=True, receiving=False)
    error = world.outcome(job)
    assert isinstance(error, LinkLost)
    mark = len(world.sent)
    world.pass_time(3.0)
    assert not setpoints(world, mark)


@pytest.mark.parametrize("mode", [5, 2, 0])  # LOITER, ALT_HOLD, STABILIZE
def test_the_pilots_mode_ends_the_landing_and_nothing_more_is_sent(flying, mode):
    world = flying(alt=5.0)
    job = world.land()
    world.pass_time(2.0)
    world.copter.sticks.move(3, 1500)
    assert world.copter.set_mode(mode)
    world.pass_time(0.1)
    mark = len(world.sent)
    error = world.outcome(job)
    world.pass_time(3.0)
    assert isinstance(error, ModeChanged)
    assert not setpoints(world, mark)
    assert not [m for m in sent(world, "COMMAND_LONG", mark) if m.command == SWITCH_MODE]
    assert world.copter.mode.number == mode


def test_a_battery_failsafe_has_its_way(flying):
    world = flying(alt=5.0)
    world.simulator.parameters.set("BATT_FS_LOW_ACT", 2)  # RTL
    world.simulator.parameters.set("BATT_LOW_TIMER", 1)
    job = world.land()
    world.pass_time(1.0)
    world.copter.battery.forced_voltage = 9.9
    error = world.outcome(job)
    mark = len(world.sent)
    world.pass_time(3.0)
    assert isinstance(error, ModeChanged)
    assert world.mode == "RTL"
    assert not setpoints(world, mark)


def test_unloaded_in_flight_the_vehicle_holds(flying):
    world = flying(alt=5.0)
    job = world.land()
    world.pass_time(2.0)
    assert world.copter.body.velocity_down > 0.1
    last = world.unload(last=True)
    mark = len(world.sent)
    height = -world.at.down
    world.pass_time(5.0)
    assert len(last) == 1
    assert not job.running
    assert not setpoints(world, mark)
    assert world.mode == "GUIDED"
    assert -world.at.down == pytest.approx(height, abs=0.7)


def test_a_newer_command_supersedes_the_landing_and_it_sends_nothing_more(flying):
    world = flying(alt=5.0)
    job = world.land()
    world.pass_time(2.0)

    async def other(new: Any) -> None:
        world.known.authority.take(new, Rank.MOVEMENT)

    world.fly(other, "/movement/other")
    world.pass_time(0.05)
    mark = len(world.sent)
    assert world.outcome(job).code == "superseded"
    world.pass_time(2.0)
    assert not setpoints(world, mark)


def test_stopped_it_holds(flying):
    world = flying(alt=5.0)
    world.land()
    world.pass_time(2.0)
    mark = len(world.sent)
    assert world.stop()
    world.pass_time(0.2)
    last = setpoints(world, mark)[-1]
    assert (last.vx, last.vy, last.vz) == (0, 0, 0)
    height = -world.at.down
    world.pass_time(4.0)
    assert -world.at.down == pytest.approx(height, abs=0.7)


def test_landing_target_lands_and_puts_the_parameters_back(flying):
    world = flying(precision_landing=True)
    parameters = world.simulator.parameters
    before = {name: parameters[name] for name in ("PLND_ENABLED", "PLND_STRICT", "PLND_ALT_MIN", "PLND_ALT_MAX")}
    during: list[float] = []
    world.each_step.append(lambda: during.append(parameters["PLND_ENABLED"]) if world.mode == "LAND" else None)
    assert world.outcome(world.land(method="landing_target")).startswith("Landed on tag 0")
    assert landed_off(world) < 0.1
    assert during[0] == 1
    assert {name: parameters[name] for name in before} == before
    assert [m for m in sent(world, "LANDING_TARGET") if m.position_valid == 1]


def test_a_precision_landing_that_was_off_at_boot_asks_for_a_reboot(flying):
    world = flying()
    error = world.outcome(world.land(method="landing_target"))
    assert "reboot" in str(error)
    assert world.simulator.parameters["PLND_TYPE"] == 1
    assert world.mode == "GUIDED"


def test_a_tag_lost_high_up_under_land_is_taken_back_to_guided(flying):
    world = flying(precision_landing=True, alt=5.0, attempts=1)
    world.eye.blind = below(3.0)
    world.each_step.append(lambda: setattr(world.eye, "blind", lambda _: True) if -world.at.down < 3.0 else None)
    error = world.outcome(world.land(method="landing_target"))
    assert isinstance(error, LandingFailed)
    assert error.report["action"] == "rtl"
    assert world.simulator.parameters["PLND_ENABLED"] == 0
    assert landed_off(world, 0, 0) < 1


def test_a_battery_failsafe_in_a_landing_of_ours_is_not_left(flying):
    """It was in LAND already: only the heartbeat's state shows that it lands for the failsafe now."""
    world = flying(alt=8.0, precision_landing=True)
    world.simulator.parameters.set("BATT_FS_LOW_ACT", 1)  # LAND
    world.simulator.parameters.set("BATT_LOW_TIMER", 1)
    modes = []

    def fail() -> None:
        if world.mode == "LAND" and -world.at.down < 6.0 and not modes:
            world.copter.battery.forced_voltage = 9.9
            world.eye.dead = True  # so it would come back and search
            modes.append(world.mode)
        elif modes:
            modes.append(world.mode)

    world.each_step.append(fail)
    outcome = world.outcome(world.land(method="landing_target"))
    assert set(modes) == {"LAND"}, outcome
