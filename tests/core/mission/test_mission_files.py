from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.mission import mission_files
from mavproxy_uavapi.core.mission.mission_files import MissionItem, difference
from mavproxy_uavapi.core.mission.mission_formats import MOST_ITEMS

mavlink = mavutil.mavlink

ROWS = [
    "QGC WPL 110",
    "0\t1\t0\t16\t0\t0\t0\t0\t-35.363261\t149.165230\t584\t1",
    "1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t10\t1",
    "2\t0\t3\t16\t0\t0\t0\t0\t-35.3630000\t149.1653001\t12.5\t1",
    "3\t0\t3\t203\t1\t0\t0\t0\t1\t0\t0\t1",
]
WPL = "\n".join(ROWS)
TAKEOFF = MissionItem(22, 3, (0.0, 0.0, 0.0, 0.0), 0, 0, 10.0)
LEG = MissionItem(16, 3, (0.0, 0.0, 0.0, 0.0), -353630000, 1491653001, 12.5)
SHOOT = MissionItem(203, 3, (1.0, 0.0, 0.0, 0.0), 1, 0, 0.0)


def read(text: str) -> list[MissionItem]:
    return list(mission_files.parts_of(text).items)


@pytest.mark.parametrize(
    "text", [WPL, WPL + "\n", "\ufeff" + WPL.replace("\n", "\r\n"), WPL.replace("\n1\t", "\n# up\n1\t")]
)
def test_qgc_wpl_without_its_home(text: str) -> None:
    assert read(text) == [TAKEOFF, LEG, SHOOT]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "hello",
        "[",
        "[" * 100_000,
        "1",
        "null",
        "{}",
        '{"items": 1}',
        '{"mission": {"items": 1}}',
        "QGC WPL 999\n" + ROWS[1],
        ROWS[0] + "\n1 2 3",
        ROWS[0] + "\n" + ROWS[1].replace("584", "high"),
        ROWS[0] + "\n" + ROWS[2].replace("1", "0", 1),
    ],
)
def test_what_is_no_mission_is_a_bad_request(text: str) -> None:
    with pytest.raises(BadRequest):
        read(text)


def plan(*items: Any) -> str:
    return json.dumps({"fileType": "Plan", "mission": {"items": list(items)}})


def simple(command: int, *params: Any, frame: int = 3) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": list(params), "autoContinue": True}


def test_plan_with_a_survey_and_unknown_yaw() -> None:
    leg = simple(16, 0, 0, 0, None, -35.363, 149.1653001, 12.5)
    survey = {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {"Items": [leg]}}
    assert read(plan(simple(22, 0, 0, 0, None, 0, 0, 10), survey)) == [TAKEOFF, LEG]


def test_plan_with_what_only_qgroundcontrol_can_expand_is_reported() -> None:
    with pytest.raises(BadRequest, match="StructureScan"):
        read(plan({"type": "ComplexItem", "complexItemType": "StructureScan"}))


EMPTY = {"geoFence": {"circles": [], "polygons": [], "version": 2}, "rallyPoints": {"points": [], "version": 2}}
RING = [[-35.36, 149.16], [-35.36, 149.17], [-35.35, 149.17]]
POLYGON = {"inclusion": True, "polygon": RING, "version": 1}
CIRCLE = {"inclusion": False, "circle": {"center": RING[0], "radius": 20}, "version": 1}
FULL = {
    "geoFence": {"circles": [CIRCLE], "polygons": [POLYGON, POLYGON], "version": 2},
    "rallyPoints": {"points": [[-35.36, 149.16, 30]], "version": 2},
}
OLD_FENCE = {"geoFence": {"polygon": RING, "version": 1}}


def test_the_parts_of_a_plan_are_its_items_its_fence_and_its_rally_points() -> None:
    parts = mission_files.parts_of(json.dumps(json.loads(plan(simple(22, 0, 0, 0, None, 0, 0, 10))) | FULL))
    assert parts.items == (TAKEOFF,)
    assert parts.rally == ((-35.36, 149.16, 30.0),)
    assert parts.fence is not None and parts.fence.summary() == "2 inclusions, 1 exclusion"
    assert parts.fence.every


@pytest.mark.parametrize(("command", "path"), [(5000, "fence"), (5001, "fence"), (5004, "fence"), (5100, "rally")])
def test_a_fence_or_rally_points_are_no_mission(command: int, path: str) -> None:
    rows = [f"{seq}\t0\t3\t{command if seq else 16}\t4\t0\t0\t0\t-35.36\t149.16\t0\t1" for seq in (0, 1, 2)]
    with pytest.raises(
        Invalid, match=rf"items.1: item 1 \(NAV_.*\) belongs to no mission: POST /mission/{path} takes"
    ):
        mission_files.parts_of("\n".join(["QGC WPL 110", *rows]))


def test_json_items_by_name_or_number() -> None:
    items = [
        {"command": "NAV_TAKEOFF", "alt": 10},
        {"command": "mav_cmd_nav_waypoint", "frame": "relative", "lat": -35.363, "long": 149.1653001, "alt": 12.5},
        {"command": 203, "frame": 3, "param1": 1, "param5": 1},
    ]
    assert read(json.dumps({"items": items})) == read(json.dumps(items)) == [TAKEOFF, LEG, SHOOT]


def test_a_reported_mission_can_be_posted_again() -> None:
    reported = [item.report(seq) for seq, item in enumerate([TAKEOFF, LEG, SHOOT], 1)]
    assert read(json.dumps({"items": reported})) == [TAKEOFF, LEG, SHOOT]


BAD_ITEMS = [
    {"command": "NAV_WAYPOINT", "lat": 91},
    {"command": "NAV_WAYPOINT", "long": -180.5},
    {"command": "NAV_WAYPOINT", "alt": 10_001},
    {"command": "NAV_WAYPOINT", "alt": float("nan")},
    {"command": "NAV_WAYPOINT", "param1": float("inf")},
    {"command": "NAV_WAYPOINT", "lat": "1"},
    {"command": "NAV_WAYPOINT", "lat": True},
    {"command": "NAV_WAYPOINT", "frame": 9},
    {"command": "NAV_WAYPOINT", "frame": "moon"},
    {"command": "FLY"},
    {"command": 70000},
    {"command": -1},
    {"command": 16.5},
    {"command": 178, "param5": 1e12},
    {"lat": 1},
    "text",
    None,
]


@pytest.mark.parametrize("item", BAD_ITEMS, ids=str)
def test_items_that_cannot_be_flown_are_invalid_and_say_which(item: Any) -> None:
    with pytest.raises(Invalid) as caught:
        read(json.dumps({"items": [{"command": "NAV_TAKEOFF", "alt": 5}, item]}))
    assert [str(part) for part in caught.value.problems[0]["loc"][:2]] == ["items", "2"]


@pytest.mark.parametrize("count", [0, MOST_ITEMS + 1])
def test_too_few_and_too_many_items_are_invalid(count: int) -> None:
    with pytest.raises(Invalid, match="items besides home"):
        read(json.dumps({"items": [{"command": "NAV_TAKEOFF", "alt": 5}] * count}))


def test_item_survives_the_wire() -> None:
    for item in (TAKEOFF, LEG, SHOOT):
        message = item.to(Address(1, 1), 7)
        message.pack(mavlink.MAVLink(None, 255, 230))
        assert (message.seq, message.mission_type) == (7, mavlink.MAV_MISSION_TYPE_MISSION)
        assert mission_files.from_message(message) == item


def test_answer_in_floats_is_understood() -> None:
    message = mavlink.MAVLink_mission_item_message(255, 230, 1, 3, 16, 0, 1, 0, 0, 0, 0, -35.363, 149.1653001, 12.5)
    assert mission_files.from_message(message) == LEG
    message = mavlink.MAVLink_mission_item_message(255, 230, 1, 3, 203, 0, 1, 1, 0, 0, 0, 1, 0, 0)
    assert mission_files.from_message(message) == SHOOT


@pytest.mark.parametrize(
    ("read_back", "words"),
    [
        ([TAKEOFF, LEG], None),
        ([TAKEOFF, replace(LEG, params=(9.0, 0.0, 0.0, 0.0))], None),
        ([TAKEOFF, replace(LEG, frame=6, z=12.51, x=LEG.x + 5)], None),
        ([TAKEOFF], "1 items, not 2"),
        ([TAKEOFF, SHOOT], "item 2 is DO_DIGICAM_CONTROL"),
        ([TAKEOFF, replace(LEG, x=LEG.x + 50)], "item 2"),
        ([TAKEOFF, replace(LEG, z=13.0)], "item 2"),
        ([TAKEOFF, replace(LEG, frame=0)], "item 2"),
    ],
)
def test_read_back_is_compared_by_what_every_autopilot_keeps(read_back: list[MissionItem], words: str | None) -> None:
    reported = difference([TAKEOFF, LEG], read_back)
    assert reported is None if words is None else reported is not None and words in reported
