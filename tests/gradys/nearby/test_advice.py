from __future__ import annotations

import json
import math
from typing import Any

import pytest

from mavproxy_gradys.nearby.advice import OLD, Advice, Heard, OurTracks, Track, heard_in, nearest
from mavproxy_uavapi.core.airspace.local_frame import LocalFrame, Spot

FRAME = LocalFrame((-35.0, 149.0))
READING: dict[str, Any] = {"device": "x", "seq": 1, "quantity": "position", "value": [1.0, 2.0], "time": 9.0}


def at(north: float, east: float, velocity: tuple[float, float] = (0.0, 0.0), now: float = 0.0) -> Track:
    return Track(FRAME.degrees(Spot(north, east, 0.0)), velocity, now)


def warned(advice: Advice, ours: dict[str, Track], east: float, now: float) -> list[str]:
    """What is said when the other one was at `east` at `now`."""
    heard = Heard("uav-7", at(0, east).place, 0.0)
    return list(advice.hear(heard, now, OurTracks(ours, now), 8.0, now))


@pytest.mark.parametrize(
    ("one", "other", "gap"),
    [
        (at(0, 0), at(0, 20), 20.0),
        (at(0, 0, (0, 4)), at(0, 20), 0.0),
        (at(0, 0, (0, 2)), at(0, 20), 10.0),
        (at(0, 0, (0, -4)), at(0, 20), 20.0),
        (at(0, 0, (0, 5)), at(20, 20, (-5, 0)), 0.0),
        (at(0, 0, (5, 0)), at(0, 20, (5, 0)), 20.0),
    ],
)
def test_nearest_over_the_ground_while_both_keep_their_velocity(one: Track, other: Track, gap: float) -> None:
    assert nearest(one, other) == pytest.approx(gap, abs=0.05)
    assert nearest(other, one) == pytest.approx(gap, abs=0.05)


def test_its_velocity_comes_from_two_positions() -> None:
    advice, ours = Advice(), {"uav-1": at(0, 0)}
    assert warned(advice, ours, 60.0, 0.0) == []
    (sentence,) = warned(advice, ours, 50.0, 1.0)  # 10 m/s towards us: here in 5 s
    assert "within 0 m" in sentence


def test_a_clock_that_is_ahead_hides_no_approach() -> None:
    """Nor does it move the other one back by its velocity."""
    advice, said = Advice(), []
    for half in range(8):
        now = half / 2
        ours = OurTracks({"uav-1": at(0, 0, now=now)}, now)
        said += advice.hear(Heard("uav-7", at(0, 60.0 - 10.0 * now).place, 0.0), now + 8.0, ours, 8.0, now)
    assert len(said) == 1


def test_one_position_from_the_future_hides_none_of_the_present() -> None:
    advice, ours = Advice(), {"uav-1": at(0, 0)}
    heard = Heard("uav-7", at(0, 500.0).place, 0.0)
    assert not advice.hear(heard, 9.0, OurTracks(ours, 0.0), 8.0, 0.0)
    assert warned(advice, ours, 3.0, 0.5)


@pytest.mark.parametrize("later", [0.5, 0.05])
def test_two_others_of_one_name_warn_once_not_with_each_position(later: float) -> None:
    advice = Advice()
    said = [
        sentence
        for second in range(20)
        for east, now in ((3.0, float(second)), (1000.0, second + later))
        for sentence in warned(advice, {"uav-1": at(0, 0, now=now)}, east, now)
    ]
    assert len(said) == 1


def test_an_older_position_changes_nothing() -> None:
    advice, ours = Advice(), {"uav-1": at(0, 0, now=5.0)}
    assert warned(advice, ours, 100.0, 5.0) == []
    assert warned(advice, ours, 5.0, 5.0) == []
    assert warned(advice, ours, 5.0, 4.0) == []
    assert len(warned(advice, ours, 5.0, 6.0)) == 1


@pytest.mark.parametrize(
    "payload",
    [b"", b"\xff", b"{}", b"[]", b"null", b"[" * 50_000,
     *(json.dumps({**READING, "value": value}).encode() for value in (
        None, 3, [], [1], ["a", "b"], [91, 0], [0, 181], [math.nan, 0], [math.inf, 0], [10**400, 0],
        [True, 0], {"a": 1}, "ab")),
     *(json.dumps({**READING, **other}).encode() for other in (
        {"time": 10**400}, {"time": None}, {"time": math.nan}, {"device": "x" * 10_000}, {"device": "a\0"},
        {"device": "\ud800"}, {"quantity": "heading"}))],
)  # fmt: skip
def test_what_is_no_position_is_passed_over(payload: bytes) -> None:
    assert heard_in(payload) is None


def test_both_are_compared_where_they_are_now() -> None:
    """Each was measured seconds ago and has flown on since: they meet in the middle."""
    ours, other = at(0, -20, (0, 10), now=8.0), at(0, 40, (0, -10), now=6.0)
    gaps = OurTracks({"uav-1": ours}, 10.0).near(other.moved_to(10.0), 8.0)
    assert gaps == {"uav-1": pytest.approx(0.0, abs=0.05)}


@pytest.mark.parametrize("place", [(-35.0, 149.0), (60.0, 179.9999), (-60.0, -179.9999), (0.0, 0.0), (89.9, 20.0)])
@pytest.mark.parametrize("speeds", [(0.0, 0.0), (30.0, -30.0), (99.0, 0.0)])
def test_who_comes_near_is_never_passed_over(place: tuple[float, float], speeds: tuple[float, float]) -> None:
    frame, limit = LocalFrame(place), 12.0
    ours = {
        f"uav-{north}-{east}": Track(frame.degrees(Spot(north, east, 0.0)), (0.0, speeds[0]), 0.0)
        for north in range(-600, 601, 150)
        for east in range(-600, 601, 150)
    }
    other = Track(place, (0.0, speeds[1]), 0.0)
    expected = {name for name, track in ours.items() if nearest(track, other) < limit}
    assert OurTracks(ours, 0.0).near(other, limit).keys() == expected and expected


def test_an_old_position_of_ours_says_nothing() -> None:
    assert OurTracks({"uav-1": at(0, 0)}, OLD).near(at(0, 5, now=OLD), 8.0) == {}


def test_a_reading_of_a_position_is_one() -> None:
    heard = heard_in(json.dumps(READING).encode())
    assert heard is not None and (heard.device, heard.place, heard.time) == ("x", (1.0, 2.0), 9.0)
    assert heard_in(b"online") is None


def test_a_pair_of_which_one_was_gone_is_warned_of_anew() -> None:
    advice, ours = Advice(), {"uav-1": at(0, 0, now=20.0)}
    assert len(warned(advice, ours, 5.0, 20.0)) == 1
    assert warned(advice, {}, 5.0, 21.0) == []  # ours has landed, beside the other
    assert len(warned(advice, ours, 5.0, 22.0)) == 1
    assert warned(advice, ours, 5.0, 23.0) == []
    later = {"uav-1": at(0, 0, now=24.0 + OLD)}
    assert len(warned(advice, later, 5.0, 24.0 + OLD)) == 1  # the other had fallen silent
