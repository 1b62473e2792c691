"""The rows of a QGC WPL 110 file: a mission, a fence or rally points. Pure."""

from __future__ import annotations

import re
from typing import NamedTuple

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.strict_json import shown
from mavproxy_uavapi.core.values import NUMBER

HEAD = "QGC WPL"
WPL_110 = "QGC WPL 110"
COLUMNS = (
    "number", "current", "frame", "command", "param1", "param2", "param3", "param4", "latitude", "longitude",
    "altitude", "autocontinue",
)  # fmt: skip
WHOLE_COLUMNS = {0, 1, 2, 3, 11}
PARAMETERS = range(4, 8)
# Mission Planner's home may have no command; pymavlink takes it for home, too.
HOME_COMMANDS = (mavutil.mavlink.MAV_CMD_NAV_WAYPOINT, 0)


class WplRow(NamedTuple):
    """A row: the number of its line, and its columns as `COLUMNS`."""

    line: int
    columns: tuple[float, ...]

    @property
    def number(self) -> int:
        """Its number in the list."""
        return int(self.columns[0])

    @property
    def command(self) -> int:
        """Its MAV_CMD."""
        return int(self.columns[3])

    @property
    def is_home(self) -> bool:
        """Whether it is home, if it is the first row."""
        return self.number == 0 and self.command in HOME_COMMANDS


def rows(text: str) -> list[WplRow]:
    """The rows in their order, home included; empty lines and those that begin with # are none.

    Raises:
        BadRequest: it is no such file, or a line is no row.
    """
    head, *lines = text.split("\n")
    if head.strip() != WPL_110:
        raise BadRequest(f"this is not a {WPL_110} file: it begins with {shown(head.strip())}")
    return [_row(line, number) for number, line in enumerate(lines, 2) if line.strip() and line.lstrip()[0] != "#"]


def _row(line: str, number: int) -> WplRow:
    words = line.split()
    if len(words) != len(COLUMNS):
        columns = f"{len(COLUMNS)} columns ({', '.join(COLUMNS)})"
        raise BadRequest(f"line {number} is not a row of {columns}: it has {len(words)}")
    return WplRow(number, tuple(_cell(word, column, number) for column, word in enumerate(words)))


def _cell(word: str, column: int, number: int) -> float:
    if column in PARAMETERS and word.lower() == "nan":  # MAVLink: it is left to the autopilot, as null in a .plan
        return 0.0
    if not re.fullmatch(NUMBER, word):
        hint = ": numbers have decimal points" if "," in word else ""
        raise BadRequest(f"line {number}: its {COLUMNS[column]} is {shown(word)}, not a number{hint}")
    value = float(word)
    if column in WHOLE_COLUMNS and not (value.is_integer() and abs(value) < 2**31):
        raise BadRequest(f"line {number}: its {COLUMNS[column]} is {shown(word)}, not a whole number")
    return value
