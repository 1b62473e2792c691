"""The fence files of MAVProxy and Mission Planner: rows of QGC WPL 110, or the older list of points. Pure."""

from __future__ import annotations

import re
from typing import NamedTuple

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace.model import Place
from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.mission import wpl
from mavproxy_uavapi.core.strict_json import shown
from mavproxy_uavapi.core.values import NUMBER

mavlink = mavutil.mavlink

COMMANDS = range(mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT + 6)
LEAST_POINTS = 5  # the return point, three corners, and the first corner again


class FenceRow(NamedTuple):
    """A row, as `formats.of_fence` takes a MISSION_ITEM: degrees, and what the command's param1 is."""

    seq: int
    command: int
    param1: float
    x: float
    y: float

    def get_type(self) -> str:
        """MISSION_ITEM, whose places are degrees."""
        return "MISSION_ITEM"


def rows(text: str) -> list[FenceRow]:
    """The items of a QGC WPL 110 file that holds a fence; Mission Planner begins it with home, which is none.

    Raises:
        BadRequest: a line is no row.
        Invalid: it is one of something else.
    """
    read = wpl.rows(text)
    if read and read[0].is_home:
        del read[0]
    for row in read:
        if row.command not in COMMANDS:
            span = f"{COMMANDS[0]} to {COMMANDS[-1]}"
            raise Invalid(f"line {row.line} has the command {row.command}: a fence has {span}")
    return [FenceRow(row.number, row.command, *(row.columns[column] for column in (4, 8, 9))) for row in read]


def corners(text: str) -> list[Place]:
    """The polygon to be inside of, of an older file: the return point, then the corners, and the first one again.

    Raises:
        BadRequest: a line is not latitude and longitude.
        Invalid: the list is no fence, but perhaps a bare polygon.
    """
    lines = [(number, line.partition("#")[0].split()) for number, line in enumerate(text.split("\n"), 1)]
    points = [_place(words, number) for number, words in lines if words]
    if len(points) < LEAST_POINTS or points[1] != points[-1]:
        raise Invalid(
            "a list of points is a fence if it has the return point first, then the corners, the first one again last"
        )
    return points[1:-1]


def is_list_of_points(text: str) -> bool:
    """Whether a text may be an older fence file."""
    first = next((words for line in text.split("\n") if (words := line.partition("#")[0].split())), [])
    return bool(first) and all(re.fullmatch(NUMBER, word) for word in first)


def _place(words: list[str], number: int) -> Place:
    if len(words) != 2 or not all(re.fullmatch(NUMBER, word) for word in words):
        raise BadRequest(f"line {number} is not latitude and longitude with decimal points: {shown(' '.join(words))}")
    return float(words[0]), float(words[1])
