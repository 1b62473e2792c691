"""Envelope files: GeoJSON, KML, QGroundControl's .plan; and the fence that MAVProxy has loaded. Pure."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import kml
from mavproxy_uavapi.core.airspace.model import Area, Envelope, EnvelopeLimits, Place
from mavproxy_uavapi.core.errors import BadRequest, Invalid

mavlink = mavutil.mavlink

KINDS = {"inclusion": True, "exclusion": False}
EXCLUDED = "exclu"  # in the name of a KML Placemark, in any case: its polygon is an exclusion
MEMBERS = ("type", "features", "limits", "name")  # of a FeatureCollection; others are refused: they might be limits
EMPTY = {"type": "FeatureCollection", "features": [], "limits": EnvelopeLimits().report()}
HOME_CIRCLE = 5005  # MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION, which older pymavlinks do not name
POLYGONS = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}


def read(text: str, source: str) -> Envelope:
    """The envelope in a file's text, in any of the three formats.

    Raises:
        BadRequest: it has none of them.
        Invalid: something in it makes no sense.
    """
    text = text.lstrip("\ufeff \t\r\n")
    if text.startswith("<"):
        return Envelope(tuple(_of_kml(text)), source=source)
    try:
        body = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadRequest(f"an envelope is a GeoJSON FeatureCollection, a KML or a .plan file: {error}") from error
    if not isinstance(body, dict):
        raise BadRequest("an envelope is a GeoJSON FeatureCollection, a KML or a .plan file")
    if body.get("fileType") == "Plan" or "geoFence" in body:
        return Envelope(tuple(_of_plan(body.get("geoFence"))), source=source, every=True)
    return of_geojson(body, source)


# -- GeoJSON --------------------------------------------------------------------------------------------------


def of_geojson(body: Mapping[str, Any], source: str) -> Envelope:
    """The envelope of a FeatureCollection; its member `limits` is that of `EnvelopeLimits`.

    Raises:
        BadRequest: it is none.
        Invalid: a feature or a limit makes no sense.
    """
    if body.get("type") != "FeatureCollection" or not isinstance(body.get("features"), list):
        raise BadRequest(
            'GeoJSON of an envelope is {"type": "FeatureCollection", "features": [...], "limits": {...}}'
        )
    unknown = [name for name in body if name not in MEMBERS]
    if unknown:
        raise Invalid(f"there is no member {unknown[0]!r}; there are {', '.join(MEMBERS)}")
    limits = body.get("limits") or {}
    if not isinstance(limits, dict):
        raise Invalid("limits is a JSON object", "limits")
    areas = (area for number, feature in enumerate(body["features"], 1) for area in _of_feature(feature, number))
    return Envelope(tuple(areas), EnvelopeLimits.of(limits), source)


def geojson(envelope: Envelope) -> dict[str, Any]:
    """The envelope as a FeatureCollection, which `read` takes again."""
    features = [_feature(area) for area in envelope.areas]
    return {"type": "FeatureCollection", "features": features, "limits": envelope.limits.report()}


def _of_feature(feature: Any, number: int) -> Iterator[Area]:
    try:
        properties, geometry = feature.get("properties") or {}, feature["geometry"]
        name = str(properties.get("name") or f"feature {number}")
        if properties.get("kind") not in KINDS:
            raise Invalid(f"{name}: its property kind is neither inclusion nor exclusion", "features", str(number))
        common: dict[str, Any] = {
            "name": name,
            "inclusion": KINDS[properties["kind"]],
            "floor": _height(properties.get("floor"), -math.inf),
            "ceiling": _height(properties.get("ceiling"), math.inf),
        }
        kind, corners = geometry["type"], geometry["coordinates"]
        if kind == "Point":
            yield Area(centre=_place(corners), radius=_number(properties["radius"]), **common)
        elif kind in ("Polygon", "MultiPolygon"):
            for rings in [corners] if kind == "Polygon" else corners:
                yield Area(rings=tuple(tuple(_ring(map(_place, ring))) for ring in rings), **common)
        else:
            raise Invalid(f"{name} is a {kind}: it takes Polygon, MultiPolygon, or Point with a radius")
    except (AttributeError, KeyError, TypeError, ValueError, IndexError) as error:
        sentence = f"feature {number} is invalid: {type(error).__name__}: {error}"
        raise Invalid(sentence, "features", str(number)) from error


def _feature(area: Area) -> dict[str, Any]:
    heights = {"floor": area.floor, "ceiling": area.ceiling}
    properties: dict[str, Any] = {"kind": "inclusion" if area.inclusion else "exclusion", "name": area.name}
    properties |= {name: height for name, height in heights.items() if math.isfinite(height)}
    if area.centre is not None:
        properties["radius"] = area.radius
        return _as_feature(properties, "Point", list(area.centre[::-1]))
    rings = [[list(corner[::-1]) for corner in (*ring, ring[0])] for ring in area.rings]
    return _as_feature(properties, "Polygon", rings)


def _as_feature(properties: dict[str, Any], kind: str, coordinates: list[Any]) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def _place(position: Sequence[Any]) -> Place:
    """GeoJSON has the longitude first."""
    return _number(position[1]), _number(position[0])


def _ring(corners: Iterable[Place]) -> list[Place]:
    """The corners without the last one, if that is the first again."""
    ring = list(corners)
    return ring[:-1] if len(ring) > 1 and ring[0] == ring[-1] else ring


def _height(value: Any, default: float) -> float:
    return default if value is None else _number(value)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{value!r} is not a number")
    return float(value)


# -- KML, .plan, MAVProxy's fence -------------------------------------------------------------------------------


def _of_kml(text: str) -> Iterator[Area]:
    try:
        polygons = kml.polygons(text)
    except ValueError as error:
        raise BadRequest(str(error)) from error
    for number, polygon in enumerate(polygons, 1):
        rings = tuple(tuple(_ring(ring)) for ring in polygon.rings)
        yield Area(polygon.name or f"polygon {number}", EXCLUDED not in polygon.name.lower(), rings)


def _of_plan(fence: Any) -> Iterator[Area]:
    try:
        for number, polygon in enumerate(fence["polygons"], 1):
            ring = tuple((_number(lat), _number(lon)) for lat, lon, *_ in polygon["path"])
            yield Area(f"polygon {number}", bool(polygon["inclusion"]), (tuple(_ring(ring)),))
        for number, circle in enumerate(fence["circles"], 1):
            lat, lon, *_ = circle["circle"]["center"]
            centre, radius = (_number(lat), _number(lon)), _number(circle["circle"]["radius"])
            yield Area(f"circle {number}", bool(circle["inclusion"]), centre=centre, radius=radius)
    except (KeyError, TypeError, ValueError) as error:
        raise Invalid(f"the .plan file's geoFence is invalid: {type(error).__name__}: {error}") from error


def of_fence(items: Sequence[Any], source: str, home: Callable[[], Place | None] = lambda: None) -> Envelope:
    """The envelope of MISSION_ITEM_INTs of a fence, as MAVProxy's module `fence` holds them.

    Args:
        items: in their order.
        source: for messages.
        home: gives home, for a circle around it.

    Raises:
        Invalid: there are none, or a polygon has fewer corners than it says.
    """
    return Envelope(tuple(_of_items(list(items), home)), source=source, every=True)


def _of_items(items: list[Any], home: Callable[[], Place | None]) -> Iterator[Area]:
    while items:
        item = items.pop(0)
        place = _item_place(item)
        if item.command in POLYGONS:
            ring = [place]
            while len(ring) < item.param1 and items and items[0].command == item.command:
                ring.append(_item_place(items.pop(0)))
            if len(ring) != item.param1:
                raise Invalid(f"fence item {item.seq}: its polygon has {len(ring)} corners, not {item.param1:g}")
            yield Area(f"fence polygon {item.seq}", POLYGONS[item.command], (tuple(_ring(ring)),))
        elif item.command in CIRCLES:
            yield Area(f"fence circle {item.seq}", CIRCLES[item.command], centre=place, radius=item.param1)
        elif item.command == HOME_CIRCLE:
            at = home()
            if at is None:
                raise Invalid("the fence has a circle around home, and home is not known yet")
            yield Area(f"fence circle {item.seq} around home", inclusion=True, centre=at, radius=item.param1)
        elif item.command != mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT:
            raise Invalid(f"fence item {item.seq} is a command {item.command}, which is not known")


def _item_place(item: Any) -> Place:
    scale = 1e-7 if item.get_type() == "MISSION_ITEM_INT" else 1.0
    return item.x * scale, item.y * scale
