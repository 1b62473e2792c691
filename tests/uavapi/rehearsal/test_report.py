from __future__ import annotations

import json
from xml.etree import ElementTree

from mavproxy_uavapi.rehearsal.record import Loss
from mavproxy_uavapi.rehearsal.report import Rehearsed, as_json, as_junit, lines, status_of
from mavproxy_uavapi.rehearsal.rules import Broken
from tests.support.rehearsed import HOME, asked, record, sample

FLOWN = record(sample(0.0), sample(2.0, 30.0, 10.0), sample(4.0, 30.0), commands=(asked(1.0, "/command/arm"),))
WELL = Rehearsed((), FLOWN, ())
FAILED = Rehearsed((), record(sample(0.0), failure="it ended with status 1"), ())
FELL = Rehearsed(("reboot@20s",), FLOWN, (Broken("ground", 8.0, 1, "it meets the ground at 6.0 m/s"),))


def test_what_is_broken_counts_more_than_how_the_file_ended() -> None:
    assert [status_of(each) for each in ([WELL], [WELL, FAILED], [FAILED, FELL, WELL])] == [0, 1, 2]


def test_file_may_end_with_an_error_where_something_goes_wrong() -> None:
    ended = Rehearsed(("pilot_mode=LOITER@leg1",), FAILED.record, ())
    assert (ended.status, lines(ended)[-1]) == (0, "  the file: it ended with status 1")
    (suite,) = ElementTree.fromstring(as_junit([ended]))
    assert suite.get("failures") == "0"


def test_person_reads_what_became_of_it() -> None:
    assert lines(WELL) == [
        "a.py, nothing goes wrong: well",
        "  vehicle 1: 42 m in 0 s, up to 10 m; ends disarmed in GUIDED",
    ]
    assert lines(FELL)[0] == "a.py, reboot@20s: broken"
    assert lines(FELL)[-1] == "  ground, vehicle 1 at 8 s: it meets the ground at 6.0 m/s"
    assert lines(FAILED)[-1] == "  the file: it ended with status 1"


def test_flight_in_which_a_fault_never_began_shows_nothing_of_it() -> None:
    missed = Rehearsed(("reboot@item7",), record(sample(0.0), missed=("reboot@item7",)), ())
    assert missed.status == 3
    assert lines(missed)[-1] == "  reboot@item7 never began: its moment did not come"


def test_programs_read_all_of_it() -> None:
    told = json.loads(as_json([WELL, FELL]))
    assert (told["format"], told["status"], len(told["flights"])) == (1, 2, 2)
    assert told["flights"][1]["broken"][0]["rule"] == "ground"
    vehicle = told["flights"][0]["vehicles"]["1"]
    assert dict(zip(vehicle["columns"], vehicle["samples"][1], strict=True))["height"] == 10.0
    assert told["flights"][0]["commands"][0]["verb"] == "/command/arm"


def test_person_reads_where_it_would_end_without_its_link_or_its_gps() -> None:
    there = sample(0.0, 40.0)
    losses = [
        Loss(10.0, 1, "gps", there.lat, there.lon, 0.0, "LAND", False, 12.0),
        Loss(10.0, 1, "link", there.lat, there.lon, 8.0, "GUIDED", True, 20.0),
        Loss(20.0, 1, "link", HOME[0], HOME[1], 0.0, "RTL", False, 30.0),
    ]
    flown = Rehearsed((), record(sample(0.0), losses=losses), ())
    assert lines(flown)[-2:] == [
        "  vehicle 1 without the GPS (1 of its moments): it lands at most 40 m from its start",
        "  vehicle 1 without the link or the companion (2 of its moments): it lands at most 0 m from its start; "
        "it stays up, in GUIDED, if that is at 10 s",
    ]
    assert json.loads(as_json([flown]))["flights"][0]["losses"][0]["what"] == "gps"


def test_build_server_reads_a_case_for_each_rule() -> None:
    suites = ElementTree.fromstring(as_junit([FELL, FAILED]))
    assert [suite.get("failures") for suite in suites] == ["1", "1"]
    failed = [case.get("name") for suite in suites for case in suite if case.find("failure") is not None]
    assert failed == ["ground", "file"]
    missed = Rehearsed(("reboot@item7",), record(sample(0.0), missed=("reboot@item7",)), ())
    (suite,) = ElementTree.fromstring(as_junit([missed]))
    assert [case.get("name") for case in suite if case.find("error") is not None] == ["judged"]
