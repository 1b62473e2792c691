"""The tags to land on: families, ids, sizes and positions. Pure.

A list of tags is written `ID:SIZE[@X,Y]`, separated by spaces or semicolons. SIZE is the side of the black square in
m. X and Y are the position of the tag's centre relative to the target in m, to the right and to the top of the tags.
The first one is the main tag. `1:0.06 0:0.30@-0.25,0` is a small tag with a large one to its left.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from mavproxy_uavapi.core.errors import SettingError

# Family -> cells along the black square, and the number of ids.
FAMILIES = {"36h11": (8, 587), "25h9": (7, 35), "16h5": (6, 30), "36h10": (8, 2320)}
NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"  # float() accepts every match
ID = r"[0-9]{1,6}"
PATTERN = re.compile(rf"({ID}):({NUMBER})(?:@({NUMBER}),({NUMBER}))?")
SIZES = (0.005, 10.0)  # m
REACH = 50.0  # m, the largest distance of a tag from the target


@dataclass(frozen=True)
class Tag:
    """A tag of the target: id, side of the black square (m), and its centre: m right of and above the target's."""

    id: int
    size: float
    right: float = 0.0
    up: float = 0.0


def parse_tags(text: str, family: str | None = None) -> tuple[Tag, ...]:
    """Read a list of tags; `family` must have their ids.

    Raises:
        SettingError: the text is not such a list.
    """
    tags = []
    for word in re.split(r"[\s;]+", text.strip()):
        match = PATTERN.fullmatch(word)
        if match is None:
            raise SettingError(f"tags: {word!r} is not ID:SIZE or ID:SIZE@RIGHT,UP, in m", "tags")
        tag = Tag(int(match[1]), float(match[2]), float(match[3] or 0), float(match[4] or 0))
        require_size("tags", tag.size)
        if max(abs(tag.right), abs(tag.up)) > REACH:
            raise SettingError(f"tags: {word!r} lies farther than {REACH:g} m from the target", "tags")
        if family is not None:
            require_id("tags", family, tag.id)
        tags.append(tag)
    if len({tag.id for tag in tags}) != len(tags):
        raise SettingError("tags: an id twice", "tags")
    return tuple(tags)


def require_size(setting: str, size: float) -> None:
    """Raise SettingError unless a tag may have this size (m)."""
    if not SIZES[0] <= size <= SIZES[1]:
        raise SettingError(f"{setting}: a size of {size:g} m; tags have {SIZES[0]:g} to {SIZES[1]:g} m", setting)


def require_id(setting: str, family: str, number: int) -> None:
    """Raise SettingError unless the family has this id."""
    count = FAMILIES[family][1]
    if not 0 <= number < count:
        raise SettingError(f"{setting}: {family} has no id {number}, only 0 to {count - 1}", setting)


def parse_families(text: str) -> tuple[str, ...]:
    """Read family names, separated by commas or spaces.

    Raises:
        SettingError: one of them is unknown.
    """
    names = tuple(name.lower().removeprefix("tag") for name in re.split(r"[\s,;]+", text.strip()) if name)
    for name in names:
        if name not in FAMILIES:
            raise SettingError(f"family: {name!r} is not one of {', '.join(FAMILIES)}", "family")
    if not names:
        raise SettingError(f"family: one or several of {', '.join(FAMILIES)}", "family")
    return names


def target_from(tag: Tag, x_axis: tuple[float, float]) -> tuple[float, float]:
    """North and east (m) from the tag's centre to the target's.

    Args:
        tag: the detected tag.
        x_axis: the direction of the tag's right: north and east components, of any length.
    """
    length = math.hypot(*x_axis) or 1.0
    north, east = x_axis[0] / length, x_axis[1] / length
    # Seen from above, the tag's top is a quarter turn anticlockwise from its right.
    up_north, up_east = east, -north
    return -(tag.right * north + tag.up * up_north), -(tag.right * east + tag.up * up_east)
