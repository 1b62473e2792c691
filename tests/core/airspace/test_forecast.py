from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavproxy_uavapi.core.airspace.forecast import Forecast, Pace, Slack, along, meeting
from mavproxy_uavapi.core.airspace.space import Spot

PACE = Pace(5.0, 2.5, 1.5)
EXACT, LOOSE = Slack(0.0, 0.5, 0.0), Slack(1.0, 4.0, 0.2)
DISTANCE = 8.0


def flight(*spots: tuple[float, float, float], slack: Slack = EXACT, seconds: float = math.inf) -> Forecast:
    return along([Spot(*spot) for spot in spots], PACE, slack, DISTANCE, seconds=seconds)


def test_a_way_is_flown_at_its_pace_and_ends_where_the_vehicle_stays() -> None:
    forecast = flight((0, 0, 10), (0, 50, 10), (0, 50, 25))
    assert tuple(forecast.points[0]) == (0, 0, 10) and tuple(forecast.points[-1]) == (0, 50, 25)
    assert forecast.early[-1] == pytest.approx(50 / 5.0 + 15 / 2.5)
    assert forecast.late[-1] == math.inf
    assert np.linalg.norm(np.diff(forecast.points, axis=0), axis=1).max() <= forecast.apart + 1e-9


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
    assert (meeting(ours, flight(*theirs), DISTANCE) is not None) is meets, name
    assert (meeting(flight(*theirs), ours, DISTANCE) is not None) is meets, name


def test_a_meeting_says_where_and_when() -> None:
    encounter = meeting(flight((0, 0, 10), (0, 100, 10)), flight((0, 60, 10)), DISTANCE)
    assert encounter is not None
    assert encounter.at.east == pytest.approx(51.5, abs=1.5)
    assert encounter.seconds == pytest.approx(encounter.at.east / 5.0, abs=0.1)
    assert encounter.gap < 1.0


def test_who_is_too_near_already_may_go_away_and_come_no_nearer() -> None:
    other = flight((0, 4, 10))
    assert meeting(flight((0, 0, 10)), other, DISTANCE) is None
    assert meeting(flight((0, 0, 10), (0, -50, 10)), other, DISTANCE) is None
    assert meeting(flight((0, 0, 10), (0, 0, 40)), other, DISTANCE) is None
    assert meeting(flight((0, 0, 10), (0, 2, 10)), other, DISTANCE) is not None


def test_a_vehicle_that_does_not_tell_where_it_is_may_be_anywhere_on_its_way() -> None:
    passes = flight((0, 0, 10), (0, 100, 10))
    late = flight((-300, 20, 10), (300, 20, 10))
    assert meeting(late, passes, DISTANCE) is None
    assert meeting(late, passes.at_any_time(), DISTANCE) is not None


def test_only_what_comes_soon_is_looked_at_in_flight() -> None:
    way, other = ((0, 0, 10), (0, 0, 15), (0, 100, 15)), flight((0, 60, 15))
    assert meeting(flight(*way, seconds=7.0), other, DISTANCE) is None
    assert meeting(flight(*way, seconds=14.0), other, DISTANCE) is not None


@pytest.mark.parametrize("seconds", [0.0, 1.0, 2.0, 3.7, 9.0, 22.0, 100.0])
def test_a_short_forecast_is_the_beginning_of_the_whole(seconds: float) -> None:
    way = ((0, 0, 10), (0, 0, 15), (0, 100, 15), (0, 100, 15), (0, 90, 5))
    whole, part = (flight(*way, slack=LOOSE, seconds=until) for until in (math.inf, seconds))
    count = len(part.points)
    assert (part.points == whole.points[:count]).all() and (part.early == whole.early[:count]).all()
    assert (part.late[:-1] == whole.late[: count - 1]).all()
    assert (whole.early[count:] > seconds).all()


def test_slack_makes_more_meetings() -> None:
    ways = ((0, 0, 10), (0, 100, 10)), ((-80, 50, 10), (100, 50, 10))
    assert meeting(*(flight(*way) for way in ways), DISTANCE) is None
    assert meeting(*(flight(*way, slack=LOOSE) for way in ways), DISTANCE) is not None


spot = st.tuples(*(st.floats(-150, 150),) * 2, st.floats(2, 40))


def flown(spots: list[tuple[float, float, float]], seconds: float) -> np.ndarray:
    """Where a vehicle truly is that keeps its pace."""
    for a, b in zip(spots, spots[1:], strict=False):
        level, up = math.dist(a[:2], b[:2]), b[2] - a[2]
        lasts = max(level / PACE.level, abs(up) / (PACE.climb if up > 0 else PACE.descent))
        if seconds < lasts:
            return np.array(a) + (np.array(b) - np.array(a)) * seconds / lasts
        seconds -= lasts
    return np.array(spots[-1])


@settings(max_examples=150, deadline=None, database=None, derandomize=True)
@given(st.lists(spot, min_size=1, max_size=4), st.lists(spot, min_size=1, max_size=4))
def test_no_two_that_keep_their_pace_come_too_near_unseen(ours: list, theirs: list) -> None:
    if meeting(flight(*ours), flight(*theirs), DISTANCE) is None:
        gaps = [float(np.linalg.norm(flown(ours, t) - flown(theirs, t))) for t in np.arange(0, 120, 0.1)]
        assert min(gaps) >= min(DISTANCE, gaps[0]) - 0.05
