from __future__ import annotations

import pytest

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.rehearsal.record import Asked, Record
from mavproxy_uavapi.rehearsal.rules import Limits, broken
from tests.support.rehearsed import asked, record, sample

MAST = """{"type": "FeatureCollection", "features": [{"type": "Feature",
    "properties": {"kind": "exclusion", "name": "mast", "radius": 5, "ceiling": 20},
    "geometry": {"type": "Point", "coordinates": [149.165230, -35.363081]}}]}"""  # 20 m north of home


def rules_of(one: Record, limits: Limits | None = None) -> list[str]:
    return [each.rule for each in broken(one, limits or Limits())]


def test_flight_that_ends_on_the_ground_breaks_nothing() -> None:
    flown = record(sample(0.0), sample(5.0, 0.0, 10.0), sample(9.0, 0.0, 0.3, sinking=0.5), sample(10.0))
    assert rules_of(flown) == []


def test_vehicle_that_is_left_in_the_air_is_told() -> None:
    assert [one.sentence for one in broken(record(sample(0.0), sample(9.0, 3.0, 12.0)), Limits())] == [
        "it is still in the air at the end, 12 m above home in GUIDED"
    ]


def test_vehicle_that_falls_is_told() -> None:
    assert rules_of(record(sample(0.0, 0.0, 3.0, sinking=6.0), sample(0.5))) == ["ground"]


def test_vehicle_whose_motors_stop_in_the_air_is_told_wherever_it_is_next() -> None:
    assert [one.sentence for one in broken(record(sample(0.0, 9.0, 12.0), sample(0.5)), Limits())] == [
        "its motors stop 12 m above home"
    ]


@pytest.mark.parametrize(
    ("north", "height", "breaks"), [(20.0, 10.0, True), (20.0, 30.0, False), (40.0, 10.0, False)]
)
def test_way_through_an_exclusion_is_told(north: float, height: float, breaks: bool) -> None:
    limits = Limits(Space(formats.read(MAST, "field.geojson")))
    flown = record(sample(0.0), sample(5.0, north, height), sample(8.5, 0.0, 0.5), sample(9.0))
    assert rules_of(flown, limits) == (["envelope"] if breaks else [])


def test_way_of_a_rover_through_an_exclusion_is_told() -> None:
    limits = Limits(Space(formats.read(MAST, "field.geojson")))
    way = [sample(at, north, armed=True, landed=True, speed=5.0) for at, north in ((0.0, 0.0), (4.0, 20.0))]
    assert rules_of(record(*way), limits) == ["envelope"]


def test_way_that_was_refused_is_told() -> None:
    refused = asked(3.0, "/movement/go_to_gps", code="outside_envelope", detail="it would break mast")
    assert rules_of(record(sample(0.0), commands=(refused,))) == ["envelope"]


@pytest.mark.parametrize(
    ("at", "verb", "breaks"),
    [
        (9.0, "/command/rtl", False),  # before he switched
        (10.5, "/command/rtl", False),  # nobody knows it yet
        (12.0, "/command/rtl", True),
        (12.0, "/movement/drive", True),
        (12.0, "/movement/stop", False),
    ],
)
def test_command_after_the_pilots_switch_is_told(at: float, verb: str, breaks: bool) -> None:
    flown = record(sample(0.0), commands=(asked(at, verb),), switched_at={1: 10.0})
    assert rules_of(flown) == (["pilot"] if breaks else [])


def test_command_after_the_answer_that_told_of_the_pilot_is_told_at_once() -> None:
    interrupted = asked(8.0, "/movement/drive_wait", code="mode_changed")
    flown = record(sample(0.0), commands=(interrupted, asked(10.2, "/command/rtl")), switched_at={1: 10.0})
    assert rules_of(flown) == ["pilot"]


def test_vehicles_that_come_near_each_other_in_the_air_are_told() -> None:
    ways = {
        1: [sample(0.0, 0.0, 10.0), sample(1.0, 5.0, 10.0), sample(2.0, 90.0, 0.5), sample(3.0)],
        2: [
            sample(0.1, 30.0, 10.0),
            sample(1.1, 8.0, 10.0),
            sample(2.1, 0.0, 0.5),
            sample(3.1),
        ],  # both at home at last
    }
    assert [one.sentence for one in broken(Record("a.py", ways), Limits(separation=8.0))] == [
        "it is 3.0 m from vehicle 2, less than 8 m"
    ]
    assert rules_of(Record("a.py", ways), Limits(separation=2.0)) == []


def test_battery_that_is_nearly_empty_is_told() -> None:
    flown = record(sample(0.0), sample(9.0, battery=12.0))
    assert rules_of(flown, Limits(reserve=20.0)) == ["battery"]
    assert rules_of(flown) == []


def test_each_rule_is_told_once_for_each_vehicle() -> None:
    refused = [Asked(at, 1, f"{at}", "/movement/drive", "a", {}, code="too_near") for at in (1.0, 2.0)]
    told = broken(record(sample(0.0), commands=tuple(refused)), Limits())
    assert [(one.rule, one.at) for one in told] == [("separation", 1.0)]
