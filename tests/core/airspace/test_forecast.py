from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavproxy_uavapi.core.airspace.forecast import (
    Forecast,
    Pace,
    Path,
    Slack,
    along_path,
    common_box,
    gaps_between,
    near_miss,
)
from mavproxy_uavapi.core.airspace.local_frame import Spot

PACE = Pace(5.0, 2.5, 1.5)
EXACT, LOOSE = Slack(0.0, 0.5, 0.0), Slack(1.0, 4.0, 0.2)
DISTANCE = 8.0


def flight(*spots: tuple[float, float, float], slack: Slack = EXACT, seconds: float = math.inf) -> Forecast:
    return along_path(Path.through(spots, PACE), slack, DISTANCE, seconds=seconds)


def test_a_way_is_flown_at_its_pace_and_ends_where_the_vehicle_stays() -> None:
    forecast = flight((0, 0, 10), (0, 50, 10), (0, 50, 25))
    assert tuple(forecast.begins[0]) == (0, 0, 10) and tuple(forecast.ends[-1]) == (0, 50, 25)
    assert forecast.early[-1] == pytest.approx(50 / 5.0 + 14 / 2.5)
    assert forecast.late[-1] == math.inf
    assert (forecast.begins[1:] == forecast.ends[:-1]).all()


@pytest.mark.parametrize(
    ("name", "theirs", "meets"),
    [
        ("head on", [(0, 100, 10), (0, 0, 10)], True),
        ("across at the same time", [(-50, 50, 10), (50, 50, 10)], True),
        ("across much later", [(-300, 50, 10), (300, 50, 10)], False),
        ("far above", [(-50, 50, 30), (50, 50, 30)], False),
        ("beside", [(12, 0, 10), (12, 100, 10)], False),
        ("stands in the way", [(0, 60, 10)], True),
        ("stands beyond its end", [(0, 115, 10)], False),
        ("ends near its end, later", [(300, 100, 10), (3, 100, 10)], True),
    ],
)
def test_two_ways_meet_in_space_and_time(name: str, theirs: list[tuple[float, float, float]], meets: bool) -> None:
    ours = flight((0, 0, 10), (0, 100, 10))
    assert (near_miss(ours, flight(*theirs), DISTANCE) is not None) is meets, name
    assert (near_miss(flight(*theirs), ours, DISTANCE) is not None) is meets, name


@pytest.mark.parametrize(
    ("there", "meets"), [((28, 50, 10), True), ((52, 50, 10), True), ((60, 50, 10), False), ((28, 50, 30), False)]
)
def test_what_a_vehicle_may_be_beside_its_way_counts_over_the_ground_only(there: Any, meets: bool) -> None:
    path = Path.through([(0, 0, 10), (0, 100, 10)], PACE)
    wide = along_path(replace(path, margins=np.array([45.0])), EXACT, DISTANCE)
    assert (near_miss(wide, flight(there), DISTANCE) is not None) is meets
    assert near_miss(along_path(path, EXACT, DISTANCE), flight(there), DISTANCE) is None
    box = common_box(replace(path, margins=np.array([45.0])), Path.through([there], PACE), DISTANCE)
    assert box is not None or not meets


def test_a_meeting_says_where_and_when() -> None:
    encounter = near_miss(flight((0, 0, 10), (0, 100, 10)), flight((0, 60, 10)), DISTANCE)
    assert encounter is not None
    assert encounter.at.east == pytest.approx(51.5, abs=1.5)
    assert encounter.seconds == pytest.approx(encounter.at.east / 5.0, abs=0.1)
    assert encounter.gap < 1.0


def test_who_is_too_near_already_may_go_away_and_come_no_nearer() -> None:
    other = flight((0, 4, 10))
    assert near_miss(flight((0, 0, 10)), other, DISTANCE) is None
    assert near_miss(flight((0, 0, 10), (0, -50, 10)), other, DISTANCE) is None
    assert near_miss(flight((0, 0, 10), (0, 0, 40)), other, DISTANCE) is None
    assert near_miss(flight((0, 0, 10), (0, 2, 10)), other, DISTANCE) is not None


def test_vehicle_without_a_position_may_be_anywhere_on_its_way() -> None:
    passes = flight((0, 0, 10), (0, 100, 10))
    late = flight((-300, 20, 10), (300, 20, 10))
    assert near_miss(late, passes, DISTANCE) is None
    assert near_miss(late, passes.at_any_time(), DISTANCE) is not None


def test_only_what_comes_soon_is_looked_at_in_flight() -> None:
    way, other = ((0, 0, 10), (0, 0, 15), (0, 100, 15)), flight((0, 60, 15))
    assert near_miss(flight(*way, seconds=7.0), other, DISTANCE) is None
    assert near_miss(flight(*way, seconds=14.0), other, DISTANCE) is not None


@pytest.mark.parametrize("seconds", [0.0, 1.0, 2.0, 3.7, 9.0, 22.0, 100.0])
def test_a_short_forecast_is_the_beginning_of_the_whole(seconds: float) -> None:
    way = ((0, 0, 10), (0, 0, 15), (0, 100, 15), (0, 100, 15), (0, 90, 5))
    whole, part = (flight(*way, slack=LOOSE, seconds=until) for until in (math.inf, seconds))
    count = len(part.begins)
    assert (part.begins == whole.begins[:count]).all() and (part.early == whole.early[:count]).all()
    assert (part.late[:-1] == whole.late[: count - 1]).all()
    assert (whole.early[count:] > seconds).all()


def test_slack_makes_more_meetings() -> None:
    ways = ((0, 0, 10), (0, 100, 10)), ((-80, 50, 10), (100, 50, 10))
    assert near_miss(*(flight(*way) for way in ways), DISTANCE) is None
    assert near_miss(*(flight(*way, slack=LOOSE) for way in ways), DISTANCE) is not None


spot = st.tuples(*(st.floats(-150, 150),) * 2, st.floats(2, 40))


def flown(spots: list[tuple[float, float, float]], seconds: np.ndarray) -> np.ndarray:
    """Where a vehicle truly is then that keeps its pace."""
    reached = [0.0]
    for a, b in zip(spots, spots[1:], strict=False):
        level, up = math.dist(a[:2], b[:2]), b[2] - a[2]
        reached.append(reached[-1] + max(level / PACE.level, abs(up) / (PACE.climb if up > 0 else PACE.descent)))
    return np.stack([np.interp(seconds, reached, axis) for axis in zip(*spots, strict=True)], axis=1)


@settings(max_examples=150, deadline=None, database=None, derandomize=True)
@given(st.lists(spot, min_size=1, max_size=4), st.lists(spot, min_size=1, max_size=4))
def test_no_two_that_keep_their_pace_come_too_near_unseen(ours: list, theirs: list) -> None:
    if near_miss(flight(*ours), flight(*theirs), DISTANCE) is None:
        seconds = np.arange(0, 120, 0.1)
        gaps = np.linalg.norm(flown(ours, seconds) - flown(theirs, seconds), axis=1)
        assert min(gaps) >= min(DISTANCE, gaps[0]) - 0.05


def test_who_waits_is_late_afterwards_or_stays_if_nobody_knows_how_long() -> None:
    a, b, c = Spot(0, 0, 10), Spot(0, 50, 10), Spot(0, 100, 10)
    for waits, late in ((20.0, 40.0), (math.inf, math.inf)):
        path = Path.through([a, b, c], PACE)
        path.waits[0] = waits
        forecast = along_path(path, EXACT, DISTANCE)
        at_b = np.flatnonzero((forecast.ends == b).all(axis=1))
        assert forecast.late[at_b[0]] >= 10 + waits and forecast.late[-2] >= late - 1
        assert forecast.early[-1] == pytest.approx(20 - 0.2 + (waits if math.isfinite(waits) else 0.0))


def test_a_circle_may_be_flown_in_either_direction_round_after_round() -> None:
    path = Path.through([(0, 0, 0), (100, 0, 0), (100, 50, 0), (150, 50, 0), (200, 50, 0)], Pace(10.0, 2.5, 1.5))
    circles = replace(path, circles=np.array([0.0, 2.0, 2.0, 0.0]))
    once, round_ = (along_path(one, EXACT, 100.0) for one in (path, circles))
    on_it = (round_.begins[:, 0] >= 100) & (round_.ends[:, 0] <= 150) & (round_.ends[:, 1] > 0)
    straight = np.linalg.norm(round_.begins[on_it], axis=1) / np.linalg.norm((10.0, 2.5, 1.5))
    assert (round_.early[on_it] >= np.maximum(10.0, straight - 2.0)).all() and np.isinf(round_.late[on_it]).all()
    assert (round_.early[on_it] < once.early[on_it])[1:].all()
    assert (once.early == round_.early)[~on_it].all(), "it is left after a round at the soonest"


def test_unknown_pace_makes_it_early_by_the_fastest_late_by_the_slowest() -> None:
    path = Path.through([Spot(0, 0, 10), Spot(0, 50, 10), Spot(0, 60, 10)], PACE)
    path.slowest[0] = PACE._replace(level=1.0)
    forecast = along_path(path, EXACT, DISTANCE)
    at = np.flatnonzero((forecast.ends == (0, 50, 10)).all(axis=1))[0]
    assert forecast.early[at] == pytest.approx(10, abs=0.5) and forecast.late[at] == pytest.approx(51)


def test_long_ways_are_compared_without_counting_as_wide() -> None:
    """Two surveys side by side, 20 m apart, of 2,000 legs of a kilometre each."""

    def survey(east: float) -> Forecast:
        spots = [Spot(2.0 * n, east + (-1) ** n * 500.0, 10.0) for n in range(2000)]
        return along_path(Path.through(spots, PACE), LOOSE, DISTANCE)

    assert near_miss(survey(0.0), survey(1020.0), DISTANCE) is None
    assert near_miss(survey(0.0), survey(1000.0), DISTANCE) is not None


@settings(max_examples=200, deadline=None, database=None, derandomize=True)
@given(st.lists(spot, min_size=4, max_size=4))
def test_gap_between_two_lines_is_that_of_their_nearest_points(ends: list) -> None:
    a, b, c, d = (np.array([one]) for one in ends)
    shares = np.linspace(0, 1, 60)
    ours, theirs = ((1 - shares)[:, None] * p + shares[:, None] * q for p, q in ((a, b), (c, d)))
    sampled = np.linalg.norm(ours[:, None] - theirs[None], axis=2).min()
    gap = gaps_between(a, b, c, d)[0]
    assert gap <= sampled + 1e-4 and sampled - gap <= 10.0


WAY = st.lists(st.tuples(*[st.floats(-60, 60)] * 2, st.floats(0, 30)), min_size=2, max_size=6)


@settings(max_examples=60, deadline=None)
@given(WAY, WAY)
def test_legs_outside_of_what_two_ways_have_in_common_change_no_near_miss(ours: list[Any], theirs: list[Any]) -> None:
    paths = [Path.through(spots, PACE) for spots in (ours, theirs)]
    whole = near_miss(*(along_path(path, LOOSE, DISTANCE) for path in paths), DISTANCE)
    box = common_box(*paths, DISTANCE)
    if box is None:
        assert whole is None
        return
    found = near_miss(*(along_path(path, LOOSE, DISTANCE, box=box) for path in paths), DISTANCE)
    assert (found is None) is (whole is None)
    if found is not None and whole is not None:
        assert found.gap == pytest.approx(whole.gap, abs=1.0) and found.seconds == pytest.approx(whole.seconds, abs=3)
