from __future__ import annotations

import pytest

from mavproxy_uavapi.rehearsal.faults import ALL, LASTS, NoSuchFault, fault_of
from tests.support.rehearsed import sample

GROUND, LOW, HIGH = sample(0.0), sample(1.0, height=1.0), sample(2.0, height=16.0)


def test_fault_without_a_moment_begins_in_the_air() -> None:
    fault = fault_of("gps_loss")
    assert [fault.is_due(one, 0.0, 0) for one in (GROUND, LOW, HIGH)] == [False, False, True]
    assert fault.lines() == [{"op": "fault", "name": "ekf_bad", "seconds": LASTS}]


def test_fault_begins_at_a_time_a_height_an_item_or_a_leg() -> None:
    assert [fault_of("reboot@20s").is_due(HIGH, since, 0) for since in (None, 19.0, 20.0)] == [False, False, True]
    assert [fault_of("reboot@15m").is_due(one, 9.0, 0) for one in (LOW, HIGH)] == [False, True]
    items = [sample(1.0, height=9.0, item=number) for number in (1, 2)]
    assert [fault_of("reboot@item2").is_due(one, 9.0, 0) for one in items] == [False, True]
    assert [fault_of("reboot@leg3").is_due(HIGH, 9.0, legs) for legs in (2, 3)] == [False, True]


def test_fault_without_a_moment_begins_when_a_rover_drives() -> None:
    stands, drives = (sample(1.0, armed=True, landed=True, speed=speed) for speed in (0.0, 2.0))
    assert [fault_of("reboot").is_due(one, 0.0, 0) for one in (stands, drives)] == [False, True]


def test_fault_lasts_as_long_as_it_says() -> None:
    assert fault_of("link_loss@20s:7.5s").lines() == [{"op": "fault", "name": "silence", "seconds": 7.5}]
    assert fault_of("wind_gust=12").lines() == [{"op": "parameter", "name": "SIM_WIND_SPD", "value": 12.0}]
    assert fault_of("pilot_mode=loiter@leg3").lines() == [{"op": "fault", "name": "pilot_mode", "mode": "LOITER"}]
    assert fault_of("companion_killed").lines() == []


@pytest.mark.parametrize("text", ["", "gps", "gps_loss@", "gps_loss@soon", "pilot_mode", "gps_loss@20", "reboot@leg"])
def test_what_is_no_fault_is_refused(text: str) -> None:
    with pytest.raises(NoSuchFault):
        fault_of(text)


def test_all_faults_are_some() -> None:
    assert [fault_of(text).text for text in ALL] == list(ALL)
