"""The rally points of Mission Planner and MAVProxy: rows of QGC WPL 110, or older lines `RALLY …`. Pure."""

from __future__ import annotations

import re

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.mission import wpl
from mavproxy_uavapi.core.mission.mission_formats import WrittenItem, item_of
from mavproxy_uavapi.core.strict_json import shown
from mavproxy_uavapi.core.values import NUMBER

mavlink = mavutil.mavlink

RALLY = "RALLY"
COLUMNS = 7  # with latitude, longitude, m above home; height of the break, direction of the landing, RALLY_FLAGS


def is_rows(text: str) -> bool:
    """Whether the text may be one of these files, comments before its first line included."""
    first = next((line for line in text.split("\n") if line.strip() and not line.startswith("#")), "")
    return first.startswith((wpl.HEAD, RALLY))


def read(text: str) -> list[WrittenItem]:
    """The points of a file.

    Raises:
        BadRequest: a line is none.
        Invalid: a row is something else than a rally point, or says how to land there.
    """
    if not text.startswith(wpl.HEAD):
        lines = [(number, line.split()) for number, line in enumerate(text.split("\n"), 1)]
        return [_point(words, number) for number, words in lines if words and not words[0].startswith("#")]
    rows = wpl.rows(text)
    if rows and rows[0].is_home:
        del rows[0]
    for row in rows:
        if row.command != mavlink.MAV_CMD_NAV_RALLY_POINT:
            raise Invalid(f"line {row.line} has the command {row.command}: a rally point has 5100")
    return [item_of(row) for row in rows]


def _point(words: list[str], number: int) -> WrittenItem:
    if words[0] != RALLY or len(words) != COLUMNS or not all(re.fullmatch(NUMBER, word) for word in words[1:]):
        raise BadRequest(
            f"line {number} is not {RALLY} and six numbers with decimal points: {shown(' '.join(words))}"
        )
    lat, lon, alt, _, _, flags = map(float, words[1:])
    if flags:  # a landing there, or heights of another frame; no autopilot takes them by MISSION_ITEM
        raise Invalid(f"line {number}: its flags are {words[6]}, which no autopilot takes any more: write 0")
    place = (0.0, 0.0, 0.0, 0.0, lat, lon, alt)
    return WrittenItem(mavlink.MAV_CMD_NAV_RALLY_POINT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, place)
