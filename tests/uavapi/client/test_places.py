"""Places and offsets."""

from __future__ import annotations

import math

import pytest

from mavproxy_uavapi.client import Ned, Position

HERE = Position(-35.363261, 149.165230, 10.0)


@pytest.mark.parametrize("by", [Ned(10, 0, 0), Ned(0, -250, 0), Ned(-3, 4, -5), Ned(900, 700, 2)])
def test_place_moved_by_an_offset_lies_there(by: Ned) -> None:
    back = (HERE + by) - HERE
    assert (back.north, back.east, back.down) == pytest.approx((by.north, by.east, by.down), abs=1e-6)
    assert HERE.distance(HERE + by) == pytest.approx(by.length, abs=1e-6)


def test_offset_down_lowers_the_altitude() -> None:
    assert (HERE + Ned(0, 0, 4)).alt == 6.0
    assert (HERE - Ned(0, 0, 4)).alt == 14.0


def test_date_line_is_crossed() -> None:
    east = Position(0.0, 179.9999) + Ned(0, 100, 0)
    assert east.lon < 0
    assert (east - Position(0.0, 179.9999)).east == pytest.approx(100)


@pytest.mark.parametrize(("to", "bearing"), [(Ned(1, 0), 0), (Ned(0, 1), 90), (Ned(-1, 0), 180), (Ned(0, -1), 270)])
def test_bearing_is_a_compass_direction(to: Ned, bearing: float) -> None:
    assert to.bearing == pytest.approx(bearing)
    assert HERE.bearing(HERE + 100 * to) == pytest.approx(bearing, abs=1e-3)


def test_offsets_are_vectors() -> None:
    assert Ned(1, 2, 3) + Ned(1, 1, 1) - 2 * Ned(1, 0, 0) == Ned(0, 3, 4)
    assert (Ned(3, 4, 12).horizontal, Ned(3, 4, 12).length) == (5, 13)
    assert math.isclose((Ned(1, 1) * 2).bearing, 45)
