from __future__ import annotations

from mavproxy_uavapi.core.airspace.forecast import Pace
from mavproxy_uavapi.core.airspace.ordered import Ordered
from mavproxy_uavapi.core.geodesy import moved
from mavproxy_uavapi.core.mission.mission_legs import Leg, MissionRoute, PathPoint

PACE = Pace(10.0, 2.5, 1.5)


def at(north: float, east: float, up: float = 10.0) -> PathPoint:
    return PathPoint(*moved(-35.0, 149.0, north, east), up)


def mission(*margins: float) -> Ordered:
    legs = [Leg(at(100.0 * n, 0), at(100.0 * n + 100, 0), n, PACE, PACE, margin) for n, margin in enumerate(margins)]
    return Ordered.by_mission(MissionRoute(tuple(legs)).way(), 0.0)


def test_a_vehicle_in_its_turn_is_on_its_way_as_far_as_the_leg_allows() -> None:
    """It was stopped there at the border, though the mission was allowed with the turn."""
    ordered = mission(0.0, 110.0, 0.0)
    assert ordered.is_beside(at(150, 100), 80.0) and not ordered.is_beside(at(150, 120), 80.0)
    assert ordered.is_beside(at(10, 70), 80.0) and not ordered.is_beside(at(-70, 90), 80.0)
    assert not Ordered().is_beside(at(0, 0), 80.0)


def test_a_vehicle_has_left_a_circle_when_it_flies_another_item() -> None:
    legs = [Leg(at(100.0 * n, 0), at(100.0 * n + 100, 0), 1 + n // 2, PACE, PACE, circles=n > 1) for n in range(5)]
    ordered = Ordered.by_mission(MissionRoute((*legs[:4], legs[4]._replace(circles=False))).way(), 0.0)
    for item in (None, 1, 2):
        ordered.advance(at(380, 0), item)
        assert ordered.passed == 2, "it may come round again"
    ordered.advance(at(380, 0), 3)
    assert ordered.passed == 4


def test_a_vehicle_that_has_passed_a_corner_has_the_next_ones_ahead() -> None:
    ordered = mission(0.0, 0.0, 0.0)
    ordered.advance(at(101, 1))
    ahead = ordered.path_ahead
    assert ahead is not None and [round((lat + 35) * 111_319) for lat, _, _ in ahead.ends] == [200, 300]
    assert not list(ordered.ahead), "thousands of objects would hold the thread"
    assert Ordered().path_ahead is None and list(Ordered().ahead) == []
