"""The polygons of a KML file, as AERPAW's safety checker takes them, and what else is drawn in it. Pure."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from itertools import islice
from typing import Any, NamedTuple
from xml.etree import ElementTree

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.strict_json import shown

DEEPEST = 60  # elements in each other
LONGEST_NAME = 500  # characters of a Placemark's or a folder's name
MOST_DRAWN = 2000  # elements that are drawn
NUMBER = re.compile(r"[-+]?(?:[0-9]{1,20}(?:\.[0-9]{0,30})?|\.[0-9]{1,30})(?:[eE][-+]?[0-9]{1,3})?")
OUTERMOST = ("kml", "Document", "Folder", "Placemark")  # the last three by hand
PATHS = ("LineString", "LinearRing")
ATTRIBUTES = ("description", "styleUrl", "Data", "SimpleData")
POINTS = ("Point", "Track", "MultiTrack", "Model", "GroundOverlay", "PhotoOverlay", "ScreenOverlay")

Place = tuple[float, float]  # latitude and longitude, degrees


class KmlPolygon(NamedTuple):
    """A polygon.

    Attributes:
        name: of its Placemark, without markup.
        rings: its corners ring by ring, the outline first.
        folders: the names of what its Placemark is in, the nearest first; that of the Document is `document`.
        document: the name of the Document.
        has_height: whether a corner has a height other than 0.
        attributes: what else its Placemark says: description, style, and the attributes of a program, by name.
    """

    name: str
    rings: tuple[tuple[Place, ...], ...]
    folders: tuple[str, ...] = ()
    document: str = ""
    has_height: bool = False
    attributes: tuple[tuple[str, str], ...] = ()


class KmlPath(NamedTuple):
    """A path or a ring, which is no polygon: its element's name, and as of `KmlPolygon`."""

    element: str
    name: str
    folders: tuple[str, ...]
    is_closed: bool


class KmlDrawing(NamedTuple):
    """What a file draws: polygons and paths in its order, and how many points and overlays."""

    polygons: list[KmlPolygon]
    paths: list[KmlPath]
    points: int


class _Names(NamedTuple):
    """What an element is in."""

    placemark: str = ""
    folders: tuple[str, ...] = ()
    document: str = ""
    attributes: tuple[tuple[str, str], ...] = ()


class _ShallowTree(ElementTree.TreeBuilder):
    """Builds a tree that is not too deep to be walked, of a file that declares no entities."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = 0

    def start(self, tag: Any, attrs: Any, /) -> Any:
        self._depth += 1
        if self._depth > DEEPEST:
            raise BadRequest(f"the KML has elements nested more than {DEEPEST} levels deep")
        return super().start(tag, attrs)

    def end(self, tag: Any, /) -> Any:
        self._depth -= 1
        return super().end(tag)

    def doctype(self, name: str, _public: str | None, _system: str | None) -> None:
        """Refuse what no KML needs: entities can make a small file a very large one."""
        raise BadRequest(
            "it is not KML, but a page of HTML" if name.lower() == "html" else "the KML has a DOCTYPE: remove it"
        )


def polygons(text: str) -> list[KmlPolygon]:
    """All polygons, in the order of the file.

    Raises:
        BadRequest, Invalid: as `read`.
    """
    return read(text).polygons


def read(text: str) -> KmlDrawing:
    """What a KML file draws.

    Raises:
        BadRequest: it is no KML, or holds only a link to another file.
        Invalid: a polygon has no corners, or a corner is no pair of numbers.
    """
    parser = ElementTree.XMLParser(target=_ShallowTree(), encoding="utf-8")  # whatever the text declares
    try:
        parser.feed(text.encode("utf-8", "replace"))
        root = parser.close()
    except ElementTree.ParseError as error:
        line, column = error.position
        raise BadRequest(f"it is not KML: line {line}, column {column + 1} is not XML") from error
    if _kind(root) not in OUTERMOST:
        raise BadRequest(f"it is not KML: its outermost element is {shown(_kind(root))}")
    drawing = KmlDrawing([], [], 0)
    drawn = list(islice(_drawn(root, _Names()), MOST_DRAWN + 1))
    if len(drawn) > MOST_DRAWN:
        raise Invalid(f"the KML draws more than {MOST_DRAWN} polygons, paths and points")
    points = sum(_draw(element, names, drawing) for element, names in drawn)
    return drawing._replace(points=points)


def _drawn(element: ElementTree.Element, names: _Names) -> Iterator[tuple[ElementTree.Element, _Names]]:
    """The elements that are drawn, with what they are in."""
    kind = _kind(element)
    if kind == "NetworkLink":
        raise BadRequest("the KML links to another file (NetworkLink): send that file")
    if kind == "Placemark":
        names = names._replace(placemark=_name(element), attributes=tuple(_attributes(element)))
    elif kind == "Folder":
        names = names._replace(folders=(_name(element), *names.folders))
    elif kind == "Document":
        names = names._replace(document=_name(element))
    if kind == "Polygon" or kind in PATHS or kind in POINTS:
        yield element, names
        return
    for child in element:
        yield from _drawn(child, names)


def _draw(element: ElementTree.Element, names: _Names, drawing: KmlDrawing) -> int:
    """Add a polygon or a path to the drawing; 1 for what is neither."""
    kind = _kind(element)
    if kind == "Polygon":
        drawing.polygons.append(_polygon(element, names, f"polygon {len(drawing.polygons) + 1}"))
    elif kind in PATHS:
        corners = (element.findtext("{*}coordinates") or "").split()
        closed = kind == "LinearRing" or (len(corners) > 3 and corners[0] == corners[-1])
        drawing.paths.append(KmlPath(kind, names.placemark, names.folders, closed))
    else:
        return 1
    return 0


def _polygon(element: ElementTree.Element, names: _Names, number: str) -> KmlPolygon:
    name = names.placemark or number
    outlines = element.findall("{*}outerBoundaryIs/{*}LinearRing/{*}coordinates")
    holes = element.findall("{*}innerBoundaryIs/{*}LinearRing/{*}coordinates")
    if len(outlines) != 1:
        raise Invalid(f"{shown(name)} has {len(outlines)} outlines (outerBoundaryIs/LinearRing/coordinates), not one")
    rings = [_corners(ring.text or "", name) for ring in (*outlines, *holes)]
    flat = tuple(tuple((lat, lon) for lat, lon, _ in ring) for ring in rings)
    has_height = any(height for ring in rings for _, _, height in ring)
    return KmlPolygon(names.placemark, flat, names.folders, names.document, has_height, names.attributes)


def _corners(text: str, name: str) -> list[tuple[float, float, float]]:
    """Latitude, longitude and height of each corner of a ring."""
    corners = []
    together = ",".join(part.strip() for part in text.split(","))  # by hand a comma may have a space after it
    for number, corner in enumerate(together.split(), 1):
        parts = corner.split(",")
        if not 2 <= len(parts) <= 3 or not all(NUMBER.fullmatch(part) for part in parts):
            expected = "longitude,latitude or longitude,latitude,height with decimal points"
            raise Invalid(f"{shown(name)}: corner {number} is {shown(corner)}, not {expected}")
        lon, lat, *height = map(float, parts)
        corners.append((lat, lon, height[0] if height else 0.0))
    if not corners:
        raise Invalid(f"{shown(name)} has an outline without corners")
    return corners


def _attributes(placemark: ElementTree.Element) -> Iterator[tuple[str, str]]:
    for element in placemark.iter():
        kind = _kind(element)
        if kind in ATTRIBUTES:
            yield element.get("name", kind), "".join(element.itertext())


def _kind(element: ElementTree.Element) -> str:
    """The element's name without its namespace."""
    return str(element.tag).rpartition("}")[2]


def _name(element: ElementTree.Element) -> str:
    """The text of its `name`, without markup, in one line."""
    name = element.find("{*}name")
    text = "" if name is None else "".join(name.itertext())
    if len(text) > LONGEST_NAME:
        raise Invalid(f"a name has more than {LONGEST_NAME} characters: {shown(text)}")
    return " ".join(re.sub(r"<[^<>]*>", "", html.unescape(text)).split())
