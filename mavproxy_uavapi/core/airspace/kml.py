"""The polygons of a KML file, as AERPAW's safety checker takes them. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree

OUTLINE = "{*}outerBoundaryIs/{*}LinearRing/{*}coordinates"
HOLES = "{*}innerBoundaryIs/{*}LinearRing/{*}coordinates"


Place = tuple[float, float]  # latitude and longitude, degrees


class KmlPolygon(NamedTuple):
    """A polygon: the name of its Placemark, and its corners ring by ring, the outline first."""

    name: str
    rings: tuple[tuple[Place, ...], ...]


def polygons(text: str) -> list[KmlPolygon]:
    """All polygons, in the order of the file.

    Raises:
        ValueError: it is no KML, or a corner is no pair of numbers.
    """
    try:
        root = ElementTree.fromstring(text.encode())  # bytes: a text may not declare an encoding
    except ElementTree.ParseError as error:
        raise ValueError(f"it is not KML: {error}") from error
    return list(_polygons_below(root, ""))


def _polygons_below(element: ElementTree.Element, name: str) -> Iterator[KmlPolygon]:
    if element.tag.endswith("}Placemark") or element.tag == "Placemark":
        name = (element.findtext("{*}name") or "").strip()
    if element.tag.endswith("}Polygon") or element.tag == "Polygon":
        outline = element.findtext(OUTLINE)
        if outline:
            holes = [hole.text or "" for hole in element.iterfind(HOLES)]
            yield KmlPolygon(name, tuple(tuple(_corners(ring)) for ring in (outline, *holes)))
        return
    for child in element:
        yield from _polygons_below(child, name)


def _corners(text: str) -> Iterator[Place]:
    for corner in text.split():
        lon, lat, *_ = corner.split(",")
        yield float(lat), float(lon)
