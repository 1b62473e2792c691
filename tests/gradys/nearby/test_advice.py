from __future__ import annotations

import json
import math
from typing import Any

import pytest

from mavproxy_gradys.nearby.advice import OLD, Advice, Track, nearest
from mavproxy_uavapi.core.airspace.space import LocalFrame, Spot

FRAME = LocalFrame((-35.0, 149.0))


def at(north: float, east: float, velocity: tuple[float, float] = (0.0, 0.0), now: float = 0.0) -> Track:
    return Track(FRAME.degrees(Spot(north, east, 0.0)), velocity, now)


def position(north: float, east: float, device: str = "uav-7") -> str:
    return json.dumps({"device": device, "value": [*FRAME.degrees(Spot(north, east, 0.0)), 30.0]})


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


def test_a_pair_is_warned_of_once_until_it_is_apart_again() -> None:
    advice, ours = Advice(), {"uav-1": at(0, 0)}
    said: list[str] = []
    for now, east in enumerate([30.0, 7.0, 6.0, 9.0, 7.5, 30.0, 30.0, 30.0, 6.0]):
        assert advice.take(position(0, east), float(now)) == "uav-7"
        said += advice.warnings({"uav-1": at(0, 0, now=now)}, {"uav-1"}, 8.0, float(now))
    assert len(said) == 2 and "uav-7 of another MAVProxy" in said[0] and "of uav-1" in said[0]
    assert advice.warnings(ours, {"uav-1"}, 0.0, 8.0) == []


def test_its_velocity_comes_from_two_positions() -> None:
    advice = Advice()
    for now, east in ((0.0, 60.0), (1.0, 50.0)):  # 10 m/s towards us: here in 5 s
        advice.take(position(0, east), now)
    (sentence,) = advice.warnings({"uav-1": at(0, 0)}, {"uav-1"}, 8.0, 1.0)
    assert "within 0 m" in sentence


def test_our_own_positions_and_old_ones_say_nothing() -> None:
    advice = Advice()
    advice.take(position(0, 1, "uav-1"), 0.0)
    advice.take(position(0, 1, "uav-2"), 0.0)
    advice.take(position(0, 1), -OLD)
    assert advice.warnings({"uav-1": at(0, 0)}, {"uav-1", "uav-2"}, 8.0, 0.1) == []


@pytest.mark.parametrize(
    "payload",
    [b"", b"\xff", b"{}", b"[]", b"null", "[" * 50_000, *(json.dumps({"device": "x", "value": value}) for value in (
        None, 3, [], [1], ["a", "b"], [91, 0], [0, 181], [math.nan, 0], [math.inf, 0], {"a": 1}, "ab"))],
)  # fmt: skip
def test_what_is_no_position_is_passed_over(payload: Any) -> None:
    assert Advice().take(payload, 0.0) == ""


def test_a_pair_of_which_one_was_gone_is_warned_of_anew() -> None:
    advice, names = Advice(), {"uav-1"}
    ours = {"uav-1": at(0, 0)}
    advice.take(position(0, 5), 0.0)
    assert len(advice.warnings(ours, names, 8.0, 0.0)) == 1
    assert advice.warnings({}, names, 8.0, 1.0) == []  # ours has landed, beside the other
    advice.take(position(0, 5), 2.0)
    assert len(advice.warnings(ours, names, 8.0, 2.0)) == 1
    assert advice.warnings(ours, names, 8.0, 2.0 + OLD) == []  # the other has fallen silent
    advice.take(position(0, 5), 3.0 + OLD)
    assert len(advice.warnings(ours, names, 8.0, 3.0 + OLD)) == 1
