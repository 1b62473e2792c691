from __future__ import annotations

import math

import pytest

from mavproxy_uavapi.core.geodesy import METRES_PER_DEGREE, offset, rotate


def test_a_degree_of_latitude_is_as_long_as_ardupilot_reckons() -> None:
    assert pytest.approx(2 * math.pi * 6378100 / 360) == METRES_PER_DEGREE


@pytest.mark.parametrize(
    ("there", "north", "east"),
    [
        ((-34.999, 149.0), 111.319, 0.0),
        ((-35.001, 149.0), -111.319, 0.0),
        ((-35.0, 149.001), 0.0, 111.319 * math.cos(math.radians(35))),
        ((-35.0, 148.999), 0.0, -111.319 * math.cos(math.radians(35))),
        ((-35.0, 149.0), 0.0, 0.0),
    ],
)
def test_offset_is_metres_north_and_east(there: tuple[float, float], north: float, east: float) -> None:
    assert offset(-35.0, 149.0, *there) == pytest.approx((north, east), abs=1e-3)


def test_offset_across_the_date_line_is_the_short_way() -> None:
    north, east = offset(0.0, 179.9999, 0.0, -179.9999)
    assert (north, east) == pytest.approx((0.0, 0.0002 * METRES_PER_DEGREE))
    assert offset(0.0, -179.9999, 0.0, 179.9999)[1] == pytest.approx(-east)


@pytest.mark.parametrize(("heading", "north", "east"), [(0, 3, 4), (90, -4, 3), (180, -3, -4), (270, 4, -3)])
def test_rotate_turns_front_and_right_by_the_heading(heading: float, north: float, east: float) -> None:
    assert rotate(3, 4, math.radians(heading)) == pytest.approx((north, east))
