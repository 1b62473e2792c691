from __future__ import annotations

from pathlib import Path

import pytest

from mavproxy_uavapi.launcher.errors import OptionError
from mavproxy_uavapi.rehearsal.faults import ALL
from mavproxy_uavapi.rehearsal.order import order_of


@pytest.fixture
def script(tmp_path: Path) -> str:
    (tmp_path / "a.py").write_text("")
    return str(tmp_path / "a.py")


def test_what_is_not_said_is_usual(script: str) -> None:
    order = order_of([script])
    assert (order.files, order.args, order.runs, order.count) == ((Path(script),), (), ((),), 1)


def test_words_behind_two_dashes_are_the_scripts(script: str) -> None:
    assert order_of([script, "--seed", "3", "--", "--seed", "4"]).args == ("--seed", "4")


def test_each_of_several_files_has_a_vehicle_of_its_own(script: str) -> None:
    assert order_of([script, script]).count == 2
    assert order_of([script, script, "--vehicles", "3"]).count == 3
    with pytest.raises(OptionError, match="--vehicles"):
        order_of([script, script, "--vehicles", "1"])


def test_each_flight_may_be_repeated(script: str) -> None:
    assert order_of([script, "--runs=3"]).repeats == 3
    with pytest.raises(OptionError, match="--runs"):
        order_of([script, "--runs=0"])


def test_all_faults_are_a_flight_each_besides_the_one_without(script: str) -> None:
    order = order_of([script, "--faults", "all"])
    assert [[one.text for one in faults] for faults in order.runs] == [[], *([text] for text in ALL)]


def test_reserve_counts_where_the_battery_becomes_empty(script: str) -> None:
    assert order_of([script]).limits.reserve == 0.0
    assert order_of([script, "--battery", "5000"]).limits.reserve == 20.0


@pytest.mark.parametrize(
    "words",
    [["no.py"], ["--fault", "gps"], ["--report", "a.txt"], ["--speedup", "0"], ["--vehicles", "-1"], ["--what"]],
)
def test_what_makes_no_sense_is_one_line(script: str, words: list[str]) -> None:
    with pytest.raises(OptionError) as raised:
        order_of(words if words == ["no.py"] else [script, *words])
    assert "\n" not in str(raised.value)


def test_list_of_parameters_is_of_any_format_and_makes_no_other_vehicle(script: str, tmp_path: Path) -> None:
    (tmp_path / "real.params").write_text("# a comment\nRTL_ALT_M,23\nMAV_SYSID 7\nWP_SPD=4.5\n")
    order = order_of([script, "--parameters", str(tmp_path / "real.params")])
    assert order.parameters is not None and order.parameters.read_text() == "RTL_ALT_M 23\nWP_SPD 4.5\n"
    (tmp_path / "no.params").write_text("what is this\n")
    with pytest.raises(OptionError, match="--parameters"):
        order_of([script, "--parameters", str(tmp_path / "no.params")])


WPL = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t{home}\t1
1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t10\t1
"""
PLAN = '{{"fileType": "Plan", "version": 1, "mission": {{"version": 2, "items": [{item}], {home}}}}}'
ITEM = '{"command": 22, "frame": 3, "params": [0, 0, 0, null, 0, 0, 10], "type": "SimpleItem"}'


def test_a_mission_starts_where_it_was_planned_unless_a_place_is_given(tmp_path: Path, script: str) -> None:
    def location(text: str, *words: str) -> str:
        (tmp_path / "mission.txt").write_text(text)
        return order_of([script, str(tmp_path / "mission.txt"), *words]).location

    there = WPL.format(home="-35.363\t149.165\t584")
    assert location(there) == "-35.3630000,149.1650000,584.00,0"
    assert location(there, "--location", "CMAC") == "CMAC"
    planned = PLAN.format(item=ITEM, home='"plannedHomePosition": [47.397, 8.545, 488.1]')
    assert location(planned) == "47.3970000,8.5450000,488.10,0"
    ours = '{"home": {"lat": 47.397, "long": 8.545, "alt": 488.1}, "items": [{"command": "NAV_TAKEOFF", "alt": 9}]}'
    assert location(ours) == "47.3970000,8.5450000,488.10,0"


@pytest.mark.parametrize(
    "text",
    [
        "no mission",
        WPL.format(home="0\t0\t0"),
        WPL.format(home="91\t0\t0"),
        PLAN.format(item=ITEM, home='"plannedHomePosition": null'),
        PLAN.format(item=ITEM, home='"plannedHomePosition": [47.397, 8.545]'),
        '{"items": [{"command": "NAV_TAKEOFF", "alt": 9}]}',
        '[{"command": "NAV_TAKEOFF", "alt": 9}]',
    ],
)
def test_a_mission_that_names_no_place_starts_where_all_start(tmp_path: Path, text: str) -> None:
    (tmp_path / "mission.txt").write_text(text)
    assert order_of([str(tmp_path / "mission.txt")]).location == "AbraDF"
