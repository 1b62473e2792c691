from __future__ import annotations

import contextlib
import resource
import xml.dom.minidom
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotStored
from mavproxy_gradys.tracks.formats import GPX_HEAD, GPX_TAIL, GpsReading, parse
from mavproxy_gradys.tracks.recorder import Recorder, append, replace
from mavproxy_uavapi.core.host import Host
from tests.gradys.conftest import AtOnce, TelemetrySource
from tests.support.virtual_time import FastLoop


@pytest.fixture(autouse=True)
def no_thread(monkeypatch: pytest.MonkeyPatch, at_once: type[AtOnce]) -> None:
    monkeypatch.setattr("mavproxy_gradys.tracks.recorder.ThreadPoolExecutor", at_once)


def sending(loop: FastLoop, telemetry: TelemetrySource, seconds: float) -> None:
    for _ in range(round(seconds * 4)):
        telemetry.send("gps_raw_int", time_usec=round(loop.time() * 1e6), lat=357713121, lon=-786743912, alt=584090)
        loop.pass_time(0.25)


def recorder(loop: FastLoop, host: Host, file: Path, style: str = "text", **options: Any) -> Recorder:
    recording = Recorder(host, 10, file, style=style, period=5.0, **options)
    loop.run(recording.start())
    return recording


@pytest.mark.parametrize("style", ["text", "tuple"])
def test_a_reading_every_period(
    loop: FastLoop, host: Host, telemetry: TelemetrySource, tmp_path: Path, style: str
) -> None:
    recording = recorder(loop, host, tmp_path / "track", style)
    sending(loop, telemetry, 21)
    loop.run(recording.stop())
    readings = parse((tmp_path / "track").read_text())
    assert recording.written == len(readings)
    assert [
        after.time_usec - before.time_usec for before, after in zip(readings[1:], readings[2:], strict=False)
    ] == [5_000_000] * 3


def test_gpx_is_whole_at_every_moment(loop: FastLoop, host: Host, telemetry: TelemetrySource, tmp_path: Path) -> None:
    recording = recorder(loop, host, tmp_path / "a.gpx", "gpx")
    for count in range(3):
        text = (tmp_path / "a.gpx").read_text()
        assert text.endswith("</gpx>\n") and text.count("<trkpt") >= count
        sending(loop, telemetry, 5)
    loop.run(recording.stop())


def test_the_latest_is_written_on_every_message(
    loop: FastLoop, host: Host, telemetry: TelemetrySource, tmp_path: Path
) -> None:
    latest = tmp_path / "latest"
    recording = recorder(loop, host, tmp_path / "track", latest=latest)
    texts = set()
    for _ in range(8):
        sending(loop, telemetry, 0.25)
        texts.add(latest.read_text())
    assert len(texts) == 8
    assert all(len(parse(text)) == 1 for text in texts)
    loop.run(recording.stop())
    assert host.listeners == []


def test_stopping_writes_what_was_heard_last(
    loop: FastLoop, host: Host, telemetry: TelemetrySource, tmp_path: Path
) -> None:
    latest = tmp_path / "latest"
    recording = recorder(loop, host, tmp_path / "track", latest=latest)
    sending(loop, telemetry, 1)
    for number in (7, 8):
        telemetry.send("gps_raw_int", time_usec=number, lat=357713121, lon=-786743912, alt=584090, fix_type=3)
    loop.run(recording.stop())
    loop.settle()
    assert parse(latest.read_text())[0].time_usec == 8


def test_defect_in_writing_the_latest_is_told_and_a_stop_ends_the_rest(
    loop: FastLoop, host: Host, telemetry: TelemetrySource, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = recorder(loop, host, tmp_path / "track", latest=tmp_path / "latest")
    monkeypatch.setattr("mavproxy_gradys.tracks.recorder.replace", None)
    telemetry.send("gps_raw_int", time_usec=7, lat=357713121, lon=-786743912, alt=584090, fix_type=3)
    loop.settle()
    assert [defect["message"] for defect in loop.defects] == [f"a defect ended the writing of {tmp_path}/latest"]
    loop.defects.clear()
    loop.run(recording.stop())
    assert host.listeners == []


def test_nothing_old_is_recorded(loop: FastLoop, host: Host, telemetry: TelemetrySource, tmp_path: Path) -> None:
    recording = recorder(loop, host, tmp_path / "track")
    sending(loop, telemetry, 6)
    written = recording.written
    loop.pass_time(30)
    assert recording.written <= written + 1
    assert "sends no GPS_RAW_INT" in recording.problem
    loop.run(recording.stop())


def test_a_file_that_cannot_be_written_is_reported_at_once(
    loop: FastLoop, host: Host, telemetry: TelemetrySource, tmp_path: Path
) -> None:
    with pytest.raises(NotStored, match="No such file or directory"):
        recorder(loop, host, tmp_path / "no" / "track")


def test_replacing_leaves_the_old_or_the_new(tmp_path: Path) -> None:
    file = tmp_path / "latest"
    replace(file, "one")
    replace(file, "two")
    assert file.read_text() == "two"
    assert [path.name for path in tmp_path.iterdir()] == ["latest"]


@contextlib.contextmanager
def disk_full_at(size: int) -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def placed(number: int) -> GpsReading:
    return GpsReading(number, 357713121, -786743912, 584090)


def test_a_track_is_readable_after_a_full_disk(tmp_path: Path) -> None:
    file = tmp_path / "track"
    file.touch()
    append(file, placed(1).line("text") + "\n", "")
    with disk_full_at(file.stat().st_size + 40), pytest.raises(OSError, match="File too large"):
        append(file, placed(2).line("text") + "\n", "")
    append(file, placed(3).line("text") + "\n", "")
    assert [reading.time_usec for reading in parse(file.read_text())] == [1, 3]


def test_a_gpx_track_is_whole_after_a_full_disk(tmp_path: Path) -> None:
    file = tmp_path / "track.gpx"
    file.write_text(GPX_HEAD + GPX_TAIL)
    append(file, placed(1).gpx(1.0), GPX_TAIL)
    with disk_full_at(file.stat().st_size + 20), pytest.raises(OSError, match="File too large"):
        append(file, placed(2).gpx(2.0), GPX_TAIL)
    append(file, placed(3).gpx(3.0), GPX_TAIL)
    assert len(xml.dom.minidom.parseString(file.read_text()).getElementsByTagName("trkpt")) == 2
