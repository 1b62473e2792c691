"""The tags of a target and the plan of a landing on it, from the settings. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from mavproxy_uavapi.core.errors import Invalid
from mavproxy_vision.apriltag.tag_layout import FAMILIES, Tag
from mavproxy_vision.landing.expanding_square import step_for
from mavproxy_vision.settings import VisionSettings

FINAL = 1.3  # times the height at which the tag fills the view
LOWEST_FINAL = 0.4  # m
HIGHEST_CLIP = 1.5  # m; below this a landing would not see the tag
DEPENDABLE = 0.85  # share of the detection range


@dataclass(frozen=True)
class Plan:
    """The limits of a landing.

    Attributes:
        attempts: number of searches.
        look: s of each search in place.
        tolerance: m from the target within which it may begin the last metre.
        final: m above the target at which the last metre begins.
        clip: m above the target below which the tag does not fit into the view.
        speed: m/s, horizontally.
        descent: m/s, at most.
        climb: m/s, at most.
        acceleration: m/s/s, at most.
        step: m between two tracks of the search.
        leash: m, the largest distance from the start of the search.
        ceiling: highest height of the search above the target's ground, m.
        time_limit: s in total.
        descend: whether to descend; a search ends when the tag is found.
    """

    attempts: int = 5
    look: float = 2.0
    tolerance: float = 0.12
    final: float = 0.6
    clip: float = 0.4
    speed: float = 1.5
    descent: float = 1.0
    climb: float = 1.0
    acceleration: float = 1.5
    step: float = 2.0
    leash: float = 15.0
    ceiling: float = 8.0
    time_limit: float = 180.0
    descend: bool = True


def tags_for(settings: VisionSettings, number: int | None) -> dict[int, Tag]:
    """The tags that show the target, the main one first; None means the main tag of the settings.

    Raises:
        Invalid: the family has no such id.
    """
    tags = settings.tag_list
    if number is None or number == tags[0].id:
        return {tag.id: tag for tag in tags}
    if number >= FAMILIES[settings.families[0]][1]:
        raise Invalid(f"{settings.families[0]} has no id {number}", "id")
    size = next((tag.size for tag in tags if tag.id == number), tags[0].size)
    return {number: Tag(number, size)}


def landable(settings: VisionSettings, number: int | None) -> dict[int, Tag]:
    """As `tags_for`, but only if the tags are visible from low enough for a landing.

    Raises:
        Invalid: the family has no such id, or its smallest tag fills the view too high up.
    """
    tags = tags_for(settings, number)
    clip = clip_height(settings, tags)
    if clip > HIGHEST_CLIP:
        smallest = min(tags.values(), key=lambda tag: tag.size)
        raise Invalid(
            f"tag {smallest.id} of {smallest.size:g} m is not in view below {clip:.1f} m: it takes a smaller one "
            "beside it (`tags`), or a lens that is nearer to the middle (`offset`)",
            "id",
        )
    return tags


def clip_height(settings: VisionSettings, tags: dict[int, Tag]) -> float:
    """Metres above the target below which the smallest tag does not fit into the view."""
    forward, right, down = settings.camera_mount.offset
    smallest = min(tag.size for tag in tags.values())
    return settings.model.clip_height(smallest, math.hypot(forward, right)) + down


def plan_for(
    settings: VisionSettings, tags: dict[int, Tag], here: float | None, *, descend: bool, **changes: Any
) -> Plan:
    """The plan of a landing, or of a search.

    Args:
        settings: the present settings.
        tags: the tags that show the target.
        here: m above the target's ground; None while unknown.
        descend: whether it descends when the tag is found.
        changes: values that replace those of the settings.
    """
    model, cells = settings.model, FAMILIES[settings.families[0]][0]
    largest = max(tag.size for tag in tags.values())
    reach = DEPENDABLE * model.detection_range(largest, cells)
    clip = clip_height(settings, tags)
    plan = Plan(
        attempts=settings.attempts,
        tolerance=settings.tolerance,
        final=max(FINAL * clip, LOWEST_FINAL),
        clip=clip,
        speed=settings.speed,
        descent=settings.descent,
        step=step_for(model.footprint(min(max(reach if here is None else here, 1.0), reach)), largest),
        leash=settings.leash,
        ceiling=reach,
        time_limit=settings.time_limit,
        descend=descend,
    )
    return replace(plan, **changes)
