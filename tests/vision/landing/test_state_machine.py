"""The state machine, on a point that follows its velocities at once."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from mavproxy_vision.geometry.frames import vector
from mavproxy_vision.landing.plan import Plan
from mavproxy_vision.landing.state_machine import Landing, Phase, cone
from mavproxy_vision.tracking.moving_target import MovingTarget
from mavproxy_vision.tracking.plausibility import TargetMeasurement
from mavproxy_vision.tracking.pose_history import Motion
from mavproxy_vision.tracking.target_filter import Target

STEP = 0.05


class Point:
    """A vehicle without inertia over a tag at `tag` (north, east), seen while `sees(point)`."""

    def __init__(
        self,
        plan: Plan | None = None,
        tag: tuple[float, float] = (2.0, -1.0),
        height: float = 5.0,
        target: Target | None = None,
    ) -> None:
        self.target = target or Target()
        self.landing = Landing(plan or Plan(), self.target)
        self.tag, self.now = tag, 100.0
        self.at = vector(0, 0, -height)
        self.velocity = vector(0, 0, 0)
        self.sees: Any = lambda _: True
        self.orders: list[Any] = []
        self.picture: Any = None  # m NED from it to the tag, in a picture that stands still
        self.own_height: Any = lambda p: p.height  # by its own estimate
        self.landed: Any = lambda _: False  # by its land detector

    @property
    def height(self) -> float:
        return -float(self.at[2])

    def step(self) -> Any:
        if self.sees(self):
            place = vector(*self.tag, 0) if self.picture is None else self.at + self.picture
            self.target.take(
                [
                    TargetMeasurement(
                        self.now, place, self.at.copy(), self.velocity.copy(), np.eye(3), self.height, self.height, 0
                    )
                ]
            )
        motion = Motion(self.now, self.at, self.velocity, self.at)
        order = self.landing.step(self.now, motion, self.own_height(self), self.landed(self))
        self.orders.append(order)
        self.velocity = order.velocity
        self.at = self.at + order.velocity * STEP
        self.now += STEP
        return order

    def run(self, seconds: float = 120.0) -> Any:
        for _ in range(round(seconds / STEP)):
            order = self.step()
            if order.phase in (Phase.LAND, Phase.FAILED):
                return order
        return order

    @property
    def phases(self) -> list[Phase]:
        phases: list[Phase] = []
        for order in self.orders:
            if not phases or phases[-1] is not order.phase:
                phases.append(order.phase)
        return phases


def test_it_centres_and_touches_down():
    point = Point()
    assert point.run().phase is Phase.LAND
    assert math.dist(point.at[:2], point.tag) <= 0.05
    assert point.height <= 0.2
    assert point.phases == [Phase.LOOK, Phase.DESCEND, Phase.LAST_METRE, Phase.LAND]
    assert point.landing.attempt == 1


def test_speed_and_acceleration_are_limited():
    point = Point(tag=(6, 0))
    point.run()
    speeds = [math.hypot(*order.velocity[:2]) for order in point.orders]
    assert max(speeds) <= 1.5 + 1e-9
    pairs = itertools.pairwise(point.orders[:-1])
    changes = [math.dist(a.velocity[:2], b.velocity[:2]) for a, b in pairs]
    assert max(changes) <= 1.5 * STEP + 1e-9
    assert max(order.velocity[2] for order in point.orders) <= 1.0


def test_outside_the_cone_it_does_not_descend():
    point = Point(tag=(4, 0), height=5.0)
    for _ in range(10):
        point.step()
        assert point.orders[-1].velocity[2] == 0


def test_the_cone_is_wide_high_up_and_narrow_low():
    assert cone(5) == pytest.approx(math.radians(20))
    assert cone(2) == pytest.approx(math.radians(15))
    assert cone(0.5) == pytest.approx(math.radians(10))


def test_half_a_second_without_sight_changes_nothing():
    point = Point()
    point.sees = lambda p: not 103.0 < p.now < 103.4
    assert point.run().phase is Phase.LAND
    assert Phase.HOLD not in point.phases


def test_a_loss_of_one_second_is_held_through():
    point = Point()
    point.sees = lambda p: not 103.0 < p.now < 104.2
    assert point.run().phase is Phase.LAND
    assert Phase.HOLD in point.phases
    assert Phase.CLIMB not in point.phases


def test_a_longer_loss_climbs_to_where_it_was_seen():
    point = Point()
    lost: list[float] = []

    def sees(p: Point) -> bool:
        if p.height < 3 and not lost:
            lost.append(p.height)
        return not lost or p.height > lost[0] + 0.9

    point.sees = sees
    for _ in range(2000):
        point.step()
        if Phase.CLIMB in point.phases and point.orders[-1].phase is Phase.DESCEND:
            break
    assert [phase.name for phase in point.phases] == ["LOOK", "DESCEND", "HOLD", "CLIMB", "DESCEND"]
    assert math.dist(point.at[:2], point.tag) < 0.5


def test_lost_below_one_metre_it_goes_on_straight_down():
    point = Point()
    point.sees = lambda p: p.height > 0.95
    assert point.run().phase is Phase.LAND
    assert Phase.HOLD not in point.phases
    assert point.height <= 0.2
    assert math.dist(point.at[:2], point.tag) <= 0.12  # it went on to above where the tag was


def test_what_pushes_it_on_the_last_metre_is_answered_without_seeing():
    point = Point()
    point.sees = lambda p: p.height > 0.5
    while not point.orders or point.orders[-1].phase is not Phase.LAND:
        point.step()
        if point.orders[-1].phase is Phase.LAST_METRE:
            point.at = point.at + vector(0.10 * STEP, 0, 0)  # what its velocity estimate notices
    assert math.dist(point.at[:2], point.tag) < 0.1


@pytest.mark.parametrize("stands", [False, True])
def test_until_the_autopilots_land_takes_over_it_flies_on_as_on_the_last_metre(stands):
    point = Point()
    point.landed = lambda p: stands and p.height < 0.3
    point.run()
    beside = point.at + vector(0.1, 0.0, 0.0)  # a gust, or a GPS that drifts
    velocity = point.landing.until_it_lands(point.now, Motion(point.now, beside, point.velocity, beside))
    assert velocity[2] > 0
    assert velocity[0] == 0 if stands else velocity[0] < -0.1


def test_on_legs_that_are_higher_than_the_last_metre_expects_it_ends_all_the_same():
    point = Point()
    while not point.orders or point.orders[-1].phase is not Phase.LAND:
        point.step()
        point.at[2] = min(point.at[2], -0.45)
        assert point.now < 160
    began = next(i for i, order in enumerate(point.orders) if order.phase is Phase.LAST_METRE)
    assert (len(point.orders) - began) * STEP < 3.0


def test_without_a_tag_it_searches_and_fails_after_its_attempts():
    point = Point(Plan(attempts=3, step=1.0, leash=20))
    point.sees = lambda _: False
    order = point.run()
    assert order.phase is Phase.FAILED
    assert "after 3 attempts" in order.reason
    assert point.phases == [Phase.LOOK, Phase.SEARCH, Phase.FAILED]
    assert order.velocity == pytest.approx([0, 0, 0])


def test_the_leash_and_the_time_limit_end_a_search():
    short = Point(Plan(attempts=99, step=1.0, leash=2.0))
    short.sees = lambda _: False
    assert "within 2 m" in short.run().reason
    late = Point(Plan(attempts=99, step=1.0, leash=50, time_limit=20))
    late.sees = lambda _: False
    assert "20 s" in late.run(60).reason


def test_it_finds_a_tag_on_its_search():
    point = Point(Plan(step=1.5), tag=(-2.5, 2.5))
    point.sees = lambda p: math.dist(p.at[:2], p.tag) < 1.2
    assert point.run().phase is Phase.LAND
    assert point.landing.attempt > 1


def test_a_search_stays_below_the_range_of_detection():
    point = Point(Plan(ceiling=4.0, attempts=3), height=9.0)
    point.sees = lambda _: False
    point.run()
    assert point.height == pytest.approx(4.0, abs=0.5)


def test_a_search_that_finds_does_not_descend():
    point = Point(Plan(descend=False), tag=(0.5, 0))
    assert point.run().phase is Phase.LAND
    assert point.height == pytest.approx(5, abs=0.1)


def test_taken_back_from_land_it_climbs_and_looks_again():
    point = Point(Plan(descend=False))
    point.run()
    point.sees = lambda _: False
    point.now += 2.0
    point.landing.resume(point.now, Motion(point.now, point.at, point.velocity, point.at), point.height)
    for _ in range(30):
        point.step()
    assert point.orders[-1].phase is Phase.CLIMB


@pytest.fixture
def believing(monkeypatch):
    """Nothing is compared with the vehicle's motion: the landing has only its own bounds."""
    monkeypatch.setattr(Target, "contradiction", None)


def stuck(height: float) -> Point:
    """A point whose picture has stood still since that height."""
    point = Point(height=3.5, tag=(0.3, 0.0))
    while point.height > height:
        point.step()
    point.picture = vector(*point.tag, 0) - point.at
    return point


@pytest.mark.parametrize("height", [3.0, 2.6, 2.0, 1.2, 0.8])
@pytest.mark.usefixtures("believing")
def test_a_descent_by_a_picture_that_stands_still_sinks_no_farther_than_the_tag_was_below(height):
    point = stuck(height)
    order = point.run()
    assert point.height > -0.6
    assert order.phase is Phase.FAILED
    assert "sunk as far" in order.reason
    assert point.landing.refused


@pytest.mark.parametrize("height", [2.6, 2.0, 1.2, 0.8])
@pytest.mark.usefixtures("believing")
def test_near_the_ground_by_its_own_height_it_sinks_slowly_whatever_the_picture_shows(height):
    point = stuck(height)
    point.run()
    fast = [o.velocity[2] for p, o in zip(heights(point), point.orders, strict=True) if p < 0.5]
    assert fast
    assert max(fast) <= 0.2


def heights(point: Point) -> list[float]:
    """The height at each order."""
    sunk = list(itertools.accumulate(float(order.velocity[2]) * STEP for order in point.orders))
    return [point.height + sunk[-1] - before for before in sunk]


@pytest.mark.usefixtures("believing")
def test_it_stops_descending_on_the_ground_and_says_that_it_is_not_the_tag():
    point = stuck(2.0)
    point.landed = lambda p: p.height <= 0.1
    order = point.run()
    assert order.phase is Phase.LAND
    assert "touched the ground" in order.reason


@pytest.mark.usefixtures("believing")
def test_standing_is_noticed_without_a_land_detector():
    point = stuck(2.0)
    point.sees = lambda p: p.height > 0.2 or bool(p.velocity.__setitem__(2, 0.0)) or True
    while point.orders[-1].phase is not Phase.LAND and point.now < 160:
        point.step()
        if point.height < 0.2:  # the ground
            point.at[2], point.velocity = -0.2, vector(0, 0, 0)
    assert "touched the ground" in point.orders[-1].reason


def test_a_search_that_sinks_into_the_ground_ends_there():
    point = Point(height=6.0)
    point.sees = lambda _: False
    point.own_height = lambda p: p.height + 9.0  # above home, on a hill
    point.landed = lambda p: p.height <= 3.0
    order = point.run()
    assert order.phase is Phase.FAILED
    assert "touched the ground" in order.reason
    assert point.landing.stands
    assert point.height > 2.8


def test_a_land_detector_that_is_late_after_a_takeoff_ends_nothing():
    point = Point()
    point.landed = lambda p: p.now < 101.0
    assert point.run().phase is Phase.LAND


def test_a_descent_that_never_gets_above_the_tag_ends():
    point = Point(height=3.0)
    point.sees = lambda p: bool(p.at.__setitem__(slice(0, 2), (0.0, 0.0))) or True  # a wind that it cannot beat
    order = point.run(170)
    assert order.phase is Phase.FAILED
    assert "took too long" in order.reason


def test_what_lies_higher_than_its_own_height_says_is_landed_on():
    point = Point(height=4.0)
    point.own_height = lambda p: p.height + 1.5  # a roof; `ground` is 0
    assert point.run().phase is Phase.LAND
    assert point.height <= 0.2


def test_what_lies_lower_than_home_is_landed_on_slowly():
    point = Point(height=4.0)
    point.own_height = lambda p: p.height - 2.0
    order = point.run()
    assert (order.phase, order.reason) == (Phase.LAND, "")
    assert point.height <= 0.2


def test_from_a_pad_that_it_misses_it_climbs_and_does_not_land() -> None:
    """The pad has gone from below it on the last metre: neither the tag nor a touch tells where the pad is."""
    point = Point(tag=(0.0, 0.0), target=MovingTarget())
    point.sees = lambda p: p.height > 0.5 and not any(order.phase is Phase.LAST_METRE for order in p.orders)
    point.own_height = lambda p: p.height + 3.0  # the ground lies below the pad
    heights = []
    while Phase.CLIMB not in point.phases or point.orders[-1].phase is Phase.CLIMB:
        point.step()
        heights.append(point.height)
        assert point.now < 160.0
    assert point.phases == [Phase.LOOK, Phase.DESCEND, Phase.LAST_METRE, Phase.CLIMB, Phase.LOOK]
    assert point.height > min(heights) + 1.0 and not point.target.is_final


def test_a_pad_that_it_missed_is_landed_on_once_it_is_seen_again() -> None:
    point = Point(tag=(0.0, 0.0), target=MovingTarget())
    missed: list[float] = []

    def sees(p: Point) -> bool:
        if Phase.LAST_METRE in p.phases and not missed:
            missed.append(p.now)
        return not missed or p.now > missed[0] + 8.0

    point.sees = sees
    point.own_height = lambda p: p.height + 3.0
    for _ in range(round(90.0 / STEP)):
        order = point.step()
        if order.phase in (Phase.LAND, Phase.FAILED):
            break
        if point.height <= 0.0 and missed and point.now > missed[0] + 8.0:  # it stands on the pad
            point.at[2], point.velocity = 0.0, vector(*point.velocity[:2], 0.0)
    assert order.phase is Phase.LAND and order.reason == ""
    assert Phase.CLIMB in point.phases and abs(point.height) < 0.1


def test_a_search_does_not_climb_for_ever_after_a_height_that_does_not_grow() -> None:
    """Dirt on the rangefinder: from now on the ground is 0.3 m below, wherever it is."""
    point = Point(Plan(descend=False, attempts=1000), height=4.0)
    point.sees = lambda _: False
    point.own_height = lambda p: p.height if p.now < 103.0 else 0.3
    for _ in range(round(170.0 / STEP)):
        point.step()
        assert point.height < 4.0 + point.landing.plan.leash + 1.0
