from __future__ import annotations

import io
from typing import Any

import pytest
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base

from mavproxy_uavapi.core.geotag import Geotag, geotag_of, tagged
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from tests.support.messages import message_of

NOON = 1_778_500_800.25  # s since 1970: 2026-05-11T12:00:00.25Z
HERE = Geotag(NOON, -35.3632621, 149.1652374, 594.125, 10.5, 271.25)


def jpeg(**save: Any) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (16, 8), (10, 200, 30)).save(file, "JPEG", **save)
    return file.getvalue()


def camera_exif(order: bytes) -> bytes:
    """What a camera writes: its maker, an exposure, an own time and a place of its own."""
    exif = Image.Exif()
    exif.endian = ">" if order == b"MM" else "<"
    exif[Base.Make] = "Raspberry Pi"
    exif.get_ifd(IFD.Exif).update({Base.ExposureTime: 0.004, Base.DateTimeOriginal: "2001:01:01 00:00:00"})
    exif.get_ifd(IFD.GPSInfo).update({GPS.GPSLatitude: (1.0, 2.0, 3.0), GPS.GPSLatitudeRef: "N"})
    return exif.tobytes()


def degrees(gps: Any, tag: int) -> float:
    d, m, s = map(float, gps[tag])
    return (d + m / 60 + s / 3600) * (-1 if gps[tag - 1] in "SW" else 1)


def seen(data: bytes) -> tuple[Any, Any, Any]:
    """The picture's directories, as another library reads them: the first, EXIF's, the place's."""
    with Image.open(io.BytesIO(data)) as image:
        image.load()
        exif = image.getexif()
        return exif, exif.get_ifd(IFD.Exif), exif.get_ifd(IFD.GPSInfo)


def test_a_picture_tells_where_when_and_whither() -> None:
    original = jpeg()
    data = tagged(original, HERE)
    _, exif, gps = seen(data)
    assert degrees(gps, GPS.GPSLatitude) == pytest.approx(HERE.lat, abs=1e-8)
    assert degrees(gps, GPS.GPSLongitude) == pytest.approx(HERE.lon, abs=1e-8)
    assert (float(gps[GPS.GPSAltitude]), gps[GPS.GPSAltitudeRef]) == (594.125, b"\0")
    assert (float(gps[GPS.GPSImgDirection]), gps[GPS.GPSImgDirectionRef]) == (271.25, "T")
    assert gps[GPS.GPSDateStamp] == "2026:05:11" and tuple(map(float, gps[GPS.GPSTimeStamp])) == (12.0, 0.0, 0.25)
    assert exif[Base.DateTimeOriginal] == "2026:05:11 12:00:00" and exif[Base.OffsetTimeOriginal] == "+00:00"
    assert exif[Base.SubsecTimeOriginal] == "250"
    assert data.endswith(original[original.index(b"\xff\xdb") :]), "the picture itself is the same"


@pytest.mark.parametrize("order", [b"II", b"MM"])
def test_what_the_camera_wrote_stays_and_the_place_is_ours(order: bytes) -> None:
    data = tagged(jpeg(exif=camera_exif(order)), HERE)
    first, exif, gps = seen(data)
    assert first[Base.Make] == "Raspberry Pi"
    assert float(exif[Base.ExposureTime]) == 0.004 and exif[Base.DateTimeOriginal] == "2001:01:01 00:00:00"
    assert degrees(gps, GPS.GPSLatitude) == pytest.approx(HERE.lat, abs=1e-8)
    assert data.count(b"Exif\0\0") == 1
    assert degrees(seen(tagged(data, Geotag(NOON, 1.5, -2.5)))[2], GPS.GPSLongitude) == pytest.approx(-2.5)


def test_where_nothing_is_known_only_the_time_is_told() -> None:
    _, exif, gps = seen(tagged(jpeg(), Geotag(NOON)))
    assert GPS.GPSLatitude not in gps and GPS.GPSAltitude not in gps and GPS.GPSImgDirection not in gps
    assert gps[GPS.GPSDateStamp] == "2026:05:11" and Base.DateTimeOriginal in exif


def test_below_the_sea_is_told() -> None:
    gps = seen(tagged(jpeg(), Geotag(NOON, 31.5, 35.5, -430.5)))[2]
    assert (float(gps[GPS.GPSAltitude]), gps[GPS.GPSAltitudeRef]) == (430.5, b"\1")


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x89PNG\r\n\x1a\n",
        b"\xff\xd8\xff\xe1\x00\x08Exif\0\0",
        b"\xff\xd8\xff\xe1\x00\x20Exif\0\0XX" + bytes(40),
        b"\xff\xd8\xff\xe1\x00\x14Exif\0\0II*\0\xff\xff\xff\xff\0\0",
        jpeg(exif=camera_exif(b"II"))[:60],
    ],
)
def test_what_is_no_picture_or_is_torn_does_no_harm(data: bytes) -> None:
    result = tagged(data, HERE)
    assert result == data or result.startswith(b"\xff\xd8\xff\xe1")


def test_exif_that_has_no_room_left_stays_as_it_is() -> None:
    exif = Image.Exif()
    exif[Base.ImageDescription] = "x" * 65_400
    data = jpeg(exif=exif.tobytes())
    assert tagged(data, HERE) == data


def test_the_place_is_where_the_vehicle_was_when_the_picture_was_taken() -> None:
    state = VehicleState(1, 1, 2, 0.0)
    assert geotag_of(state, 10.0, NOON) == Geotag(NOON)
    moving = {"lat": -353632621, "lon": 1491652374, "alt": 594_000, "relative_alt": 10_000, "hdg": 9000}
    state.update(message_of("global_position_int", vx=1000, vy=0, vz=-200, **moving), 10.0)
    before, after = geotag_of(state, 9.5, NOON), geotag_of(state, 10.5, NOON)
    assert after.lat is not None and before.lat is not None
    assert (after.lat - before.lat) * 111_318 == pytest.approx(10.0, abs=0.1) and after.lon == pytest.approx(
        149.1652374
    )
    assert (before.alt, after.alt, after.relative_alt, after.heading) == (593.0, 595.0, 11.0, 90.0)
    assert geotag_of(state, 20.0, NOON).lat is None, "ten seconds later it may be anywhere"
    state.update(message_of("global_position_int", lat=0, lon=0), 20.0)
    assert geotag_of(state, 20.0, NOON).lat is None
