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
from mavproxy_uavapi.http.examples import ENVELOPE

SQUARE = [[149.16, -35.36], [149.17, -35.36], [149.17, -35.35], [149.16, -35.35], [149.16, -35.36]]
KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Placemark><name>Lake Wheeler</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
 149.16,-35.36,0 149.17,-35.36,0 149.17,-35.35,0 149.16,-35.36,0
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
<Placemark><name>Exclusion: barn</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
 149.162,-35.359 149.163,-35.359 149.163,-35.358
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
</Document></kml>"""
PLAN = {
    "fileType": "Plan",
    "geoFence": {
        "circles": [{"circle": {"center": [-35.355, 149.165], "radius": 50}, "inclusion": False, "version": 1}],
        "polygons": [
            {"inclusion": True, "path": [[-35.36, 149.16], [-35.36, 149.17], [-35.35, 149.17]], "version": 1}
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
        (json.dumps({**PLAN, "geoFence": {"polygons": [{"path": []}], "circles": []}}), Invalid),
    ],
)
def test_what_makes_no_sense_is_refused(text: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        Space(formats.read(text, "a file"))


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
