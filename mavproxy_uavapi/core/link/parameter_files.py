"""Parameter files, as MAVProxy, ArduPilot, Mission Planner and QGroundControl read and write them. Pure."""

from __future__ import annotations

import re
from typing import NamedTuple

from pymavlink import mavparm

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.strict_json import shown
from mavproxy_uavapi.core.values import NUMBER

LONGEST_NAME = 16  # characters, on the wire
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
VALUE = re.compile(rf"(?P<hex>0[xX][0-9a-fA-F]{{1,8}})|{NUMBER}")
SEPARATORS = re.compile(r"[\s,=]+")
READ_ONLY = "@READONLY"  # ArduPilot's word for a default that nobody may change later
COMPONENT = "1"  # the autopilot's, of the components in a file of QGroundControl
# MAVProxy's list, and one more: rally points that are counted and not there would be flown to.
STATE = frozenset(mavparm.MAVParmDict().exclude_load) | {"RALLY_TOTAL"}
# Before and since ArduPilot 4.7: its own id, and that of the ground station whose commands it takes.
IDENTITY = frozenset({"SYSID_THISMAV", "MAV_SYSID", "SYSID_MYGCS", "MAV_GCS_SYSID"})
# What is true of one airframe only: its calibrations, the ids of its devices, its counters, its network address.
OWN = re.compile(
    r"AHRS_TRIM_[XYZ]|COMPASS\d?_(?:OFS|DIA|ODI|MOT)\d?_[XYZ]|COMPASS\d?_SCALE\d?|COMPASS\d?_DEV_ID\d?|COMPASS_PRIO\w+|"
    r"INS\d?_(?:ACC|GYR)\d?_?(?:OFFS|SCAL|ID|CALTEMP)\w*|INS\d?_TCAL\w+|BARO\d?_GND_PRESS|ARSPD\d?_OFFSET|"
    r"\w+_DEVID|GPS\d?_CAN_NODEID\d?|\w+_SERIAL_NUM|NET_(?:IPADDR|MACADDR)\d|STAT_(?:BOOTCNT|FLTTIME|RUNTIME|RESET)"
)


class ParameterFile(NamedTuple):
    """Values by name, and why others are left out, by name."""

    values: dict[str, float]
    left_out: dict[str, str]


def read(text: str, restore: bool = False) -> ParameterFile:
    """The parameters of a file; with `restore` it is this vehicle's own, and what is true of it only is read, too.

    A line is `NAME VALUE`, `NAME,VALUE` or `NAME=VALUE`, or the five columns of QGroundControl; `#` begins a comment.

    Raises:
        BadRequest: a line is none of these; the error names it.
        Invalid: a line includes another file.
    """
    values: dict[str, float] = {}
    left_out: dict[str, str] = {}
    for number, line in enumerate(text.split("\n"), 1):
        words = [word for word in SEPARATORS.split(line.partition("#")[0]) if word]
        if not words:
            continue
        name, value, why_not = _parameter(words, number, line, restore)
        if why_not:
            left_out[name] = why_not
            continue
        if values.get(name, value) != value:  # MAVProxy and ArduPilot set one after the other
            left_out[f"{name} {values[name]:g}"] = f"line {number} gives it {value:g}, and the last one counts"
        values[name] = value
    return ParameterFile(values, left_out)


def why_left_out(name: str, restore: bool = False) -> str:
    """Why a list does not set that parameter; empty where it does. For `restore` see `read`."""
    if name in STATE:
        return "it is this vehicle's own state, which no file sets (nor does MAVProxy)"
    if name in IDENTITY:
        return f"it would make another vehicle of this one, or a stranger; PUT /parameters/{name} sets it"
    if not restore and OWN.fullmatch(name):
        return "it is true of one airframe only; `restore=true` says that the list is of this one"
    return ""


def _parameter(words: list[str], number: int, line: str, restore: bool) -> tuple[str, float, str]:
    """Name, value, and why it is left out."""
    if words[0].lower() == "@include":
        file = shown(" ".join(words[1:]))
        raise Invalid(f"line {number} includes {file}, which is not here: put its lines in place of this one")
    component = COMPONENT
    if len(words) == 5 and all(word.isdigit() for word in (words[0], words[1], words[4])):
        component, words = words[1], words[2:4]
    elif len(words) == 3 and words[2] == READ_ONLY:
        words = words[:2]
    if len(words) != 2 or not NAME.fullmatch(words[0]):
        hint = "; numbers have decimal points" if re.search(r"\d,\d", line) and len(words) == 3 else ""
        raise BadRequest(f"line {number} of the parameters is not `NAME VALUE`: {shown(line.strip())}{hint}")
    match = VALUE.fullmatch(words[1])
    if match is None:
        raise BadRequest(f"line {number}: the value of {words[0][:40]} is {shown(words[1])}, not a number")
    name, value = words[0].upper(), float(int(words[1], 16)) if match["hex"] else float(words[1])
    if len(name) > LONGEST_NAME:
        return name[:40], value, f"its name has more than {LONGEST_NAME} characters: no autopilot has it"
    if component != COMPONENT:
        return name, value, f"it is of component {component[:3]}, not of the autopilot"
    return name, value, why_left_out(name, restore)
