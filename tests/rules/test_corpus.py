"""A file of each kind that people have, and what it gives: read right, or refused with a sentence."""

from __future__ import annotations

import re

import pytest

from tests.support.parsers import CORPUS, PARSERS

# By parser and file: what is read, or a part of the sentence that refuses it, after `!`.
EXPECTED = {
    "envelope": {
        "401_digits.geojson": "!limits.height: Infinity is not a positive number",
        "attribute_ceiling.kml": "!the Placemark 'Field' has 'ceiling', which is no limit here; there are none",
        "attribute_exclusion.kml": "!the Placemark 'Pond' says exclusion in its 'use', where it does not count",
        "billion_laughs.kml": "!the KML has a DOCTYPE: remove it",
        "bomb.kmz": "!the KML that the envelope holds has more than 4096 kB",
        "by_hand.kml": "1 inclusion, 0 exclusions",
        "damaged.kmz": "!the envelope is packed, and damaged or encrypted",
        "ceiling_beside_fence.plan": "!the .plan file has 'ceiling', which is no limit here",
        "decimal_commas.kml": "!'Field': corner 1 is '149,1652,-35,3632,0', not longitude,latitude",
        "described_and_named.kml": "1 inclusion, 0 exclusions",
        "described_exclusion.kml": "!the Placemark 'Pond' says exclusion in its 'description'",
        "empty_polygon.kml": "!'Exclusion: pond' has an outline without corners",
        "geojson_io.geojson": "1 inclusion, 0 exclusions",
        "geometry_with_layer.geojson": "!feature 1: its geometry has 'extent'; what limits goes into its properties",
        "google_earth.kml": "1 inclusion, 1 exclusion; 1 paths and points limit nothing",
        "latin_1.kml": "0 inclusions, 1 exclusion",
        "limit_twice.geojson": "!has the name 'height' twice in one object",
        "mavproxy_fence.txt": "1 inclusion, 0 exclusions; the breach return point is not used",
        "mavproxy_fence_110.txt": "1 inclusion, 1 exclusion; the breach return point is not used",
        "mission.waypoints": "!line 3 has the command 22: a fence has 5000 to 5005",
        "mission_planner.poly": "!a list of points is a fence if it has the return point first",
        "mission_planner_declares_utf_16.kml": "1 inclusion, 0 exclusions",
        "mistyped_ceiling.geojson": "!feature 1 has 'cieling', which is no limit here; did you mean ceiling?",
        "name_with_markup.kml": "1 inclusion, 1 exclusion",
        "page_not_found.kml": "!it is not KML, but a page of HTML",
        "mission_planner_fence.waypoints": "1 inclusion, 1 exclusion; the breach return point is not used",
        "path_named_exclusion.kml": "!the LineString 'Exclusion: road' is no area",
        "qgis.geojson": "1 inclusion, 1 exclusion",
        "qgroundcontrol_1.plan": "1 inclusion, 0 exclusions; the breach return point is not used",
        "qgroundcontrol_2.plan": "1 inclusion, 1 exclusion",
        "qgroundcontrol_no_fence.plan": "!the .plan file draws no fence",
        "track.gpx": "!it is not KML: its outermost element is 'gpx'",
        "two_files.kmz": "!the envelope is packed, and has 2 KML files, not one",
        "unknown_encoding.kml": "!declares the encoding 'klingon', which is not known: save it as UTF-8",
        "utf_16.kml": "1 inclusion, 0 exclusions",
        "web_mercator.geojson": "!EPSG::3857': an envelope has longitude and latitude in degrees",
        "windows_editor.geojson": "1 inclusion, 0 exclusions, height 60",
        "zipped.kmz": "1 inclusion, 0 exclusions",
    },
    "mission": {
        "altitudes_differ.plan": "!item 1 (NAV_WAYPOINT): its Altitude is 50, and in its params it is 20",
        "decimal_commas.waypoints": "!line 2: its latitude is '-35,3632', not a number: numbers have decimal points",
        "landing_pattern.plan": "!item 2 of the .plan file is a 'fwLandingPattern', which only QGroundControl can",
        "latitude_longitude_altitude.json": "NAV_TAKEOFF, NAV_WAYPOINT",
        "later_version.plan": "!the .plan file's mission has version 3; known is 1 and 2",
        "mavproxy.txt": "NAV_TAKEOFF, NAV_WAYPOINT",
        "mission_planner.waypoints": "NAV_TAKEOFF, NAV_WAYPOINT",
        "no_longitude.json": "!item 2 (NAV_WAYPOINT) has no long",
        "null_place.plan": "!item 1 (NAV_WAYPOINT): its lat is null, not a number",
        "numbered_from_1.waypoints": "NAV_TAKEOFF, NAV_WAYPOINT",
        "old_fence.plan": "NAV_TAKEOFF, NAV_WAYPOINT, DO_CHANGE_SPEED, NAV_RETURN_TO_LAUNCH; "
        "fence: 1 inclusion, 0 exclusions",
        "qgroundcontrol.plan": "NAV_TAKEOFF, NAV_WAYPOINT, DO_CHANGE_SPEED, NAV_RETURN_TO_LAUNCH",
        "survey.plan": "NAV_TAKEOFF, NAV_WAYPOINT, DO_SET_CAM_TRIGG_DIST",
        "version_1.mission": "NAV_TAKEOFF, NAV_WAYPOINT",
        "version_2.mission": "NAV_TAKEOFF, NAV_WAYPOINT",
        "windows_editor.json": "NAV_TAKEOFF",
        "with_fence_and_rally.plan": "NAV_TAKEOFF, NAV_WAYPOINT, DO_CHANGE_SPEED, NAV_RETURN_TO_LAUNCH; "
        "fence: 1 inclusion, 1 exclusion; 1 rally points",
    },
    "parameters": {
        "ardupilot_defaults.parm": "SERVO1_FUNCTION 77, BATT_MONITOR 8, CAN_D1_UC_ESC_BM 15, DID_ENABLE 1; "
        "left out: ",
        "decimal_commas.param": "!numbers have decimal points",
        "locations.txt": "!line 1 of the parameters is not `NAME VALUE`",
        "mavproxy.parm": "RTL_ALT 1500, WPNAV_SPEED 500; left out: FORMAT_VERSION, SYSID_THISMAV",
        "mission_planner.param": "RTL_ALT 1500, WPNAV_SPEED 500; left out: ",
        "no_value.parm": "!line 2 of the parameters is not `NAME VALUE`: 'SIM_TIDE_0.5'",
        "qgroundcontrol.params": "RTL_ALT 1500; left out: GMB_MAX",
        "windows_editor.param": "RTL_ALT 1500; left out: ",
        "with_include.parm": "!line 1 includes '../Base/defaults.parm', which is not here",
    },
    "calibration": {
        "camera_info.yaml": "640x480, 580.5, 5 coefficients",
        "decimal_commas.yml": "!line 12: camera_matrix has 10 numbers, not 9",
        "fisheye.yaml": "!line 10 has the lens 'equidistant'",
        "opencv.yml": "640x480, 580.5, 5 coefficients",
        "ours.json": "640x480, 580.5, 5 coefficients",
        "ros.yaml": "640x480, 580.5, 5 coefficients",
        "safety_rules.yaml": "!missing: image_width",
        "windows_editor.json": "640x480, 580.5, 0 coefficients",
    },
    "track": {
        "centmesh.tuple": "2 waypoints",
        "centmesh.txt": "1 waypoints",
        "degrees.txt": "!line 1 is not a GPS_RAW_INT reading",
        "windows_editor.txt": "1 waypoints",
    },
    "tokens": {
        "no_hash": "!line 1: the third word of anna is not a hash",
        "ours": "anna fly:1,2",
        "windows_editor": "anna watch",
    },
    "ini": {
        "no_section.ini": "!line 1: there are no section headers, such as [api], before 'port = 8000'",
        "twice.ini": "!line 3: port already exists in [api]",
        "uav_api.ini": "[api] 2, [logs] 1, [simulated] 1",
        "windows_editor.ini": "[api] 1",
    },
    "image": {"tag.jpg": "40x40", "tag.png": "40x40", "text.jpg": "!the body is not an image, JPEG or PNG"},
    "relayed position": {
        "401_digits.json": "!its value is not a finite number",
        "acknowledged.json": "!not a reading: it has no value",
        "aerpaw_message.bin": "!it is not JSON",
        "aerpaw_request.bin": "!it is not JSON",
        "hostile_name.json": "[{'id': '1001', 'lat': '1.0', 'lng': '2.0', 'alt': '3.0', 'device': 'uav', "
        "'type': '102', 'seq': '0', 'ip': ''}]",
        "much_room.bin": "!it is not JSON",
        "position.json": "[{'id': '2', 'lat': '-35.36', 'lng': '149.16', 'alt': '12.5', 'device': 'uav', "
        "'type': '102', 'seq': '0', 'ip': ''}]",
    },
}
# What Python says of its own insides; a pilot reads none of it.
PYTHONIC = re.compile(
    r"\w+Error\b|Expecting|could not convert|invalid literal|codec|\[Errno|NoneType|<class|object has no|unhashable|"
    r"not subscriptable|to unpack|index out of range|must be str|Traceback|not well-formed|source:|option '|'utf-8'"
)


@pytest.mark.parametrize("parser", EXPECTED)
def test_each_file_of_the_corpus_gives_what_it_should(parser: str) -> None:
    summary, errors, folder = PARSERS[parser]
    files = {file.name: file.read_bytes() for file in (CORPUS / folder).iterdir()}
    assert files.keys() == EXPECTED[parser].keys()
    for name, expected in EXPECTED[parser].items():
        if not expected.startswith("!"):
            assert summary(files[name]) == expected, name
            continue
        with pytest.raises(errors) as caught:
            summary(files[name])
        assert expected[1:] in str(caught.value), name


@pytest.mark.parametrize("parser", PARSERS)
def test_no_parser_lets_python_speak_to_the_user(parser: str) -> None:
    summary, errors, _ = PARSERS[parser]
    for file in sorted(CORPUS.rglob("*.*")):  # those of the other kinds, too
        try:
            summary(file.read_bytes())
        except errors as error:
            assert not PYTHONIC.search(str(error)), (file.name, str(error))
