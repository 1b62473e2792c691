"""Envelope files of every format."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.model import EnvelopeLimits
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.http.contract.route import AREAS as ENVELOPE

SQUARE = [[149.16, -35.36], [149.17, -35.36], [149.17, -35.35], [149.16, -35.35], [149.16, -35.36]]
KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Placemark><name>Lake Wheeler</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
 149.16,-35.36,0 149.17,-35.36,0 149.17,-35.35,0 149.16,-35.36,0
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
<Placemark><name>Exclusion: barn</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
 149.162,-35.359 149.163,-35.359 149.163,-35.358 149.162,-35.359
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
</Document></kml>"""
PLAN = {
    "fileType": "Plan",
    "geoFence": {
        "circles": [{"circle": {"center": [-35.355, 149.165], "radius": 50}, "inclusion": False, "version": 1}],
        "polygons": [
            {"inclusion": True, "polygon": [[-35.36, 149.16], [-35.36, 149.17], [-35.35, 149.17]], "version": 1}
        ],
        "version": 2,
    },
    "mission": {"items": []},
}


def feature(**changes: Any) -> dict[str, Any]:
    whole = {
        "type": "Feature",
        "properties": {"kind": "inclusion"},
        "geometry": {"type": "Polygon", "coordinates": [SQUARE]},
    }
    return {"type": "FeatureCollection", "features": [{**whole, **changes}]}


def test_geojson_is_read_and_written_alike() -> None:
    envelope = formats.read(json.dumps(ENVELOPE), "a file")
    field, mast = envelope.areas
    assert (field.name, field.inclusion, field.ceiling, field.floor) == ("field", True, 60.0, -math.inf)
    assert field.rings[0][0] == (-35.367, 149.16) and len(field.rings[0]) == 4
    assert (mast.inclusion, mast.centre, mast.radius) == (False, (-35.3625, 149.1665), 25.0)
    assert envelope.limits == EnvelopeLimits(height=60, distance=400, speed=8)
    assert formats.read(json.dumps(formats.geojson(envelope)), "a file") == envelope
    Space(envelope)


def test_kml_has_inclusions_and_what_is_named_an_exclusion() -> None:
    field, barn = formats.read(KML, "a file").areas
    assert (field.name, field.inclusion, field.rings[0][0]) == ("Lake Wheeler", True, (-35.36, 149.16))
    assert len(field.rings[0]) == 3
    assert not barn.inclusion


def test_plan_has_its_fence_of_which_every_inclusion_holds() -> None:
    envelope = formats.read(json.dumps(PLAN), "a file")
    assert [(area.name, area.inclusion) for area in envelope.areas] == [("polygon 1", True), ("circle 1", False)]
    assert envelope.every


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", BadRequest),
        ("no JSON", BadRequest),
        ("[]", BadRequest),
        ("{}", BadRequest),
        ("<kml", BadRequest),
        ("<kml/>", Invalid),
        ("[" * 100_000, BadRequest),
        (json.dumps({"type": "FeatureCollection", "features": []}), Invalid),
        (json.dumps({**feature(), "limit": {"height": 3}}), Invalid),
        (json.dumps({**feature(), "limits": {"hight": 3}}), Invalid),
        (json.dumps({**feature(), "limits": {"height": "3"}}), Invalid),
        (json.dumps({**feature(), "limits": {"height": -3}}), Invalid),
        (json.dumps({**feature(), "limits": [3]}), Invalid),
        (json.dumps({**feature(), "limits": {"reserve": 101}}), Invalid),
        (json.dumps(feature(properties={})), Invalid),
        (json.dumps(feature(properties={"kind": "inside"})), Invalid),
        (json.dumps(feature(properties={"kind": "inclusion", "ceiling": "60"})), Invalid),
        (json.dumps(feature(properties={"kind": "inclusion", "floor": 9, "ceiling": 3})), Invalid),
        (json.dumps(feature(geometry=None)), Invalid),
        (json.dumps(feature(geometry={"type": "LineString", "coordinates": SQUARE})), Invalid),
        (json.dumps(feature(geometry={"type": "Polygon", "coordinates": []})), Invalid),
        (json.dumps(feature(geometry={"type": "Polygon", "coordinates": [[[1, 2], [3, 4]]]})), Invalid),
        (json.dumps(feature(geometry={"type": "Polygon", "coordinates": [[["a", 2], [3, 4], [4, 5]]]})), Invalid),
        (json.dumps(feature(geometry={"type": "Point", "coordinates": [149, -35]})), Invalid),
        (json.dumps(feature(geometry={"type": "Polygon", "coordinates": [SQUARE]}, properties=[3])), Invalid),
        (json.dumps({"fileType": "Plan"}), Invalid),
        (json.dumps({**PLAN, "geoFence": {"polygons": [{"polygon": []}], "circles": []}}), Invalid),
    ],
)
def test_what_makes_no_sense_is_refused(text: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        Space(formats.read(text, "a file"))


def of(properties: dict[str, Any], **changes: Any) -> str:
    return json.dumps(feature(properties={"kind": "inclusion", **properties}, **changes))


def kml(*placemarks: str, name: str = "") -> str:
    return f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document><name>{name}</name>{"".join(placemarks)}</Document></kml>'


def placemark(name: str, corners: str = "149.16,-35.36 149.17,-35.36 149.17,-35.35 149.16,-35.36") -> str:
    ring = f"<LinearRing><coordinates>{corners}</coordinates></LinearRing>"
    polygon = f"<Polygon><outerBoundaryIs>{ring}</outerBoundaryIs></Polygon>"
    return f"<Placemark><name>{name}</name>{polygon}</Placemark>"


def path(name: str, corners: str = "149.16,-35.36 149.17,-35.36", element: str = "LineString") -> str:
    line = f"<{element}><coordinates>{corners}</coordinates></{element}>"
    return f"<Placemark><name>{name}</name>{line}</Placemark>"


def fence(**members: Any) -> str:
    return json.dumps({"fileType": "Plan", "geoFence": {"version": 2, "polygons": [], "circles": [], **members}})


CORNERS = [[-35.36, 149.16], [-35.36, 149.17], [-35.35, 149.17]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (of({"cieling": 60}), "feature 1 has 'cieling', which is no limit here; did you mean ceiling?"),
        (of({"Ceiling": 60}), "did you mean ceiling?"),
        (of({"UPPER_VAL": 400}), "feature 1 has 'UPPER_VAL', which is no limit here"),  # as airspace files have it
        (of({"Höhe": 60}), "feature 1 has 'Höhe', which is no limit here"),
        (of({"altura_m": 60}), "feature 1 has 'altura_m', which is no limit here"),
        (of({"max_alt": 60}), "has 'max_alt', which is no limit here; there are kind, floor, ceiling, radius"),
        (of({"maxHeight": 60}), "has 'maxHeight'"),
        (of({"inclusion": "false"}), "has 'inclusion'"),
        (of({"kind": ["inclusion"]}), "neither inclusion nor exclusion"),
        (of({"kind": "Exclusion"}), "neither inclusion nor exclusion"),
        (of({}, ceiling=60), "has a member 'ceiling'; what limits goes into its properties"),
        (of({"radius": 60}), "has a radius and is a Polygon"),
        (of({"ceiling": float("1e999")}), "its ceiling: Infinity is not a number"),
        ('{"type": "FeatureCollection", "features": [], "limits": {"height": 60, "height": 600}}', "'height' twice"),
        (json.dumps({**feature(), "limits": {"height": 10**401}}), "is not a positive number"),
        (json.dumps({**feature(), "limits": {"hieght": 60}}), "no limit 'hieght'; did you mean height?"),
        (json.dumps({**feature(), "height": 60}), "there is no member 'height'"),
        (of({}, geometry={"type": "Polygon", "coordinates": [SQUARE[:-1]]}), "its outline is open"),
        (of({}, geometry={"type": "Polygon", "coordinates": [SQUARE, []]}), "an outline without corners"),
        (of({}, geometry={"type": "MultiPolygon", "coordinates": []}), "a MultiPolygon without corners"),
        (of({}, geometry={"type": "Polygon", "coordinates": [[[149.16]]]}), "[149.16] is not [longitude, latitude]"),
        (json.dumps({**feature(), "crs": {"type": "name", "properties": {"name": "EPSG:3857"}}}), "crs 'EPSG:3857'"),
        (kml(placemark("field", "")), "'field' has an outline without corners"),
        (kml("<Placemark><Polygon/></Placemark>"), "'polygon 1' has 0 outlines"),
        (kml(placemark("field", "149.16,-35.36 149.17,-35.36 149.17,-35.35 149.16,-35.37")), "its outline is open"),
        (kml(placemark("field", "149,16,-35,36,0")), "corner 1 is '149,16,-35,36,0', not longitude,latitude"),
        (kml(placemark("field", "149.16,north")), "corner 1 is '149.16,north'"),
        (kml(placemark("Exlusion: barn")), "has 'exlusion'; did you mean exclusion?"),
        (kml(placemark("inclusion and exclusion")), "says exclusion and inclusion"),
        (kml(placemark("field"), path("Exclusion: road")), "the LineString 'Exclusion: road' is no area"),
        (kml(placemark("field"), path("pond", element="LinearRing")), "the LinearRing 'pond' is no area"),
        (kml(placemark("field"), path("a", "1,1 1,2 2,2 1,1")), "the LineString 'a' is no area"),
        (kml(placemark("field"), name="No-fly zones"), "is called 'No-fly zones': name 'field'"),
        (kml("<NetworkLink/>"), "links to another file"),
        (kml(placemark("a" * 501)), "a name has more than 500 characters"),
        (kml(*[path("a")] * 2001), "draws more than 2000 polygons, paths and points"),
        (of({f"p{n}": 1 for n in range(201)}), "feature 1 has more than 200 members"),
        (json.dumps({**feature(), "features": feature()["features"] * 201}), "more than 200 areas"),
        ('<!DOCTYPE kml [<!ENTITY a "b">]><kml>&a;</kml>', "the KML has a DOCTYPE"),
        ("<a>" * 5000, "nested more than 60 levels deep"),
        (
            fence(polygons=[{"inclusion": "false", "polygon": CORNERS}]),
            "polygon 1: its inclusion is 'false', not true",
        ),
        (fence(polygons=[{"inclusion": True, "path": CORNERS}]), "polygon 1 has no corners in its member polygon"),
        (fence(polygons=[{"inclusion": True, "polygon": CORNERS, "maxAltitude": 30}]), "has 'maxAltitude'"),
        (fence(polygons={}), "its polygons are no list"),
        (fence(version=3), "has version 3"),
        (fence(circles=[{"inclusion": True}]), "circle 1 has no member circle"),
        (fence(circles=[{"inclusion": True, "circle": {"center": CORNERS[0]}}]), "its radius: null is not a number"),
        (fence(height=30), "the geoFence has 'height'"),
    ],
)
def test_what_may_be_a_limit_is_not_overlooked(text: str, words: str) -> None:
    with pytest.raises((BadRequest, Invalid)) as caught:
        Space(formats.read(text, "a file"))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("text", "summary"),
    [
        (
            of({"Name": "a", "fid": 7, "stroke": "#fff", "altitudeMode": "clampToGround", "cieling": None}),
            "1 inclusion, 0 exclusions",
        ),
        (
            json.dumps(
                {**feature(), "bbox": [1, 2, 3, 4], "crs": {"properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}}
            ),
            "1 inclusion, 0 exclusions",
        ),
        (
            of({}, geometry={"type": "Polygon", "coordinates": [[[*c, 30] for c in SQUARE]]}),
            f"1 inclusion, 0 exclusions; {formats.HEIGHTS}",
        ),
        (
            kml(placemark("Conclusion bay"), placemark("Éxclusión"), placemark("<![CDATA[<b>Ex</b>clusion]]>")),
            "1 inclusion, 2 exclusions",
        ),
        (
            kml(
                placemark("field"),
                "<Folder><name>Exclusions</name>",
                placemark("a"),
                placemark("Inclusion b"),
                "</Folder>",
            ),
            "2 inclusions, 1 exclusion",
        ),
        *(
            (kml(placemark("field"), placemark(name)), "1 inclusion, 1 exclusion")
            for name in (
                "test_no_go",
                "No Entry",
                "Avoid: masts",
                "Zona proibida",
                "Área restrita",
                "Zona de perigo",
                "Zona restringida",
                "Zona peligrosa",
                "Zone réglementée",
                "Zona vietata",
                "Gefahrengebiet",
                "Verboden gebied",
            )
        ),
        (kml(placemark("field"), placemark("No-Fly Zone")), "1 inclusion, 1 exclusion"),
        (
            kml(placemark("field", "149.16, -35.36, 30 149.17, -35.36, 30 149.17,-35.35 149.16, -35.36, 30")),
            f"1 inclusion, 0 exclusions; {formats.FLAT}",
        ),
        (
            kml(placemark("field"), path("the way"), "<Placemark><Point/></Placemark>"),
            "1 inclusion, 0 exclusions; 2 paths and points limit nothing",
        ),
        (fence(polygon=CORNERS, version=1, polygons=None), "1 inclusion, 0 exclusions"),
        (
            fence(polygons=[{"inclusion": False, "polygon": CORNERS, "fenceAction": 1}], breachReturn=[1, 2, 3]),
            f"0 inclusions, 1 exclusion; {formats.RETURN}",
        ),
    ],
)
def test_what_programs_write_is_read_and_counted(text: str, summary: str) -> None:
    assert formats.read(text, "a file").summary() == summary


def item(command: int, lat: float, lon: float, param1: float, seq: int = 0) -> Any:
    return mavlink.MAVLink_mission_item_int_message(
        1, 1, seq, 0, command, 0, 0, param1, 0, 0, 0, round(lat * 1e7), round(lon * 1e7), 0, 1
    )


def test_fence_of_the_vehicle_is_read_as_mavproxy_holds_it() -> None:
    polygon = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    corners = [
        item(polygon, lat, lon, 3, seq) for seq, (lat, lon) in enumerate([(-35, 149), (-35.01, 149), (-35, 149.01)])
    ]
    circle = item(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, -35, 149, 40, 6)
    point = item(mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, -35, 149, 0)
    around = item(formats.HOME_CIRCLE, 0, 0, 300, 9)
    envelope = formats.of_fence([point, *corners, *corners, circle, around], "the fence", lambda: (-35.0, 149.0))
    assert [area.inclusion for area in envelope.areas] == [True, True, False, True]
    assert envelope.areas[3].radius == 300 and envelope.every
    for items in ([], corners[:2], [point], [item(16, 0, 0, 0)], [around]):
        with pytest.raises(Invalid):
            formats.of_fence(items, "the fence")
