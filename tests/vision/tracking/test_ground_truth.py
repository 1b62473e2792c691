from __future__ import annotations

import pytest

from mavproxy_vision.geometry.frames import Attitude
from mavproxy_vision.tracking.ground_truth import Pose, Truth


def pose(at: float, alt: float) -> Pose:
    return Pose(at, -35.363261, 149.165230, alt, (0.0, 0.0, 0.0), Attitude(0.0, 0.0, 0.0))


def down(truth: Truth, at: float) -> float:
    known = truth.at(at)
    assert known is not None
    return float(known[0][2])


def test_home_is_where_the_vehicle_stands_when_it_is_armed():
    truth = Truth()
    truth.add(pose(1.0, 584.0), False, None)
    truth.add(pose(2.0, 585.0), True, 0.0)
    truth.add(pose(3.0, 595.0), True, 9.0)
    assert down(truth, 3.0) == pytest.approx(-10.0)


def test_in_the_air_home_is_below_by_the_estimated_height():
    truth = Truth()
    truth.add(pose(1.0, 594.0), True, 10.0)
    assert down(truth, 1.0) == pytest.approx(-10.0)


@pytest.mark.parametrize(("armed", "height"), [(True, None), (None, 10.0), (None, None)])
def test_nothing_is_known_while_home_is_not(armed, height):
    truth = Truth()
    truth.add(pose(1.0, 594.0), armed, height)
    assert truth.at(1.0) is None
    truth.add(pose(1.1, 594.0), True, 10.0)
    assert down(truth, 1.1) == pytest.approx(-10.0)
