"""How far a vehicle goes before it stands: beside what ArduCopter's SITL needed."""

from __future__ import annotations

import pytest

from mavproxy_uavapi.core.airspace import braking

LATE = 0.15  # s: the mode took so long from the position after which it was sent


@pytest.mark.parametrize(("speed", "metres"), [(1.01, 1.61), (2.0, 3.29), (4.01, 7.04), (7.04, 13.5), (10.16, 21.01)])
def test_brake_takes_as_long_as_arducopters(speed: float, metres: float) -> None:
    model = braking.of_brake({}).distance(speed)
    assert metres - LATE * speed <= model <= 1.1 * metres


def test_a_lean_that_is_small_brakes_late() -> None:
    assert braking.of_brake({"ATC_ANGLE_MAX": 15.0}).distance(10.0) > 1.3 * braking.of_brake({}).distance(10.0)
