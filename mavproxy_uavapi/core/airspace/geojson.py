"""Envelopes as GeoJSON. Pure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

from mavproxy_uavapi.core.airspace.model import MOST_AREAS, Area, Envelope, EnvelopeLimits, Place
from mavproxy_uavapi.core.airspace.words import require_no_limit
from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.strict_json import is_finite_number, shown
from mavproxy_uavapi.core.text import nearest

KINDS = {"inclusion": True, "exclusion": False}
# Of a FeatureCollection; others are refused: they might be limits. QGIS, GDAL and GeoServer add the lower ones.
MEMBERS = (
    "type", "features", "limits", "every", "name",
    "crs", "bbox", "id", "title", "description", "xy_coordinate_resolution", "z_coordinate_resolution", "generator",
    "copyright", "timestamp", "timeStamp", "totalFeatures", "numberMatched", "numberReturned", "metadata", "links",
)  # fmt: skip
FEATURE_MEMBERS = ("type", "id", "properties", "geometry", "bbox", "geometry_name", "title", "links", "tippecanoe")
GEOMETRY_MEMBERS = ("type", "coordinates", "bbox")
PROPERTIES = ("kind", "floor", "ceiling", "radius")
# Longitude and latitude in degrees: RFC 7946's own system, and WGS 84 as programs name it.
DEGREES = re.compile(r"(urn:ogc:def:crs:)?(OGC:[\d.]*:?CRS84h?|EPSG:[\d.]*:?(4326|4979))", re.IGNORECASE)
EMPTY = {"type": "FeatureCollection", "features": [], "limits": EnvelopeLimits().report()}
SHAPE = 'GeoJSON of an envelope is {"type": "FeatureCollection", "features": [...], "limits": {...}}'
HEIGHTS = "heights in the coordinates limit nothing: floor and ceiling do"


def of_geojson(body: Mapping[str, Any], source: str) -> Envelope:
    """The envelope of a FeatureCollection; its members `limits` and `every` are those of `Envelope`.

    Raises:
        BadRequest: it is none.
        Invalid: a feature or a limit makes no sense.
    """
    if body.get("type") != "FeatureCollection" or not isinstance(body.get("features"), list):
        raise BadRequest(SHAPE)
    for name in body:
        if name not in MEMBERS:
            raise Invalid(f"there is no member {shown(name)}; {nearest(name, MEMBERS[:5])}", name[:40])
    _require_degrees(body.get("crs"))
    limits = body.get("limits")
    if not isinstance(limits, dict | None):
        raise Invalid("limits is a JSON object", "limits")
    every = body.get("every", False)
    if not isinstance(every, bool):
        raise Invalid(f"every is {shown(every)}, not true or false", "every")
    if len(body["features"]) > MOST_AREAS:
        raise Invalid(f"it has more than {MOST_AREAS} areas", "features")
    areas = [area for number, feature in enumerate(body["features"], 1) for area in _of_feature(feature, number)]
    has_heights = any(_has_height(feature["geometry"]["coordinates"]) for feature in body["features"])
    remarks = (HEIGHTS,) if has_heights else ()
    return Envelope(tuple(areas), EnvelopeLimits.of(limits or {}), source, every, remarks)


def geojson(envelope: Envelope) -> dict[str, Any]:
    """The envelope as a FeatureCollection, which `of_geojson` takes again."""
    features = [_feature(area) for area in envelope.areas]
    every = {"every": True} if envelope.every and envelope.inclusions > 1 else {}
    return {"type": "FeatureCollection", "features": features, "limits": envelope.limits.report(), **every}


def number_in(value: Any, what: str, *loc: str) -> float:
    """A finite number of a JSON body.

    Raises:
        Invalid: it is none; `what` begins the error.
    """
    if not is_finite_number(value):
        raise Invalid(f"{what}: {shown(value)} is not a number", *loc)
    return float(value)


def _require_degrees(crs: Any) -> None:
    """Raise Invalid unless the coordinates are longitudes and latitudes, as without any `crs`."""
    if crs is None:
        return
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str) or not DEGREES.fullmatch(name.replace("::", ":")):
        raise Invalid(f"crs {shown(name or crs)}: an envelope has longitude and latitude in degrees (CRS84)", "crs")


def _of_feature(feature: Any, number: int) -> Iterator[Area]:
    where, loc = f"feature {number}", ("features", str(number))
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise Invalid(f'{where} is not a JSON object with "type": "Feature"', *loc)
    properties, geometry = feature.get("properties"), feature.get("geometry")
    if not isinstance(properties, dict) or not isinstance(geometry, dict):
        raise Invalid(f"{where} needs properties and a geometry, both JSON objects", *loc)
    for name in feature:
        if name not in FEATURE_MEMBERS:
            raise Invalid(f"{where} has a member {shown(name)}; what limits goes into its properties", *loc)
    for member in geometry:
        if member not in GEOMETRY_MEMBERS:
            raise Invalid(f"{where}: its geometry has {shown(member)}; what limits goes into its properties", *loc)
    require_no_limit(properties, PROPERTIES, where, *loc)
    name = _name(properties, number)
    if not isinstance(properties.get("kind"), str) or properties["kind"] not in KINDS:
        given = shown(properties.get("kind"))
        raise Invalid(f"{name}: its property kind is {given}, neither inclusion nor exclusion", *loc)
    common: dict[str, Any] = {
        "name": name,
        "inclusion": KINDS[properties["kind"]],
        "floor": _height(properties, "floor", -math.inf, *loc),
        "ceiling": _height(properties, "ceiling", math.inf, *loc),
    }
    kind, corners = geometry.get("type"), geometry.get("coordinates")
    if kind == "Point":
        radius = number_in(properties.get("radius"), f"{name}: the radius of a Point", *loc)
        yield Area(centre=_place(corners, name, *loc), radius=radius, **common)
        return
    if kind not in ("Polygon", "MultiPolygon"):
        raise Invalid(f"{name} is a {shown(kind)}: it takes Polygon, MultiPolygon, or Point with a radius", *loc)
    if properties.get("radius") is not None:
        raise Invalid(f"{name} has a radius and is a {kind}: only a Point has a radius", *loc)
    polygons = [corners] if kind == "Polygon" else corners
    if not isinstance(polygons, list) or not polygons or not all(isinstance(one, list) and one for one in polygons):
        raise Invalid(f"{name} is a {kind} without corners", *loc)
    for rings in polygons:
        yield Area(rings=tuple(_ring(ring, name, *loc) for ring in rings), **common)


def _name(properties: Mapping[str, Any], number: int) -> str:
    """The area's name; KML by way of GDAL has it as `Name`."""
    name = properties.get("name") or properties.get("Name")
    return name if isinstance(name, str) and name.strip() else f"feature {number}"


def _height(properties: Mapping[str, Any], key: str, default: float, *loc: str) -> float:
    value = properties.get(key)
    return default if value is None else number_in(value, f"its {key}", *loc)


def _ring(corners: Any, name: str, *loc: str) -> tuple[Place, ...]:
    if not isinstance(corners, list):
        raise Invalid(f"{name}: a ring is a list of [longitude, latitude]", *loc)
    return closed([_place(corner, name, *loc) for corner in corners], name, *loc)


def closed(ring: list[Place], name: str, *loc: str) -> tuple[Place, ...]:
    """The corners of a ring without the last one, which is the first again.

    Raises:
        Invalid: it is empty or open: what was drawn was no area.
    """
    if not ring:
        raise Invalid(f"{name} has an outline without corners", *loc)
    if ring[0] != ring[-1]:
        raise Invalid(f"{name}: its outline is open; the last corner of an area is the first one again", *loc)
    return tuple(ring[:-1])


def _place(position: Any, name: str, *loc: str) -> Place:
    """GeoJSON has the longitude first."""
    if not isinstance(position, list) or not 2 <= len(position) <= 4:
        raise Invalid(f"{name}: {shown(position)} is not [longitude, latitude]", *loc)
    lon, lat = (number_in(value, f"{name}: a corner", *loc) for value in position[:2])
    return lat, lon


def _has_height(coordinates: Any) -> bool:
    """Whether a corner has a height other than 0."""
    if coordinates and isinstance(coordinates[0], list):
        return any(_has_height(inner) for inner in coordinates)
    return any(bool(value) for value in coordinates[2:3])


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
