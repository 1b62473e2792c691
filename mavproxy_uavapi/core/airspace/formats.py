"""Envelope files: GeoJSON, KML, KMZ, .plan, fences; and the fence that MAVProxy has loaded. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.airspace import fence_files, kml
from mavproxy_uavapi.core.airspace.geojson import EMPTY, HEIGHTS, closed, geojson, number_in, of_geojson
from mavproxy_uavapi.core.airspace.model import Area, Envelope, Place
from mavproxy_uavapi.core.airspace.words import kind_of, require_no_limit, says_exclusion
from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.file_text import text_of, unpacked
from mavproxy_uavapi.core.geodesy import DEG_E7
from mavproxy_uavapi.core.mission import wpl
from mavproxy_uavapi.core.strict_json import json_of, shown

__all__ = ["EMPTY", "HEIGHTS", "geojson", "fence_of_plan", "of_bytes", "of_fence", "of_geojson", "read"]

mavlink = mavutil.mavlink

FORMATS = "an envelope is a GeoJSON FeatureCollection, a KML, a KMZ, a .plan or a fence file"
LARGEST = 4 * 1024 * 1024  # bytes, also of what a KMZ holds
PLAN_MEMBERS = ("fileType", "version", "groundStation", "geoFence", "mission", "rallyPoints")
FENCE_MEMBERS = ("version", "polygons", "circles", "polygon", "breachReturn")
DRAWN_MEMBERS = ("version", "inclusion", "polygon", "circle", "fenceAction", "name")  # of a polygon or a circle
RETURN = "the breach return point is not used"
FLAT = "heights in the KML limit nothing: GeoJSON has floor and ceiling"
HOME_CIRCLE = 5005  # MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION, which older pymavlinks do not name
POLYGONS = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}


def of_bytes(data: bytes, source: str) -> Envelope:
    """The envelope in a file, in any of the formats.

    Raises:
        BadRequest, Invalid: as `read`, `text_of` and `unpacked`.
    """
    return read(text_of(unpacked(data, "the envelope", LARGEST), "the envelope"), source)


def read(text: str, source: str) -> Envelope:
    """The envelope in a file's text, in any of the formats.

    Raises:
        BadRequest: it has none of them.
        Invalid: something in it makes no sense, or is nearly the name of a limit.
    """
    text = text.lstrip("\ufeff \t\r\n")
    if text.startswith("<"):
        return _of_kml(text, source)
    if text.startswith(wpl.HEAD):
        return of_fence(fence_files.rows(text), source)
    if fence_files.is_list_of_points(text):
        area = Area("fence polygon", inclusion=True, rings=(tuple(fence_files.corners(text)),))
        return Envelope((area,), source=source, every=True, remarks=(RETURN,))
    if not text.startswith("{"):
        raise BadRequest(f"{FORMATS}; this begins with {shown(text[:20])}")
    body = json_of(text, "the envelope")
    if body.get("fileType") == "Plan" or "geoFence" in body:
        require_no_limit(body, PLAN_MEMBERS, "the .plan file")
        fence = fence_of_plan(body.get("geoFence", {}), source)
        if fence is None:
            raise Invalid("the .plan file draws no fence", "geoFence")
        return fence
    if "type" not in body:
        raise BadRequest(FORMATS)
    return of_geojson(body, source)


# -- KML ------------------------------------------------------------------------------------------------------


def _of_kml(text: str, source: str) -> Envelope:
    drawing = kml.read(text)
    for path in drawing.paths:
        if path.is_closed or kind_of(path.name) is not None or _kind_of_folders(path.folders) is not None:
            name = shown(path.name or "without a name")
            raise Invalid(f"the {path.element} {name} is no area: draw it as a polygon, or remove it")
    areas = tuple(_area(polygon, number) for number, polygon in enumerate(drawing.polygons, 1))
    others = len(drawing.paths) + drawing.points
    remarks = [FLAT] if any(polygon.has_height for polygon in drawing.polygons) else []
    remarks += [f"{others} paths and points limit nothing"] if others else []
    return Envelope(areas, source=source, remarks=tuple(remarks))


def _area(polygon: kml.KmlPolygon, number: int) -> Area:
    """The area of a polygon: its own name says whether it is an exclusion, or else the nearest folder's that does."""
    name = polygon.name or f"polygon {number}"
    inclusion = kind_of(polygon.name)
    if inclusion is None:
        inclusion = _kind_of_folders(polygon.folders)
    if inclusion is None and kind_of(polygon.document) is False:
        document = shown(polygon.document)
        raise Invalid(f"the document is called {document}: name {shown(name)} an inclusion or an exclusion")
    where = f"the Placemark {shown(name)}"
    require_no_limit(dict(polygon.attributes), (), where)
    for attribute, text in polygon.attributes if inclusion is None else ():
        if says_exclusion(text):
            says = f"{where} says exclusion in its {shown(attribute)}, where it does not count"
            raise Invalid(f"{says}: name it an exclusion or an inclusion")
    rings = tuple(closed(list(ring), name) for ring in polygon.rings)
    return Area(name, inclusion is not False, rings)


def _kind_of_folders(folders: Sequence[str]) -> bool | None:
    return next((kind for kind in map(kind_of, folders) if kind is not None), None)


# -- .plan ----------------------------------------------------------------------------------------------------


def fence_of_plan(fence: Any, source: str) -> Envelope | None:
    """The fence of a .plan file: the value of its `geoFence`; None where it draws none.

    Version 2 has inclusions and exclusions; version 1, of old QGroundControls, one polygon to be inside of.

    Raises:
        Invalid: something in it makes no sense, or is nearly the name of a limit.
    """
    if not isinstance(fence, dict):
        raise Invalid("the .plan file's geoFence is no JSON object", "geoFence")
    require_no_limit(fence, FENCE_MEMBERS, "the geoFence", "geoFence")
    for name in fence:
        if name not in FENCE_MEMBERS:
            raise Invalid(f"the geoFence has {shown(name)}, which is not known", "geoFence")
    version = fence.get("version", 2)
    if version not in (1, 2):
        raise Invalid(f"the geoFence has version {shown(version)}; 1 and 2 are known", "geoFence", "version")
    areas = [*_of_plan_list(fence, "polygons", _plan_polygon), *_of_plan_list(fence, "circles", _plan_circle)]
    if fence.get("polygon"):
        ring = _plan_ring(fence["polygon"], "the geoFence's polygon", "geoFence", "polygon")
        areas.insert(0, Area("polygon of version 1", inclusion=True, rings=(ring,)))
    remarks = (RETURN,) if fence.get("breachReturn") else ()
    return Envelope(tuple(areas), source=source, every=True, remarks=remarks) if areas else None


def _of_plan_list(fence: Mapping[str, Any], key: str, area_of: Callable[[Any, str, str], Area]) -> Iterator[Area]:
    drawn = [] if fence.get(key) is None else fence[key]
    if not isinstance(drawn, list):
        raise Invalid(f"its {key} are no list", "geoFence", key)
    for number, one in enumerate(drawn, 1):
        name = f"{key.removesuffix('s')} {number}"
        if not isinstance(one, dict):
            raise Invalid(f"{name} is not a JSON object", "geoFence", key)
        require_no_limit(one, DRAWN_MEMBERS, name, "geoFence", key)
        if not isinstance(one.get("inclusion"), bool):
            raise Invalid(
                f"{name}: its inclusion is {shown(one.get('inclusion'))}, not true or false", "geoFence", key
            )
        yield area_of(one, name, key)


def _plan_polygon(polygon: Mapping[str, Any], name: str, key: str) -> Area:
    if not polygon.get("polygon"):
        raise Invalid(f"{name} has no corners in its member polygon", "geoFence", key)
    return Area(name, polygon["inclusion"], (_plan_ring(polygon["polygon"], name, "geoFence", key),))


def _plan_circle(one: Mapping[str, Any], name: str, key: str) -> Area:
    circle = one.get("circle")
    if not isinstance(circle, dict):
        raise Invalid(f"{name} has no member circle", "geoFence", key)
    centre = _plan_place(circle.get("center"), name, "geoFence", key)
    radius = number_in(circle.get("radius"), f"{name}: its radius", "geoFence", key)
    return Area(name, one["inclusion"], centre=centre, radius=radius)


def _plan_ring(corners: Any, name: str, *loc: str) -> tuple[Place, ...]:
    """Corners of a .plan file, where the last one is not the first again."""
    if not isinstance(corners, list):
        raise Invalid(f"{name} is no list of [latitude, longitude]", *loc)
    return _open([_plan_place(corner, name, *loc) for corner in corners])


def _plan_place(place: Any, name: str, *loc: str) -> Place:
    if not isinstance(place, list) or not 2 <= len(place) <= 3:
        raise Invalid(f"{name}: {shown(place)} is not [latitude, longitude]", *loc)
    lat, lon = (number_in(value, f"{name}: a corner", *loc) for value in place[:2])
    return lat, lon


# -- MAVProxy's fence -------------------------------------------------------------------------------------------


def of_fence(items: Sequence[Any], source: str, home: Callable[[], Place | None] = lambda: None) -> Envelope:
    """The envelope of MISSION_ITEM_INTs of a vehicle's own fence.

    Args:
        items: in their order.
        source: for messages.
        home: gives home, for a circle around it.

    Raises:
        Invalid: there are none, or a polygon has fewer corners than it says.
    """
    returns = any(item.command == mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT for item in items)
    areas = tuple(_of_items(list(items), home))
    return Envelope(areas, source=source, every=True, is_own=True, remarks=(RETURN,) if returns else ())


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
            yield Area(f"fence polygon {item.seq}", POLYGONS[item.command], (_open(ring),))
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
    per_degree = DEG_E7 if item.get_type() == "MISSION_ITEM_INT" else 1.0
    return item.x / per_degree, item.y / per_degree


def _open(ring: list[Place]) -> tuple[Place, ...]:
    """The corners without the last one, if that is the first again."""
    return tuple(ring[:-1] if len(ring) > 1 and ring[0] == ring[-1] else ring)
