"""Logs as ArduPilot's SITL 4.7 and MAVProxy wrote them; of most messages only each 20th or so is left."""

from __future__ import annotations

import gc
import struct
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.flights.flight_export import table, texts, write_zip
from mavproxy_uavapi.flights.flight_file import attachments_of
from mavproxy_uavapi.flights.flight_import import take
from mavproxy_uavapi.flights.flight_store import COMPLETE, FlightStore

mavlink = mavutil.mavlink
NOW = 1_778_500_800.0  # s since 1970
CORPUS = Path(__file__).parents[2] / "corpus" / "flights"


@pytest.fixture
def store(tmp_path: Path) -> FlightStore:
    return FlightStore(tmp_path)


@pytest.mark.parametrize(
    ("name", "began", "mode", "highest", "text"),
    [
        ("arducopter-4.7.bin", "2026-11-26T06:26:24", "GUIDED", 5.0, "ArduCopter V4.7.0-dev"),
        ("arduplane-4.7.bin", "", "AUTO", 20.0, "ArduPlane V4.7.0-dev"),
        ("ardurover-4.7.bin", "2026-11-26T11:24:23", "GUIDED", 0.0, "ArduRover V4.7.0-dev"),
        ("mavproxy-1.8.tlog", "", "GUIDED", 5.0, ""),
        ("arduplane-4.7.tlog", "2026-11-26T11:23:12", "TAKEOFF", 20.0, ""),
        ("ardurover-4.7.tlog", "2026-11-26T11:23:59", "GUIDED", 0.0, ""),
    ],
)
def test_a_log_of_another_program_is_a_record_with_its_times(
    store: FlightStore, tmp_path: Path, name: str, began: str, mode: str, highest: float, text: str
) -> None:
    flight = take(store, CORPUS / name)
    assert (flight.state, flight.name, flight.vehicles) == (COMPLETE, Path(name).stem, (1,))
    assert flight.began.startswith(began) and flight.began < flight.ended
    rows = list(table(store.file(flight), 1, 1.0))
    assert mode in {row["mode"] for row in rows}
    assert max(row.get("relative_alt") or 0.0 for row in rows) > highest
    late = rows[-1]
    assert -90 < late["lat"] < 90 and late["battery_mv"] > 9000 and late["satellites"] >= 6
    assert any(one["text"].startswith(text) for one in texts(store.file(flight)))
    (parameters,) = attachments_of(store.file(flight))
    assert parameters.name == "parameters-1.param" and parameters.data.splitlines()
    assert flight.versions.get("vehicle-1", "").startswith(text) and "damaged" not in flight.notes
    write_zip(flight, store.file(flight), tmp_path / "it.zip", 5.0)
    with zipfile.ZipFile(tmp_path / "it.zip") as archive:
        assert archive.testzip() is None
        table_of = archive.read("vehicle1.csv").decode().splitlines()
        assert len(table_of) > 10 and table_of[0].startswith("time,seconds,vehicle,lat,lon,alt,relative_alt,")
        (track,) = ET.fromstring(archive.read("path.gpx")).iter("{http://www.topografix.com/GPX/1/1}trkseg")
        assert len(track) >= 5


LOGS = sorted(CORPUS.iterdir())


def damaged(data: bytes, how: str) -> bytes:
    """A log to which something has happened, in its middle."""
    middle = len(data) * 2 // 3
    if how == "cut":
        return data[:middle]
    if how == "garbage":
        return data[:middle] + bytes(range(256)) * 4 + data[middle:]
    if how == "zeros":
        return data[:middle] + bytes(600) + data[middle + 600 :]
    return data[:middle] + data[middle + 37 :]


@pytest.mark.parametrize("how", ["cut", "garbage", "zeros", "a part is missing"])
@pytest.mark.parametrize("log", LOGS, ids=[log.name for log in LOGS])
def test_a_damaged_log_is_read_as_far_as_it_goes(store: FlightStore, tmp_path: Path, log: Path, how: str) -> None:
    path = tmp_path / log.name
    path.write_bytes(damaged(log.read_bytes(), how))
    whole, flight = take(store, log), take(store, path)
    assert whole.messages * 0.4 < flight.messages <= whole.messages
    assert flight.began[:10] == whole.began[:10] and flight.ended <= whole.ended
    assert len(list(table(store.file(flight), 1, 1.0))) <= len(list(table(store.file(whole), 1, 1.0))) + 1
    if how in ("garbage", "zeros"):
        assert "damaged" in flight.notes


def test_a_message_that_pymavlink_fails_at_is_left_out(
    store: FlightStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, calls = tmp_path / "it.tlog", [0]
    path.write_bytes(tlog(*(NOW + second for second in range(20))))
    receive = mavutil.mavlogfile.recv_msg

    def fails_at_the_third(self: mavutil.mavlogfile) -> object:
        message, calls[0] = receive(self), calls[0] + 1
        if calls[0] == 3:
            raise AttributeError("'NoneType' object has no attribute '_instance_field'")
        return message

    whole = take(store, path)
    monkeypatch.setattr(mavutil.mavlogfile, "recv_msg", fails_at_the_third)
    flight = take(store, path)
    assert flight.messages == whole.messages - 3, "the first heartbeat, and the position before the second one"
    assert "damaged" in flight.notes


# pymavlink leaves the file open that it cannot read.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_log_whose_formats_are_damaged_is_refused_by_its_name(store: FlightStore, tmp_path: Path) -> None:
    path, data = tmp_path / "it.bin", (CORPUS / "ardurover-4.7.bin").read_bytes()
    at = data.index(b"POS\0") + 4  # the letters of its types
    path.write_bytes(data[:at] + b"\\" + data[at + 1 :])
    with pytest.raises(BadRequest, match=r"it\.bin"):
        take(store, path)
    gc.collect()
    assert store.all() == []


def test_a_log_without_satellites_counts_from_its_start_and_says_so(store: FlightStore, tmp_path: Path) -> None:
    path, data = tmp_path / "indoors.bin", (CORPUS / "ardurover-4.7.bin").read_bytes()
    path.write_bytes(data.replace(b"GPS\0", b"GSX\0"))
    flight = take(store, path)
    assert flight.began.startswith("1970-01-01") and "never set" in flight.notes
    rows = list(table(store.file(flight), 1, 1.0))
    assert 5 < len(rows) < 60 and rows[-1]["lat"] is not None


def tlog(*times: float) -> bytes:
    """Heartbeats and positions at these times, s since 1970."""
    encoder, log = mavlink.MAVLink(None, 1, 1), b""
    for at in times:
        for message in (
            mavlink.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3),
            mavlink.MAVLink_global_position_int_message(0, -353632621, 1491652374, 594_000, 10_000, 0, 0, 0, 9000),
        ):
            log += struct.pack(">Q", round(at * 1e6)) + message.pack(encoder)
    return log


@pytest.mark.parametrize(
    ("times", "rows"),
    [
        ([float(second) for second in range(20)], 19),  # a clock that was never set
        ([*map(float, range(10)), *(NOW + second for second in range(10))], 18),  # set in flight
        ([*(NOW + second for second in range(10)), *map(float, range(10))], 18),
        ([*(NOW + second for second in range(10)), 1e13, NOW + 10.0], 10),  # one that cannot be
    ],
)
def test_a_clock_that_is_wrong_or_set_in_flight_makes_no_table_of_years(
    store: FlightStore, tmp_path: Path, times: list[float], rows: int
) -> None:
    path = tmp_path / "it.tlog"
    path.write_bytes(tlog(*times))
    flight = take(store, path)
    assert len(list(table(store.file(flight), 1, 1.0))) == rows
    assert ("damaged" in flight.notes) == (max(times) > 1e12)


def test_a_rate_below_one_row_in_the_longest_gap_has_rows(store: FlightStore) -> None:
    flight = take(store, CORPUS / "arducopter-4.7.bin")
    assert len(list(table(store.file(flight), 1, 0.1))) >= 2


@pytest.mark.parametrize("data", [b"", b"\xa3\x95", b"no log at all" * 100])
@pytest.mark.parametrize("suffix", [".tlog", ".bin"])
def test_what_is_no_log_is_refused(store: FlightStore, tmp_path: Path, data: bytes, suffix: str) -> None:
    path = tmp_path / f"it{suffix}"
    path.write_bytes(data)
    with pytest.raises(BadRequest):
        take(store, path)
    assert store.all() == []
