"""QGroundControl's .plan files: their takeoffs, waypoints and returns, each with the speed in force there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mavproxy_uavapi.aerpaw.constants import (
    DEFAULT_WAYPOINT_SPEED,
    PLAN_CMD_RTL,
    PLAN_CMD_SPEED,
    PLAN_CMD_TAKEOFF,
    PLAN_CMD_WAYPOINT,
)
from mavproxy_uavapi.aerpaw.exceptions import PlanError
from mavproxy_uavapi.aerpaw.geometry import Coordinate, Waypoint
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.file_text import read_text
from mavproxy_uavapi.core.strict_json import is_finite_number, json_of, shown

LARGEST = 4 * 1024 * 1024  # bytes
PLACES = (PLAN_CMD_TAKEOFF, PLAN_CMD_WAYPOINT, PLAN_CMD_RTL)
PARAMETERS = 7


def read_from_plan_complete(path: str | Path, default_speed: float = DEFAULT_WAYPOINT_SPEED) -> list[dict[str, Any]]:
    """Each waypoint as `id`, `command`, `pos` [degrees, degrees, m above home], `wait_for` s and `speed` m/s.

    Raises:
        PlanError: it is not a .plan file, or an item has too few parameters.
    """
    try:
        plan = json_of(read_text(Path(path), LARGEST), str(path))
    except UavApiError as error:
        raise PlanError(str(error), error) from error
    if not isinstance(plan, dict) or plan.get("fileType") != "Plan":
        raise PlanError("Wrong file type -- use a .plan file.")
    mission = plan.get("mission")
    if not isinstance(mission, dict) or not isinstance(mission.get("items"), list):
        raise PlanError(f"{path} has no mission items")
    speed, places = default_speed, []
    for item in _simple(mission["items"]):
        parameters = _parameters(item)
        if item["command"] == PLAN_CMD_SPEED:
            speed = parameters[1] if len(parameters) > 1 else speed
        elif item["command"] in PLACES:
            if len(parameters) < PARAMETERS:
                raise PlanError(f"Plan item has fewer than {PARAMETERS} params: {item}")
            number, command = item.get("doJumpId"), item["command"]
            place = {"id": number, "command": command, "pos": parameters[4:7], "wait_for": parameters[0]}
            places.append({**place, "speed": speed})
    return places


def _parameters(item: dict[str, Any]) -> list[float]:
    params = item.get("params", [])
    if not isinstance(params, list) or not all(value is None or is_finite_number(value) for value in params):
        raise PlanError(f"the params of a plan item are {shown(params)}, not numbers")
    return [value or 0 for value in params]


def _simple(items: list[Any]) -> Iterator[dict[str, Any]]:
    """The simple items; a survey or a corridor gives the items that QGroundControl generated."""
    for item in items:
        if not isinstance(item, dict):
            raise PlanError(f"a plan item is {shown(item)}, not a JSON object")
        transects = item.get("TransectStyleComplexItem")
        if "command" in item:
            yield item
        elif isinstance(transects, dict) and isinstance(transects.get("Items"), list):
            yield from _simple(transects["Items"])


def read_from_plan(path: str | Path, default_speed: float = DEFAULT_WAYPOINT_SPEED) -> list[Waypoint]:
    """Each waypoint as command, latitude, longitude, altitude, id and speed; errors as `read_from_plan_complete`."""
    places = read_from_plan_complete(path, default_speed)
    return [(place["command"], *place["pos"], place["id"], place["speed"]) for place in places]


def get_location_from_waypoint(waypoint: Waypoint) -> Coordinate:
    """The coordinate of a waypoint of `read_from_plan`."""
    return Coordinate(*waypoint[1:4])
