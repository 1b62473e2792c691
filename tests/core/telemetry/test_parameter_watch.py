from __future__ import annotations

from mavproxy_uavapi.core.telemetry.parameter_watch import ParameterWatch


def test_first_look_reports_all_and_the_next_ones_what_has_changed() -> None:
    watch, tables = ParameterWatch(), {(1, 1): {"RTL_ALT": 1500, "LAND_SPEED": 50.0}}
    assert watch.changes(tables) == {(1, 1): {"RTL_ALT": 1500.0, "LAND_SPEED": 50.0}}
    assert watch.changes(tables) == {}
    tables[1, 1]["RTL_ALT"] = 2000
    tables[2, 1] = {"RTL_ALT": 3000}
    assert watch.changes(tables) == {(1, 1): {"RTL_ALT": 2000.0}, (2, 1): {"RTL_ALT": 3000.0}}


def test_table_that_is_emptied_and_filled_again_reports_what_is_different() -> None:
    watch, tables = ParameterWatch(), {(1, 1): {"RTL_ALT": 1500.0, "LAND_SPEED": 50.0}}
    watch.changes(tables)
    tables[1, 1] = {}
    assert watch.changes(tables) == {}
    tables[1, 1] = {"RTL_ALT": 1500.0}
    assert watch.changes(tables) == {(1, 1): {"RTL_ALT": 1500.0}}
