from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import pytest

from mavproxy_gradys.tracks.formats import GPX_HEAD, GPX_TAIL, GpsReading, parse, style_of, waypoints
from mavproxy_uavapi.core.errors import Invalid
from tests.support.messages import message_of

TEXT = (
    "GPS_RAW_INT {time_usec : 251908000, fix_type : 3, lat : 357713121, lon : -786743912, alt : 584090,"
    " eph : 0, epv : 65535, vel : 0, cog : 0, satellites_visible : 10}"
)
TUPLE = "(251908000, 357713121, -786743912, 584090, 0, 65535, 0, 0, 3, 10)"
READING = GpsReading(251908000, 357713121, -786743912, 584090, 0, 65535, 0, 0, 3, 10)
DEGREES_PER_METRE = 1e7 / 111318.845


def at(metres: float, alt: float, fix: int = 3) -> GpsReading:
    """A reading so many metres north, at `alt` m AMSL."""
    return GpsReading(0, 357713121 + round(metres * DEGREES_PER_METRE), -786743912, round(alt * 1000), fix_type=fix)


def test_both_formats_are_read_and_written() -> None:
    assert parse(TEXT) == [READING] == parse(TUPLE)
    assert (READING.line("text"), READING.line("tuple")) == (TEXT, TUPLE)
    assert parse(f"# a comment\n\n{TEXT}\r\n{TUPLE}\n") == [READING] * 2


def test_what_mavlink_2_adds_is_passed_over() -> None:
    longer = TEXT.replace("}", ", alt_ellipsoid : 0, h_acc : 300, yaw : 0}")
    assert parse(longer) == [READING]


def test_a_message_makes_a_reading() -> None:
    message = message_of("gps_raw_int", time_usec=251908000, fix_type=3, lat=357713121, lon=-786743912, alt=584090,
                  epv=65535, satellites_visible=10)  # fmt: skip
    assert GpsReading.of(message) == READING


@pytest.mark.parametrize(
    "text",
    ["", "# only a comment", "hello", "(1, 2, 3)", "(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11)", "GPS_RAW_INT {lat : 3}",
     "(1, 910000000, 0, 0, 0, 0, 0, 0, 3, 10)", "__import__('os').system('true')", TEXT + " " + TUPLE],
)  # fmt: skip
def test_what_is_no_track_is_refused(text: str) -> None:
    with pytest.raises(Invalid):
        parse(text)


@pytest.mark.parametrize("wrong", ["35.7713121", "35 7713121", "0x1F", "٣٥", "", "1e8", "9" * 21, "1" * 5000])
def test_a_number_is_read_whole_or_not_at_all(wrong: str) -> None:
    with pytest.raises(Invalid, match="line 1"):
        parse(TEXT.replace("lat : 357713121", f"lat : {wrong}"))
    with pytest.raises(Invalid, match="line 1"):
        parse(TUPLE.replace("357713121", wrong))


@pytest.mark.parametrize("line", ["GPS_RAW_INT {" + "a" * 1_000_000 + "}", "(" + "1" * 1_000_000 + ")"])
def test_a_line_without_end_is_refused_at_once(line: str) -> None:
    with pytest.raises(Invalid, match="longer than 1000"):
        parse(line)


def test_the_line_that_is_wrong_is_named() -> None:
    with pytest.raises(Invalid, match="line 3"):
        parse(f"{TEXT}\n{TUPLE}\nnonsense\n")


def test_the_file_name_chooses_the_format() -> None:
    assert [style_of(name) for name in ("a", "a.txt", "a.tuple", "A.GPX")] == ["text", "text", "tuple", "gpx"]


def test_gpx_is_xml_with_places_in_degrees_and_metres() -> None:
    text = GPX_HEAD + READING.gpx(1_800_000_000) + at(1, 2, fix=1).gpx(1_800_000_001) + GPX_TAIL
    points = ET.fromstring(text).findall(".//{*}trkpt")
    assert [point.attrib for point in points] == [{"lat": "35.7713121", "lon": "-78.6743912"}]
    assert points[0].findtext("{*}ele") == "584.090"
    assert points[0].findtext("{*}time") == "2027-01-15T08:00:00Z"


def test_heights_count_from_the_tracks_own_ground() -> None:
    places = waypoints([at(0, 584), at(10, 594), at(20, 604)])
    assert [place.alt for place in places] == [2.0, 10.0, 20.0]  # the ground itself is not flown at
    assert places[1].lat == pytest.approx(35.7713121 + 10 / 111318.845)
    assert [place.alt for place in waypoints([at(0, 600), at(10, 610)], ground=580)] == [20.0, 30.0]


def test_places_that_hardly_differ_are_one() -> None:
    assert len(waypoints([at(0.0, 600), at(0.5, 600), at(0.9, 600), at(1.5, 600), at(30, 600)], ground=580)) == 3


def test_readings_without_a_fix_are_no_places() -> None:
    assert len(waypoints([at(0, 600, fix=1), at(10, 600), at(20, 600, fix=2)])) == 1
    with pytest.raises(Invalid, match="3D fix"):
        waypoints([at(0, 600, fix=1)])


def test_a_track_into_space_is_refused() -> None:
    with pytest.raises(Invalid, match="above its ground"):
        waypoints([at(0, 100), at(10, 20_000)])


def test_a_ground_that_is_no_number_is_refused() -> None:
    with pytest.raises(Invalid, match="above its ground"):
        waypoints([at(0, 100)], ground=math.nan)
