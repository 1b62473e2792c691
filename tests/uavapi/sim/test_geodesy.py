import math

import pytest

from mavproxy_uavapi.sim.geodesy import Location, Ned, from_ned, rotate_to_ne, to_ned, wrap_pi

CMAC = Location(-35.363261, 149.165230, 584.0)


def test_there_and_back_is_the_same_place():
    offset = Ned(1234.5, -678.9, -42.0)
    assert to_ned(CMAC, from_ned(CMAC, offset)) == pytest.approx(offset, abs=1e-3)


def test_degrees_are_scaled_as_in_ardupilot():
    north = to_ned(CMAC, CMAC._replace(latitude=CMAC.latitude + 1e-7)).north
    assert north == pytest.approx(0.011131884502145034, rel=1e-6)


def test_crossing_the_date_line_is_a_short_way():
    west, east = Location(0.0, 179.9999, 0.0), Location(0.0, -179.9999, 0.0)
    assert to_ned(west, east).east == pytest.approx(22.26, abs=0.01)
    assert from_ned(west, to_ned(west, east)).longitude == pytest.approx(-179.9999)


def test_forward_at_heading_east_is_east():
    assert rotate_to_ne(1.0, 0.0, math.pi / 2) == pytest.approx((0.0, 1.0))
    assert rotate_to_ne(0.0, 1.0, math.pi / 2) == pytest.approx((-1.0, 0.0))


@pytest.mark.parametrize(("angle", "wrapped"), [(3 * math.pi / 2, -math.pi / 2), (-3 * math.pi / 2, math.pi / 2)])
def test_angles_wrap(angle, wrapped):
    assert wrap_pi(angle) == pytest.approx(wrapped)
