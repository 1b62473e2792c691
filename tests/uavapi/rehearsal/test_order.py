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


def test_list_of_parameters_is_read_in_any_format_and_makes_no_other_vehicle(script: str, tmp_path: Path) -> None:
    (tmp_path / "real.params").write_text("# a comment\nRTL_ALT_M,23\nMAV_SYSID 7\nWP_SPD=4.5\n")
    order = order_of([script, "--parameters", str(tmp_path / "real.params")])
    assert order.parameters is not None and order.parameters.read_text() == "RTL_ALT_M 23\nWP_SPD 4.5\n"
    (tmp_path / "no.params").write_text("what is this\n")
    with pytest.raises(OptionError, match="--parameters"):
        order_of([script, "--parameters", str(tmp_path / "no.params")])
