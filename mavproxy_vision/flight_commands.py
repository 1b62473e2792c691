"""The words after `vision land`, `search` and `mission` -> the request that a flight is begun with. Pure.

Raises:
    SettingError: the words are wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.http.extension import NED_REACH
from mavproxy_vision.landing.mission import MissionPlan
from mavproxy_vision.settings import METHODS

MISSION = ("5", "8", "-5")  # m: altitude, north, east; the seed's


def land(args: Sequence[str], method: str) -> dict[str, Any]:
    """`[ID] [METHOD]`, in any order; `method` is the default."""
    number = tag_id([word for word in args if word not in METHODS])
    return {"id": number, "method": next((word for word in args if word in METHODS), method)}


def search(args: Sequence[str]) -> dict[str, Any]:
    """`[ID]`."""
    return {"id": tag_id(args)}


def mission(args: Sequence[str], method: str) -> dict[str, Any]:
    """`[ALT NORTH EAST [ID|none]]`, in m; `none` lands without a tag."""
    try:
        alt, north, east = (float(word) for word in [*args[:3], *MISSION[len(args) :]])
    except ValueError as error:
        raise SettingError("mission [ALT NORTH EAST [ID|none]], in m") from error
    if not 0 < alt <= 500:
        raise SettingError("the altitude is more than 0 and at most 500 m above home")
    if not max(abs(north), abs(east)) <= NED_REACH:  # NaN is refused too
        raise SettingError(f"north and east are at most {NED_REACH:g} m")
    tag = args[3] if len(args) > 3 else ""
    number = None if tag in ("", "none") else tag_id([tag])
    return {"alt": alt, "north": north, "east": east, "id": number, "tag": tag != "none", "method": method}


def plan(request: Mapping[str, Any]) -> MissionPlan:
    """The plan of a mission's request."""
    place = request["alt"], request["north"], request["east"]
    return MissionPlan(*place, tag=request["id"], on_tag=request["tag"], method=request["method"])


def tag_id(words: Sequence[str]) -> int | None:
    """The tag's id; None without words, for the main tag."""
    if not words:
        return None
    if len(words) == 1 and words[0].isdecimal():
        return int(words[0])
    raise SettingError(f"{' '.join(words)!r} is not an id")
