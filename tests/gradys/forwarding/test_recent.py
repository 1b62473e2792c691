from __future__ import annotations

from typing import Any

import pytest

from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.recent import MOST_POINTS, MOST_SERIES, RecentReadings


def reading(value: Any, at: float = 1.0, device: str = "uav-1", quantity: str = "temperature") -> Reading:
    return Reading(device, 1, quantity, "°C", value, at)


def test_points_come_by_series_and_only_those_after_a_time() -> None:
    recent = RecentReadings()
    for at in (1.0, 2.0, 3.0):
        recent.add(reading(20 + at, at))
    recent.add(reading(7, 2.5, device="buoy"))
    buoy, vehicle = recent.report(since=1.0)
    assert (buoy["device"], buoy["points"]) == ("buoy", [[2.5, 7.0]])
    assert (vehicle["quantity"], vehicle["representation"]) == ("temperature", "°C")
    assert vehicle["points"] == [[2.0, 22.0], [3.0, 23.0]]


@pytest.mark.parametrize("value", [True, "high", [1.0, 2.0]])
def test_what_is_no_number_makes_no_curve(value: Any) -> None:
    recent = RecentReadings()
    recent.add(reading(value))
    assert recent.report(0.0) == []


def test_oldest_points_of_a_series_are_forgotten() -> None:
    recent = RecentReadings()
    for number in range(MOST_POINTS + 5):
        recent.add(reading(number, 1.0 + number))
    (series,) = recent.report(0.0)
    assert (len(series["points"]), series["points"][0][1]) == (MOST_POINTS, 5.0)


def test_series_that_was_silent_longest_is_forgotten() -> None:
    recent = RecentReadings()
    for number in range(MOST_SERIES):
        recent.add(reading(1, device=f"d{number:03}"))
    recent.add(reading(2, device="d000"))
    recent.add(reading(1, device="new"))
    devices = {series["device"] for series in recent.report(0.0)}
    assert len(devices) == MOST_SERIES
    assert "d001" not in devices and {"d000", "new"} <= devices
