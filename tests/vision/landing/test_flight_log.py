from __future__ import annotations

import cv2

from mavproxy_vision.landing.flight_log import SIDE, FlightLog
from tests.support.messages import message_of


def position(lat, lon, alt, ms):
    return message_of(
        "global_position_int", lat=round(lat * 1e7), lon=round(lon * 1e7), relative_alt=alt * 1000, time_boot_ms=ms
    )


def test_a_track_is_written_and_drawn(tmp_path):
    track = FlightLog(target=(-35.36319, 149.16518))
    for step in range(20):
        track.add(position(-35.363261 + 4e-6 * step, 149.165230 - 3e-6 * step, 5, 1000 + 200 * step))
    track.add(position(0, 0, 0, 500))  # out of order
    track.write(tmp_path / "track.csv")
    lines = (tmp_path / "track.csv").read_text().splitlines()
    assert lines[0] == "lat,lon,alt,time"
    assert len(lines) == 21
    assert lines[1] == "-35.3632610,149.1652300,5.000,1.000"
    track.plot(tmp_path / "track.png")
    assert cv2.imread(str(tmp_path / "track.png")).shape == (SIDE, SIDE, 3)
    assert FlightLog().drawn().min() == 255
