from __future__ import annotations

import logging
from typing import Any

import pytest

from mavproxy_gradys.errors import NoReading
from mavproxy_gradys.forwarding.quantities import LONGEST_TEXT, parse_quantity
from mavproxy_gradys.forwarding.sensor import SensorFiles, SensorSampler, value_of
from mavproxy_gradys.forwarding.sensor_command import SensorCommand
from mavproxy_gradys.forwarding.sensor_file import Measured, SensorFile
from mavproxy_gradys.net.outage_log import CAUSE_EVERY
from tests.support.virtual_time import FastLoop

SOIL = parse_quantity("soil=file:/run/soil.txt@5[percent]")
RAW = parse_quantity("gps=file:/tmp/gps_data@5[raw]")
# A line of the file that CentMesh's first program writes.
GPS = (
    "GPS_RAW_INT {time_usec : 251908000, fix_type : 3, lat : 357713121, lon : -786743912, alt : 584090, eph : 0,"
    " epv : 65535, vel : 0, cog : 0, satellites_visible : 10}"
)


class Script:
    """A source that gives what a test lists: contents, None, or errors."""

    def __init__(self, *contents: Any) -> None:
        self.contents = list(contents)

    async def read(self) -> Measured | None:
        content = self.contents.pop(0)
        if isinstance(content, Exception):
            raise content
        return None if content is None else Measured(content, 5.0)

    async def close(self) -> None: ...


@pytest.mark.parametrize(
    ("text", "value"),
    [("23.5\n", 23.5), (" 7 ", 7), ("-1e3", -1000.0), ("+4", 4), (".5", 0.5), (str(2**63 - 1), 2**63 - 1)],
)
def test_a_number(text: str, value: float) -> None:
    number = value_of(SOIL, text.encode())
    assert number == value and type(number) is type(value)


def test_a_scaled_number() -> None:
    assert value_of(parse_quantity("t=file:/t*0.001+1[degC]"), b"48123\n") == 49.123


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b" \n",
        b"23.5 %",
        b"nan",
        b"inf",
        b"1_000",
        b"0x10",
        b"1e400",
        b"\xff",
        b"1 2",
        str(2**63).encode(),
        b"1\0",
    ],
)
def test_what_is_no_number(content: bytes) -> None:
    with pytest.raises(NoReading):
        value_of(SOIL, content)


def test_a_text_that_is_asked_for() -> None:
    assert value_of(RAW, f"\n{GPS}\n".encode()) == GPS
    assert value_of(RAW, "21,5 °C\n2nd line".encode()) == "21,5 °C\n2nd line"
    assert value_of(RAW, b"12") == "12"


@pytest.mark.parametrize("content", [b"", b"a\0b", b"\x1b[31m", b"\xff", b"x" * (LONGEST_TEXT + 1)])
def test_a_text_that_no_receiver_takes(content: bytes) -> None:
    with pytest.raises(NoReading):
        value_of(RAW, content)


def test_a_reading_belongs_to_the_vehicle(loop: FastLoop) -> None:
    sampler = SensorSampler(SOIL, Script(b"23.5", None, b"24"), loop.time)
    reading = loop.run(sampler.sample(10))
    assert (reading.device, reading.system, reading.quantity) == ("uav-10", 10, "soil")
    assert (reading.value, reading.representation, reading.time) == (23.5, "percent", 5.0)
    assert loop.run(sampler.sample(10)) is None
    assert (sampler.problem, sampler.taken) == ("nothing new was written", 1)
    assert loop.run(sampler.sample(10)).value == 24
    assert (sampler.problem, sampler.taken) == ("", 2)


def test_without_a_vehicle_nothing_is_read(loop: FastLoop) -> None:
    sampler = SensorSampler(SOIL, Script(b"23.5"), loop.time)
    assert loop.run(sampler.sample(0)) is None
    assert sampler.problem == "no vehicle was heard yet"
    assert loop.run(sampler.sample(10)).value == 23.5


def test_one_line_for_each_cause(loop: FastLoop, caplog: pytest.LogCaptureFixture) -> None:
    old = [NoReading("stale", f"/run/soil.txt was written {age} s ago") for age in range(50)]
    sampler = SensorSampler(SOIL, Script(*old, b"", b"", b"23.5", b"24"), loop.time)
    with caplog.at_level(logging.INFO, "gradys.sensor"):
        for _ in range(54):
            loop.run(sampler.sample(10))
            loop.now += CAUSE_EVERY / 10
    assert caplog.messages == [
        "no reading of soil: /run/soil.txt was written 0 s ago",
        "no reading of soil: the content is empty",
        "soil is read again",
    ]
    assert sampler.problem == ""


def test_a_bad_value_stays_bad_until_something_new_is_written(
    loop: FastLoop, caplog: pytest.LogCaptureFixture
) -> None:
    sampler = SensorSampler(SOIL, Script(b"broken", None, None, b"24", None), loop.time)
    with caplog.at_level(logging.INFO, "gradys.sensor"):
        for _ in range(3):
            assert loop.run(sampler.sample(10)) is None
            assert sampler.problem == "'broken' is not a number"
        assert loop.run(sampler.sample(10)).value == 24
        assert loop.run(sampler.sample(10)) is None
    assert sampler.problem == "nothing new was written"
    assert caplog.messages == ["no reading of soil: 'broken' is not a number", "soil is read again"]


def test_a_file_that_answers_again_is_read_again(loop: FastLoop, caplog: pytest.LogCaptureFixture) -> None:
    sampler = SensorSampler(SOIL, Script(b"23", NoReading("slow", "it does not answer"), None), loop.time)
    with caplog.at_level(logging.INFO, "gradys.sensor"):
        for _ in range(3):
            loop.run(sampler.sample(10))
    assert sampler.problem == "nothing new was written"
    assert caplog.messages == ["no reading of soil: it does not answer", "soil is read again"]


def test_a_cause_that_comes_and_goes_is_logged_now_and_then(loop: FastLoop, caplog: pytest.LogCaptureFixture) -> None:
    contents = [b"", b"1"] * 100
    sampler = SensorSampler(SOIL, Script(*contents), loop.time)
    with caplog.at_level(logging.INFO, "gradys.sensor"):
        for _ in contents:
            loop.run(sampler.sample(10))
            loop.now += CAUSE_EVERY / 80
    assert caplog.messages == ["no reading of soil: the content is empty", "soil is read again"] * 3


def test_a_file_may_be_as_old_as_two_periods(loop: FastLoop) -> None:
    files = SensorFiles(loop.time)
    source = files.source_of(SOIL, 5.0)
    assert isinstance(source, SensorFile) and source.longest == 10.0
    source = files.source_of(SOIL, 60.0)
    assert isinstance(source, SensorFile) and source.longest == 60.0
    assert isinstance(files.source_of(parse_quantity("a=exec:x"), 5.0), SensorCommand)
