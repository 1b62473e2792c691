from __future__ import annotations

import pytest

from mavproxy_uavapi.core.airspace.time_limits import limits
from mavproxy_uavapi.core.vehicle.touchdown import FREE_FALL, Touchdown

DISARMED = 100.0  # s
G = 9.81  # m/s²


@pytest.fixture
def touchdown() -> Touchdown:
    return Touchdown(limits({}, {}))


def test_vehicle_that_stands_after_disarming_has_landed(touchdown: Touchdown) -> None:
    touchdown.moves_at(0.4, 0.0)
    touchdown.disarmed(DISARMED)
    touchdown.moves_at(0.0, 0.0)
    assert touchdown.is_over(DISARMED + 0.2, age=0.0) is None
    assert touchdown.is_over(DISARMED + 0.7, age=0.1) is True
    assert not touchdown.fell


def test_position_that_comes_before_a_fall_is_fast_is_no_landing(touchdown: Touchdown) -> None:
    touchdown.disarmed(DISARMED)
    for after in (0.02, 0.08, 0.3, 0.6, 1.0):
        touchdown.moves_at(G * after, 0.0)
        assert touchdown.is_over(DISARMED + after, age=0.0) is None
    assert touchdown.fell


@pytest.mark.parametrize("age", [None, 30.0])
def test_without_positions_the_disarming_counts(touchdown: Touchdown, age: float | None) -> None:
    touchdown.disarmed(DISARMED)
    assert touchdown.is_over(DISARMED + FREE_FALL, age) is None
    assert touchdown.is_over(DISARMED + 2.0, age) is True


def test_vehicle_disarmed_at_speed_flies(touchdown: Touchdown) -> None:
    touchdown.moves_at(0.0, 12.0)
    touchdown.disarmed(DISARMED)
    assert touchdown.fell
