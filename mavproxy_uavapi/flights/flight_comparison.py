"""Two ways beside each other, in figures: a flight and another one, its mission, or its rehearsal. Blocking."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import shapely
from typing_extensions import TypedDict

from mavproxy_uavapi.core.airspace.local_frame import LocalFrame
from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.flights.flight_overview import FlownPlace, mission_of, mission_places, ways_of
from mavproxy_uavapi.flights.flight_reader import overview_of
from mavproxy_uavapi.http.contract.answers import means

MISSION = "mission"  # in place of another flight: the last one that the vehicle held in this one
ROUTINE = 95  # percent of the way that are no farther beside than `usual_m`


class WayFigures(TypedDict):
    """A way in figures; what a mission does not have is null."""

    name: Annotated[str, means("of the flight, or of the file", "survey 3")]
    duration_s: Annotated[float | None, means("s from the first place to the last", 182.4)]
    distance_m: Annotated[float, means("m of the way, in plan and height", 1240.2)]
    battery_used_percent: Annotated[float | None, means("what the battery had less at its end", 21.0)]


class Beside(TypedDict):
    """How far the first way is beside the second one, in plan."""

    mean_m: Annotated[float, means("m on average, over its places", 1.2)]
    usual_m: Annotated[float, means(f"m within which {ROUTINE} % of its places are", 3.4)]
    most_m: Annotated[float, means("m at most", 6.1)]
    at_s: Annotated[float, means("s since its beginning when that was", 74.0)]
    lat: Annotated[float, means("degrees, where that was", -35.3632)]
    lon: Annotated[float, means("degrees, where that was", 149.1652)]
    height_mean_m: Annotated[float | None, means("m of height between the two on average; null if unknown", 0.3)]
    height_most_m: Annotated[float | None, means("m of height between the two at most; null if unknown", 2.0)]


class WayComparison(TypedDict):
    """Two ways beside each other."""

    vehicle: Annotated[int, means("system id", 1)]
    first: WayFigures
    second: WayFigures
    beside: Beside


@dataclass(frozen=True)
class Way:
    """Where a vehicle was, or is to be.

    Attributes:
        name: of the flight, or of the file.
        places: degrees, and m above home; NaN where a height is not told.
        seconds: of each place since the beginning; None of a mission.
        battery_used: percent; None where it is not told.
    """

    name: str
    places: Sequence[tuple[float, float, float]]
    seconds: Sequence[float] | None = None
    battery_used: float | None = None


def of_flight(name: str, places: Sequence[FlownPlace]) -> Way:
    """The way of a vehicle in a flight."""
    told = [place.battery_percent for place in places if place.battery_percent is not None]
    used = told[0] - told[-1] if told else None
    where = [(place.lat, place.lon, place.relative_alt) for place in places]
    return Way(name, where, [place.time - places[0].time for place in places], used)


def vehicle_in(ways: Mapping[int, Any], vehicle: int | None) -> int:
    """The vehicle that is meant: the named one, or the only one, or the first.

    Raises:
        BadRequest: the flight has no place of it.
    """
    if vehicle is None and ways:
        return min(ways)
    if vehicle is None or vehicle not in ways:
        raise BadRequest(
            f"the flight tells no place of vehicle {vehicle}" if vehicle else "the flight tells no place"
        )
    return vehicle


def of_file(path: Path, vehicle: int, home: FlownPlace) -> Way:
    """The way that a file tells: a mission, or the report of a rehearsal.

    Args:
        path: of a mission in any format, or of a report as JSON.
        vehicle: whose way of a rehearsal.
        home: where a mission begins, and a return ends.

    Raises:
        BadRequest: it is none of these.
        OSError: it cannot be read.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        told = json.loads(text)
    except ValueError:
        told = None
    if isinstance(told, dict) and "flights" in told:
        return _of_rehearsal(path.name, told, vehicle)
    return _of_mission(path.name, mission_places(text, home))


def _of_mission(name: str, places: Sequence[tuple[float, float, float | None]]) -> Way:
    return Way(name, [(lat, lon, math.nan if height is None else height) for lat, lon, height in places])


def _of_rehearsal(name: str, told: dict[str, Any], vehicle: int) -> Way:
    try:
        flown = told["flights"][0]["vehicles"]
        one = flown.get(str(vehicle)) or next(iter(flown.values()))
        rows = [dict(zip(one["columns"], sample, strict=True)) for sample in one["samples"]]
        places = [(row["lat"], row["lon"], row["height"]) for row in rows]
        left = [row["battery"] for row in rows if row["battery"] is not None]
        used = left[0] - left[-1] if left else None
        return Way(name, places, [row["at"] - rows[0]["at"] for row in rows], used)
    except (LookupError, TypeError, ValueError, StopIteration) as error:
        raise BadRequest(f"{name} is not the report of a rehearsal") from error


def compare_flights(first: tuple[str, Path], second: tuple[str, Path], vehicle: int | None) -> WayComparison:
    """Two complete flights, each an id and its file.

    Args:
        vehicle: whose ways; None for the first vehicle of each.

    Raises:
        BadRequest: one of them tells no way of it.
        OSError: a file cannot be read.
    """
    ways, shown = [], 0
    for flight_id, path in (first, second):
        flown = ways_of(overview_of(path))
        system = vehicle_in(flown, vehicle)
        shown = shown or system
        ways.append(of_flight(flight_id, flown[system]))
    return compare(shown, *ways)


def compare_file(flight_id: str, path: Path, other: Path, vehicle: int | None) -> WayComparison:
    """A complete flight and a file, as `of_file` reads it.

    Raises:
        BadRequest: one of them tells no way.
        OSError: a file cannot be read.
    """
    ways = ways_of(overview_of(path))
    system = vehicle_in(ways, vehicle)
    flown = of_flight(flight_id, ways[system])
    return compare(system, flown, of_file(other, system, ways[system][0]))


def compare_mission(flight_id: str, path: Path, vehicle: int | None) -> WayComparison:
    """A complete flight and the last mission that the vehicle held in it.

    Raises:
        BadRequest: one of them tells no way.
        OSError: the file cannot be read.
    """
    data = overview_of(path)
    ways = ways_of(data)
    system = vehicle_in(ways, vehicle)
    return compare(system, of_flight(flight_id, ways[system]), _of_mission(MISSION, mission_of(data, system)))


def compare(vehicle: int, first: Way, second: Way) -> WayComparison:
    """Two ways beside each other.

    Raises:
        BadRequest: one of them has no two places.
    """
    for way in (first, second):
        if len(way.places) < 2:
            raise BadRequest(f"{way.name} has fewer than two places")
    frame = LocalFrame(second.places[0][:2])
    a, b = (frame.spots(np.array(way.places, dtype=float)) for way in (first, second))
    return {
        "vehicle": vehicle,
        "first": _figures(first, a),
        "second": _figures(second, b),
        "beside": _beside(first, a, b),
    }


def _figures(way: Way, spots: Any) -> WayFigures:
    distance = sum(math.hypot(*np.nan_to_num(after - before)) for before, after in pairwise(spots))
    lasted = None if way.seconds is None else round(way.seconds[-1] - way.seconds[0], 1)
    return {
        "name": way.name,
        "duration_s": lasted,
        "distance_m": round(distance, 1),
        "battery_used_percent": None if way.battery_used is None else round(way.battery_used, 1),
    }


def _beside(way: Way, spots: Any, others: Any) -> Beside:
    line = shapely.LineString(others[:, :2])
    points = shapely.points(spots[:, :2])
    along = shapely.line_locate_point(line, points)
    distances = shapely.distance(line, points)
    worst = int(np.argmax(distances))
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(others[:, :2], axis=0).T))])
    heights = np.abs(spots[:, 2] - np.interp(along, steps, others[:, 2]))
    known = heights[~np.isnan(heights)]
    return {
        "mean_m": round(float(distances.mean()), 2),
        "usual_m": round(float(np.percentile(distances, ROUTINE)), 2),
        "most_m": round(float(distances[worst]), 2),
        "at_s": 0.0 if way.seconds is None else round(way.seconds[worst], 1),
        "lat": way.places[worst][0],
        "lon": way.places[worst][1],
        "height_mean_m": round(float(known.mean()), 2) if known.size else None,
        "height_most_m": round(float(known.max()), 2) if known.size else None,
    }


def sentences(comparison: WayComparison) -> list[str]:
    """A comparison in words."""
    told = []
    for way in (comparison["first"], comparison["second"]):
        lasted = "" if way["duration_s"] is None else f" in {way['duration_s']:.0f} s"
        used = way["battery_used_percent"]
        told.append(f"{way['name']}: {way['distance_m']:.0f} m{lasted}" + ("" if used is None else f", {used:.0f} %"))
    beside = comparison["beside"]
    told.append(
        f"beside: {beside['mean_m']:.1f} m on average, {ROUTINE} % within {beside['usual_m']:.1f} m, at most"
        f" {beside['most_m']:.1f} m after {beside['at_s']:.0f} s at {beside['lat']:.6f}, {beside['lon']:.6f}"
    )
    if beside["height_most_m"] is not None:
        told.append(f"heights: {beside['height_mean_m']:.1f} m on average, at most {beside['height_most_m']:.1f} m")
    return told
