from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys import console
from mavproxy_gradys.errors import NotDelivered, NotStored
from mavproxy_gradys.forwarding.pipeline import ReadingPipeline
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.sensor_command import SensorCommand
from mavproxy_gradys.forwarding.sinks import HttpSink
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_thread import SpoolThread
from mavproxy_gradys.settings import GradysSettings
from mavproxy_uavapi.core.host import Host
from tests.gradys.conftest import AtOnce, FakePoster, TelemetrySource
from tests.support.virtual_time import FastLoop


@pytest.fixture
def pipeline(
    loop: FastLoop,
    host: Host,
    telemetry: TelemetrySource,
    poster: FakePoster,
    at_once: type[AtOnce],
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[ReadingPipeline]:
    """Its only receiver is `poster`."""
    monkeypatch.setattr("mavproxy_gradys.forwarding.sender.make_sink", lambda sink, _: HttpSink(sink, poster))
    monkeypatch.setattr("mavproxy_gradys.forwarding.spool_thread.uptime", loop.time)
    poster.answer = poster.acknowledging
    made = ReadingPipeline(host)
    yield made
    loop.run(made.stop())


@pytest.fixture
def start(loop: FastLoop, pipeline: ReadingPipeline, settings: Callable[..., GradysSettings]) -> Callable[..., None]:
    """Starts it: `start(sink="http://a/r")`."""

    def begin(**values: Any) -> None:
        async def begun() -> None:
            pipeline.start(settings(**values))

        loop.run(begun())
        loop.settle()

    return begin


def values(poster: FakePoster) -> list[Any]:
    return [reading["value"] for _, _, body in poster.posts for reading in json.loads(body)["readings"]]


def reading(value: Any) -> Reading:
    return Reading("uav-1", 1, "alt", "m", value, 0.0)


def test_a_position_that_is_reported_once_is_sampled_once(
    loop: FastLoop,
    pipeline: ReadingPipeline,
    start: Callable[..., None],
    telemetry: TelemetrySource,
    poster: FakePoster,
) -> None:
    start(sink="http://a/r", quantities="position@0.1")
    for _ in range(3):
        telemetry.send_all()
        loop.pass_time(1)
    assert len(values(poster)) == 3
    assert "no new" in pipeline.report()["quantities"][0]["why_not"]["10"]


def test_device_names_begin_as_the_setting_says(
    loop: FastLoop, start: Callable[..., None], telemetry: TelemetrySource, poster: FakePoster, tmp_path: Path
) -> None:
    soil = tmp_path / "soil.txt"
    soil.write_text("23.5")
    start(sink="http://a/r", device="north-field", quantities=f"alt=VFR_HUD.alt soil=file:{soil}@1")
    telemetry.send_all()
    loop.pass_time(3)
    readings = [reading for _, _, body in poster.posts for reading in json.loads(body)["readings"]]
    assert {(reading["device"], reading["id"]) for reading in readings} == {("north-field-10", "10")}
    assert {reading["quantity"] for reading in readings} == {"alt", "soil"}


def test_a_sensor_is_read_for_the_current_vehicle(
    loop: FastLoop,
    pipeline: ReadingPipeline,
    start: Callable[..., None],
    host: Host,
    poster: FakePoster,
    tmp_path: Path,
) -> None:
    soil = tmp_path / "soil.txt"
    soil.write_text("23.5")
    start(sink="http://a/r", quantities=f"soil=file:{soil}@5[percent] absent=file:{tmp_path}/absent")
    loop.pass_time(11)
    (reading,) = (reading for _, _, body in poster.posts for reading in json.loads(body)["readings"])
    assert (reading["device"], reading["quantity"], reading["value"]) == ("uav-10", "soil", 23.5)
    assert reading["time"] == pytest.approx(soil.stat().st_mtime, abs=0.001)
    soil_report, absent_report = pipeline.report()["quantities"]
    assert soil_report["taken"] == 1 and soil_report["problem"] == "nothing new was written"
    assert absent_report["taken"] == 0 and "No such file" in absent_report["problem"]
    lines = console.readings_lines(pipeline.report())
    assert "  soil every 5 s: 1 taken (nothing new was written)" in lines
    soil.write_text("24")
    loop.pass_time(5)
    assert values(poster)[-1] == 24


@pytest.mark.parametrize("change", [{"period": "2"}, {"quantities": "again"}])
def test_a_new_setting_samples_nothing_a_second_time(
    loop: FastLoop,
    pipeline: ReadingPipeline,
    start: Callable[..., None],
    telemetry: TelemetrySource,
    poster: FakePoster,
    tmp_path: Path,
    change: dict[str, str],
) -> None:
    soil, taken = tmp_path / "soil.txt", f"soil=file:{tmp_path}/soil.txt@1 alt=VFR_HUD.alt@1"
    soil.write_text("23.5")
    telemetry.send_all()
    for period in range(5):
        after = {"quantities": f"soil=file:{soil}@{period + 1} alt=VFR_HUD.alt@{period + 1}"}
        start(sink="http://a/r", **{"quantities": taken, **(after if "quantities" in change else change)})
        loop.pass_time(0.9)
        loop.run(pipeline.stop())
    quantities = [reading["quantity"] for _, _, body in poster.posts for reading in json.loads(body)["readings"]]
    assert sorted(quantities) == ["alt", "soil"]


def test_without_a_vehicle_a_sensor_gives_nothing(
    loop: FastLoop,
    pipeline: ReadingPipeline,
    start: Callable[..., None],
    host: Host,
    poster: FakePoster,
    tmp_path: Path,
) -> None:
    host.fleet.vehicles.clear()
    (tmp_path / "soil.txt").write_text("23.5")
    start(sink="http://a/r", quantities=f"soil=file:{tmp_path}/soil.txt")
    loop.pass_time(2)
    assert values(poster) == []
    assert pipeline.report()["quantities"][0]["problem"] == "no vehicle was heard yet"


def test_a_stop_ends_commands_before_it_waits_for_the_disk(
    loop: FastLoop,
    pipeline: ReadingPipeline,
    start: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    events: list[str] = []

    async def run(self: Any) -> Any:
        try:
            await asyncio.sleep(3600)
        finally:
            events.append("killed")

    async def save(self: Any) -> None:
        events.append("saved")

    monkeypatch.setattr(SensorCommand, "read", run)
    monkeypatch.setattr(SpoolThread, "save", save)
    ini = tmp_path / "uav.ini"
    ini.write_text('[gradys]\nquantities = hum=exec:"read-humidity --bus 1"@5[percent]\n')
    start(sink="http://a/r", config=str(ini))
    loop.pass_time(1)
    loop.run(pipeline.stop())
    assert events[:2] == ["killed", "saved"]


def test_readings_that_a_full_disk_does_not_take_outlast_a_setting(
    loop: FastLoop,
    pipeline: ReadingPipeline,
    start: Callable[..., None],
    telemetry: TelemetrySource,
    poster: FakePoster,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(*_: Any) -> None:
        raise NotStored("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(Spool, "append", full)
        start(sink="http://a/r", quantities="position@1")
        telemetry.send_all()
        loop.pass_time(2)
        loop.run(pipeline.stop())
        assert pipeline.report()["spooled"] == 1
        start(sink="http://b/r", quantities="")
        loop.pass_time(2)
        loop.run(pipeline.stop())
    start()
    loop.pass_time(1)
    assert pipeline.report()["spooled"] == 1 and poster.posts == []
    loop.run(pipeline.stop())
    start(sink="http://a/r", quantities="")
    loop.pass_time(1)
    assert len(values(poster)) == 1


def test_what_is_posted_while_it_restarts_is_kept_or_refused(
    loop: FastLoop, pipeline: ReadingPipeline, start: Callable[..., None], poster: FakePoster
) -> None:
    start()

    async def posted() -> list[int]:
        numbers: list[int] = await pipeline.keep([reading(1)])
        return numbers

    posting = loop.create_task(posted())
    loop.run(pipeline.stop())
    start(sink="http://a/r", quantities="")
    loop.pass_time(2)
    kept = posting.exception() is None
    assert values(poster) == ([1] if kept else [])
    assert pipeline.report()["spool"]["problem"] is None  # one thread, and it has the file
    with pytest.raises(NotStored, match="stopped"):
        loop.run(pipeline.stop())
        loop.run(pipeline.keep([reading(2)]))


class Nobody:
    """A broker that takes nothing."""

    async def send(self, batch: Any) -> set[int]:
        raise NotDelivered("nobody is there")

    async def close(self) -> None: ...


def test_no_password_gets_into_the_file(
    loop: FastLoop,
    pipeline: ReadingPipeline,
    start: Callable[..., None],
    poster: FakePoster,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    def make_sink(sink: Any, _: Any) -> Any:
        return Nobody() if sink.url.startswith("mqtt") else HttpSink(sink, poster)

    monkeypatch.setattr("mavproxy_gradys.forwarding.sender.make_sink", make_sink)
    start(sink="http://me:s3cret@a/r?key=s3cret,mqtt://uav:s3cret@broker/x", quantities="")
    loop.run(pipeline.keep([reading(n) for n in range(100)]))
    loop.pass_time(1)
    assert pipeline.report()["spooled"] == 100 and len(poster.posts) == 1
    loop.run(pipeline.stop())
    content = b"".join(file.read_bytes() for file in tmp_path.iterdir())
    assert b"acknowledged" in content and b"s3cret" not in content


def test_sampling_goes_on_while_a_stop_waits_for_the_disk(
    loop: FastLoop,
    pipeline: ReadingPipeline,
    start: Callable[..., None],
    telemetry: TelemetrySource,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    save = SpoolThread.save

    async def slow(self: Any) -> None:
        await asyncio.sleep(2)
        await save(self)

    monkeypatch.setattr(SpoolThread, "save", slow)
    start(sink="http://a/r", quantities="position@0.5")
    loop.pass_time(1)
    stopping = loop.create_task(pipeline.stop())
    for _ in range(3):
        telemetry.send_all()
        loop.pass_time(0.5)
    loop.run(stopping)  # the loop's end asserts that there was no defect


def test_readings_are_told_to_who_records_a_flight(
    loop: FastLoop, pipeline: ReadingPipeline, start: Callable[..., None], telemetry: TelemetrySource, host: Host
) -> None:
    told: list[Any] = []

    def observe(name: str, system: int, _ago: float, info: Any) -> None:
        if name == "readings":
            told.append((system, info["readings"]))

    host.observers.append(observe)
    start(sink="http://a/r", quantities="alt=VFR_HUD.alt@1[m]")
    telemetry.send_all()
    loop.pass_time(1.5)
    ((system, (one,)),) = told
    assert (system, one["device"], one["quantity"], one["representation"]) == (10, "uav-10", "alt", "m")
    posted = [Reading("soil-7", 0, "ph", "", value, 5.0) for value in (6.5, 6.6)]
    loop.run(pipeline.keep(posted))
    assert told[-1] == (0, [one.report() for one in posted])
