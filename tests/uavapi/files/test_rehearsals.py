"""Rehearsals are kept by what was flown."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from mavproxy_uavapi.core.mission.mission_files import parts_of
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.rehearsal import run as rehearsal

GOAL = {"command": "NAV_WAYPOINT", "frame": 3, "lat": -35.363, "long": 149.165, "alt": 20.1}


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "mavproxy-uavapi" / "rehearsed"


def test_report_is_found_by_the_same_bytes_only() -> None:
    rehearsals.keep(rehearsals.digest_of(b"fly()"), "first")
    rehearsals.keep(rehearsals.digest_of(b"fly()"), "second")
    assert rehearsals.find(rehearsals.digest_of(b"fly()")) == b"second"
    assert rehearsals.find(rehearsals.digest_of(b"fly() ")) is None


def test_what_went_well_counts_until_it_is_rehearsed_otherwise() -> None:
    assert rehearsals.vouched("one") == ""
    rehearsals.keep("one", "report")
    rehearsals.vouch("one", "these")
    assert rehearsals.vouched("one") == "these"
    rehearsals.keep("one", "another")
    assert rehearsals.vouched("one") == ""


def test_oldest_go_and_one_that_is_too_large_is_left(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rehearsals, "MOST_KEPT", 3)
    for number in range(5):
        rehearsals.keep(str(number), "x" * 10)
        os.utime(state / f"{number}.json", (number, number))
    rehearsals.keep("new", "x" * 10)
    assert sorted(path.stem for path in state.iterdir()) == ["3", "4", "new"]
    monkeypatch.setattr(rehearsals, "MOST_BYTES", 9)
    assert rehearsals.find("new") is None


def test_mission_is_the_same_in_another_format_and_from_another_home(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps({"items": [GOAL]}))
    row = "3\t16\t0\t0\t0\t0\t-35.363\t149.165\t20.1\t1"
    home = "0\t1\t0\t16\t0\t0\t0\t0\t-30.0\t140.0\t584\t1"
    (tmp_path / "a.waypoints").write_text(f"QGC WPL 110\n{home}\n1\t0\t{row}\n")
    digests = {rehearsal._digest_of(tmp_path / name) for name in ("a.json", "a.waypoints")}
    assert digests == {rehearsals.digest_of_mission(parts_of(json.dumps({"items": [GOAL]})).items)}
    (tmp_path / "none.plan").write_text("no mission")
    assert rehearsal._digest_of(tmp_path / "none.plan") == rehearsals.digest_of(b"no mission")


def test_rehearsals_under_way_are_known_until_the_last_one_ends() -> None:
    assert not rehearsals.is_under_way()
    with rehearsals.under_way():
        with rehearsals.under_way():
            assert rehearsals.is_under_way()
        assert rehearsals.is_under_way()
    assert not rehearsals.is_under_way()
