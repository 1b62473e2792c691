from __future__ import annotations

import pytest

from mavproxy_uavapi.core.airspace import time_limits
from mavproxy_uavapi.core.airspace.time_limits import FlightLimits, limits


@pytest.fixture
def usual() -> FlightLimits:
    return limits({}, {})


def test_defaults_are_arducopters(usual: FlightLimits) -> None:
    assert (usual.horizontal, usual.up, usual.down, usual.acceleration) == (10.0, 2.5, 1.5, 2.5)
    assert (usual.land, usual.land_high, usual.land_low_alt) == (0.5, 1.5, 10.0)
    assert (usual.rtl_alt, usual.rtl_speed, usual.rtl_loiter) == (15.0, 10.0, 5.0)
    assert usual.guided_timeout == 3.0


def test_vehicles_own_parameters_count() -> None:
    known = limits({"WPNAV_SPEED": 300.0, "LAND_SPEED_HIGH": 200.0, "RTL_SPEED": 700.0, "GUID_TIMEOUT": 9.0}, {})
    assert (known.horizontal, known.land_high, known.rtl_speed, known.guided_timeout) == (3.0, 2.0, 7.0, 9.0)


@pytest.mark.parametrize(
    ("kind", "attribute"), [("ground", "horizontal"), ("air", "horizontal"), ("climb", "up"), ("descent", "down")]
)
def test_changed_speed_counts_when_it_is_slower(kind: str, attribute: str) -> None:
    assert getattr(limits({}, {kind: 0.7}), attribute) == 0.7
    assert getattr(limits({}, {kind: 40.0}), attribute) == getattr(limits({}, {}), attribute)


def test_no_parameter_makes_a_flight_endless() -> None:
    still = limits({name: 0.0 for names in time_limits.WANTED for name in names}, {})
    assert min(still.horizontal, still.up, still.down, still.land, still.land_high, still.rtl_speed) > 0
    assert time_limits.leg_time(still, 10, 10) < 1000
    assert still.guided_timeout > 0


def test_leg_takes_the_longer_of_cruise_and_climb(usual: FlightLimits) -> None:
    assert time_limits.leg_time(usual, 100, 0) == 10 + 4
    assert time_limits.leg_time(usual, 0, 100) == 40
    assert time_limits.leg_time(usual, 0, -30) == 20
    assert time_limits.leg_time(usual, 100, 100) == 40
    assert time_limits.leg_time(usual, 0, 0) == 0


def test_landing_is_slow_near_the_ground(usual: FlightLimits) -> None:
    assert time_limits.landing_time(usual, 5) == 5 / 0.5 + 5
    assert time_limits.landing_time(usual, 40) == 30 / 1.5 + 10 / 0.5 + 5
    assert time_limits.landing_time(usual, -3) == 5


def test_return_climbs_cruises_loiters_and_lands(usual: FlightLimits) -> None:
    assert time_limits.return_time(usual, 100, 5) == 10 / 2.5 + 10 + 4 + 5 + time_limits.landing_time(usual, 15)
    assert time_limits.return_time(usual, 0, 60) == 4 + 5 + time_limits.landing_time(usual, 60)


def test_allowed_time_grows_with_the_flight_and_shrinks_with_the_speedup() -> None:
    assert time_limits.allowed(100, 1.0) == 230
    assert time_limits.allowed(100, 0.5) == 460
    assert time_limits.allowed(1000, 10.0) == 203


def test_allowed_time_never_falls_below_what_acks_need() -> None:
    assert time_limits.allowed(0, 100.0) == 30


def test_newer_names_of_the_same_parameters_are_in_metres(usual: FlightLimits) -> None:
    newer = {
        "WP_SPD": 10.0, "WP_SPD_UP": 2.5, "WP_SPD_DN": 1.5, "WP_ACC": 2.5, "LAND_SPD_MS": 0.5, "LAND_ALT_LOW_M": 10.0,
        "RTL_ALT_M": 15.0, "RTL_LOIT_TIME": 5000.0, "GUID_TIMEOUT": 3.0,
    }  # fmt: skip
    assert limits(newer, {}) == usual
    assert limits({"RTL_ALT_M": 40.0, "RTL_SPEED_MS": 7.0, "LAND_SPD_HIGH_MS": 1.0}, {}).rtl_alt == 40.0
