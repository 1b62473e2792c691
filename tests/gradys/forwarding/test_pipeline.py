from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotDelivered, NotStored
from mavproxy_gradys.forwarding.pipeline import ReadingPipeline
from mavproxy_gradys.forwarding.readings import Reading
from mavproxy_gradys.forwarding.sinks import HttpSink
from mavproxy_gradys.forwarding.spool import Spool


@pytest.fixture
def pipeline(
    loop: Any, host: Any, telemetry: Any, poster: Any, at_once: Any, monkeypatch: Any
) -> Iterator[ReadingPipeline]:
    """Its only receiver is `poster`."""
    monkeypatch.setattr("mavproxy_gradys.forwarding.sender.make_sink", lambda sink, _: HttpSink(sink, poster))
    monkeypatch.setattr("mavproxy_gradys.forwarding.spool_thread.uptime", loop.time)
    poster.answer = poster.acknowledging
    made = ReadingPipeline(host)
    yield made
    loop.run(made.stop())


@pytest.fixture
def start(loop: Any, pipeline: ReadingPipeline, settings: Any) -> Callable[..., None]:
    """Starts it: `start(sink="http://a/r")`."""

    def begin(**given: Any) -> None:
        async def begun() -> None:
            pipeline.start(settings(**given))

        loop.run(begun())
        loop.settle()

    return begin


def values(poster: Any) -> list[Any]:
    return [reading["value"] for _, _, body in poster.posts for reading in json.loads(body)["readings"]]


def reading(value: Any) -> Reading:
    return Reading("uav-1", 1, "alt", "m", value, 0.0)


def test_a_position_that_is_reported_once_is_sampled_once(
    loop: Any, pipeline: Any, start: Any, telemetry: Any, poster: Any
) -> None:
    start(sink="http://a/r", quantities="position@0.1")
    for _ in range(3):
        telemetry.send_all()
        loop.pass_time(1)
    assert len(values(poster)) == 3
    assert "no new" in pipeline.report()["quantities"][0]["why_not"]["10"]


def test_readings_that_a_full_disk_does_not_take_outlast_a_setting(
    loop: Any, pipeline: Any, start: Any, telemetry: Any, poster: Any, monkeypatch: Any
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
    loop: Any, pipeline: Any, start: Any, poster: Any
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
    loop: Any, pipeline: Any, start: Any, poster: Any, monkeypatch: Any, tmp_path: Path
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
