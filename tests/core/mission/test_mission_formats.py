"""Missions as the field's programs write them: read right, or refused by name. A missing place is never 0, 0."""

from __future__ import annotations

import json
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.mission.mission_formats import WrittenItem, read

PLACE = (-35.363, 149.165)
HOME_ROW = "0\t1\t0\t16\t0\t0\t0\t0\t-35.363\t149.165\t584\t1"
ROW = "{}\t0\t3\t16\t0\t0\t0\t0\t-35.363\t149.165\t12\t1"
LEG = WrittenItem(16, 3, (0.0, 0.0, 0.0, 0.0, *PLACE, 12.0))


def wpl(*rows: str) -> str:
    return "\n".join(["QGC WPL 110", *rows])


def items(*written: Any, **members: Any) -> str:
    return json.dumps({"items": list(written), **members})


def leg(**changes: Any) -> dict[str, Any]:
    whole = {"command": "NAV_WAYPOINT", "lat": PLACE[0], "long": PLACE[1], "alt": 12, **changes}
    return {name: value for name, value in whole.items() if value != "left out"}


def simple(*params: Any, command: int = 16, **more: Any) -> dict[str, Any]:
    return {
        "type": "SimpleItem",
        "command": command,
        "frame": 3,
        "autoContinue": True,
        "params": list(params),
        **more,
    }


OLD_ITEM = {
    "type": "missionItem", "command": 16, "frame": 3, "autoContinue": True, "id": 1, "coordinate": [*PLACE, 12],
    "param1": 0, "param2": 0, "param3": 0, "param4": 0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "written"),
    [
        (wpl(HOME_ROW, ROW.format(1)), [LEG]),
        (wpl(ROW.format(1), ROW.format(2)), [LEG, LEG]),
        (wpl(HOME_ROW.replace("\t16", "\t0"), ROW.format(1)), [LEG]),  # Mission Planner's, where home is not known
        (wpl(ROW.format(1).replace("0\t-35", "NaN\t-35")), [LEG]),  # the yaw is left to the autopilot
        (wpl("# by hand", "", ROW.format(1).replace("\t", "  ")), [LEG]),
        (items(leg()), [LEG]),
        (items(leg(long="left out", lon=PLACE[1])), [LEG]),
        (items({"command": 16, "latitude": PLACE[0], "longitude": PLACE[1], "altitude": 12}), [LEG]),
        (items({"command": 16, "param5": PLACE[0], "param6": PLACE[1], "param7": 12}), [LEG]),
        (items({"command": "NAV_TAKEOFF", "alt": 5}), [WrittenItem(22, 3, (0.0,) * 6 + (5.0,))]),
        (items({"command": "NAV_LAND"}), [WrittenItem(21, 3, (0.0,) * 7)]),
        (items(OLD_ITEM, version="1.0", MAV_AUTOPILOT=3, complexItems=[], plannedHomePosition=OLD_ITEM), [LEG]),
        (items(simple(0, 0, 0, None, coordinate=[*PLACE, 12]), fileType="Mission", version=2), [LEG]),
        (items(simple(0, 0, 0, None, *PLACE, 12)), [LEG]),
        (items(simple(0, 0, 0, 0, *PLACE, 12, altitude=None, altitudeMode=None)), [LEG]),
        (
            items(simple(3, None, None, None, None, None, None, command=112)),
            [WrittenItem(112, 3, (3.0,) + (0.0,) * 6)],
        ),
        (
            items(
                simple(0, 0, 0, 0, *PLACE, 12, doJumpId=1),
                simple(0, 0, 0, 0, *PLACE, 12, doJumpId=7),
                simple(7, 2, 0, 0, 0, 0, 0, command=177, doJumpId=8),
            ),
            [LEG, LEG, WrittenItem(177, 3, (2.0, 2.0) + (0.0,) * 5)],
        ),
    ],
)
def test_missions_of_every_program_mean_the_same(text: str, written: list[WrittenItem]) -> None:
    assert read(text).items == written


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (wpl(ROW.format(2)), "line 2: the first row has the number 2, not 0 (home) or 1"),
        (wpl(HOME_ROW, ROW.format(2)), "line 3: the row has the number 2, not 1"),
        (wpl(HOME_ROW, ROW.format(1).replace("-35.363", "-35,363")), "latitude is '-35,363', not a number: numbers"),
        (wpl(HOME_ROW, ROW.format(1).replace("16", "16.5")), "line 3: its command is '16.5', not a whole number"),
        (wpl(HOME_ROW, ROW.format(1) + "\t7"), "line 3 is not a row of 12 columns"),
        (wpl(HOME_ROW.replace("\t16", "\t22")), "is home, a NAV_WAYPOINT (16); this is a NAV_TAKEOFF: put home"),
        (wpl(HOME_ROW, ROW.format(1).replace("-35.363", "nan")), "line 3: its latitude is 'nan', not a number"),
        ("QGC WPL 120\n", "begins with 'QGC WPL 120'"),
        (
            items(leg(), {"type": "ComplexItem", "complexItemType": "StructureScan"}),
            "item 2 of the .plan file is a 'StructureScan', which only QGroundControl can convert to items: r",
        ),
        (items(leg(lat="left out")), "items.1: item 1 (NAV_WAYPOINT) has no lat"),
        (items(leg(), leg(lat="left out", long="left out")), "items.2: item 2 (NAV_WAYPOINT) has no lat and no long"),
        (items(leg(alt="left out")), "item 1 (NAV_WAYPOINT) has no alt"),
        (items(leg(alt=None)), "item 1 (NAV_WAYPOINT): its alt is null, not a number"),
        (items(leg(lat="1")), "its lat is '1', not a number"),
        (items(leg(lat=10**400)), "its lat is Infinity, not a number"),
        (items({"command": "NAV_TAKEOFF", "lat": 1, "alt": 5}), "item 1 (NAV_TAKEOFF) has no long"),
        (items({"command": "NAV_TAKEOFF"}), "item 1 (NAV_TAKEOFF) has no alt"),
        (items(leg(lon=PLACE[1])), "has lon and long, which are the same"),
        (items(leg(param5=1)), "has lat and param5, which are the same"),
        (items(leg(latt=1)), "has an unknown 'latt'; did you mean lat?"),
        (items({"command": "DO_CHANGE_SPEED", "lat": 1}), "has lat, and is no place"),
        (items(leg(command="NAV_WAYPONT")), "item 1: there is no command 'NAV_WAYPONT'"),
        (items(leg(frame="moon")), "there is no frame 'moon'"),
        (items(leg(autocontinue="false")), "its autocontinue is 'false', not true or false"),
        (items(leg(), itmes=[]), "the mission has an unknown 'itmes'; did you mean items?"),
        (items(simple(0, 0, 0, 0, None, None, 12)), "item 1 (NAV_WAYPOINT): its lat is null, not a number"),
        (items(simple(0, 0, 0, 0)), "params has 4 numbers, with its coordinate; there are 7"),
        (items(simple(*[0] * 7, coordinate=[*PLACE, 12])), "params has 10 numbers"),
        (items(simple(0, 0, 0, 0, *PLACE, 12, lat=3)), "has lat besides params or coordinate"),
        (items(simple(9, 1, 0, 0, 0, 0, 0, command=177, doJumpId=1)), "item 1 (DO_JUMP) jumps to 9, and no item has"),
        (items(OLD_ITEM, complexItems=[{}]), "complexItems, which only QGroundControl can convert"),
        (items({**OLD_ITEM, "coordinate": [1, 2]}), "params has 6 numbers"),
    ],
)  # fmt: skip
def test_what_is_missing_or_ambiguous_is_refused_by_number_and_command(text: str, words: str) -> None:
    with pytest.raises((BadRequest, Invalid)) as caught:
        read(text)
    assert words in str(caught.value)
