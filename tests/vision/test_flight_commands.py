from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision import flight_commands
from mavproxy_vision.landing.mission import MissionPlan


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("", {"id": None, "method": "velocity"}),
        ("7", {"id": 7, "method": "velocity"}),
        ("landing_target", {"id": None, "method": "landing_target"}),
        ("landing_target 7", {"id": 7, "method": "landing_target"}),
        ("7 landing_target", {"id": 7, "method": "landing_target"}),
    ],
)
def test_a_landing_has_an_id_and_a_method_in_any_order(words: str, expected: dict[str, Any]) -> None:
    assert flight_commands.land(words.split(), "velocity") == expected


def test_a_search_has_an_id_at_most() -> None:
    assert flight_commands.search([]) == {"id": None}
    assert flight_commands.search(["0"]) == {"id": 0}


@pytest.mark.parametrize(
    ("words", "plan"),
    [
        ("", MissionPlan(5.0, 8.0, -5.0)),
        ("10", MissionPlan(10.0, 8.0, -5.0)),
        ("10 1 2", MissionPlan(10.0, 1.0, 2.0)),
        ("10 1 2 3", MissionPlan(10.0, 1.0, 2.0, tag=3)),
        ("10 1 2 none", MissionPlan(10.0, 1.0, 2.0, on_tag=False)),
    ],
)
def test_a_mission_has_a_place_and_an_id_or_none(words: str, plan: MissionPlan) -> None:
    assert flight_commands.plan(flight_commands.mission(words.split(), "velocity")) == plan


@pytest.mark.parametrize(
    ("command", "words", "sentence"),
    [
        (flight_commands.search, "x", "'x' is not an id"),
        (flight_commands.search, "-1", "'-1' is not an id"),
        (flight_commands.search, "²", "'²' is not an id"),
        (flight_commands.search, "1 2", "'1 2' is not an id"),
        (lambda args: flight_commands.land(args, "velocity"), "magic", "'magic' is not an id"),
        (lambda args: flight_commands.mission(args, "velocity"), "a", "mission [ALT NORTH EAST [ID|none]], in m"),
        (lambda args: flight_commands.mission(args, "velocity"), "0", "the altitude is more than 0"),
        (lambda args: flight_commands.mission(args, "velocity"), "nan", "the altitude is more than 0"),
        (lambda args: flight_commands.mission(args, "velocity"), "5 nan 0", "north and east are at most"),
        (lambda args: flight_commands.mission(args, "velocity"), "5 0 1e9", "north and east are at most"),
        (lambda args: flight_commands.mission(args, "velocity"), "5 0 0 x", "'x' is not an id"),
    ],
)
def test_wrong_words_are_explained(command: Callable[[list[str]], Any], words: str, sentence: str) -> None:
    with pytest.raises(SettingError) as refusal:
        command(words.split())
    assert str(refusal.value).startswith(sentence)
