from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding.readings import Reading, Stored
from mavproxy_gradys.forwarding.sender import BATCH, Sender
from mavproxy_gradys.forwarding.sink_address import sink_address
from mavproxy_gradys.forwarding.sinks import HttpSink, acknowledged
from mavproxy_gradys.forwarding.spool import Spool
from mavproxy_gradys.forwarding.spool_thread import SpoolThread
from mavproxy_gradys.net.http_client import refusal
from mavproxy_gradys.settings import GradysSettings
from tests.gradys.conftest import FakePoster
from tests.support.virtual_time import FastLoop

SINK = sink_address("http://a/readings")


@pytest.fixture
def spool_thread(loop: FastLoop, tmp_path: Path, at_once: None) -> Iterator[SpoolThread]:
    spool_thread = SpoolThread(lambda: Spool(tmp_path / "spool.db", 1e9, 1e9, clock=loop.time), loop.time)

    async def started() -> None:
        spool_thread.start([SINK.name])

    loop.run(started())
    yield spool_thread
    loop.run(spool_thread.stop())


@pytest.fixture
def sender(
    loop: FastLoop,
    spool_thread: SpoolThread,
    poster: FakePoster,
    settings: Callable[..., GradysSettings],
    monkeypatch: pytest.MonkeyPatch,
) -> Sender:
    """Sends to `poster` from now on."""
    poster.answer = poster.acknowledging
    monkeypatch.setattr("mavproxy_gradys.forwarding.sender.make_sink", lambda sink, _: HttpSink(sink, poster))
    sender = Sender(SINK, spool_thread, loop.time, lambda: 0.0)
    loop.create_task(sender.run(settings()))
    return sender


def keep(loop: FastLoop, spool_thread: SpoolThread, count: int) -> list[int]:
    kept: list[int] = loop.run(
        spool_thread.keep([Reading("uav-1", 1, "alt", "m", float(n), 5.0) for n in range(count)])
    )
    return kept


def test_readings_go_out_at_once_and_leave_the_spool(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster
) -> None:
    kept = keep(loop, spool_thread, 3)
    loop.pass_time(0.1)
    assert poster.batches == [kept]
    assert (spool_thread.count, sender.acknowledged) == (0, 3)
    first = json.loads(poster.posts[0][2])["readings"][0]
    named = {"quantity": "alt", "representation": "m", "value": 0.0, "time": 5.0}
    assert first == {"device": "uav-1", "id": "1", "seq": kept[0], **named}


def test_many_go_in_batches_in_order(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster
) -> None:
    kept = keep(loop, spool_thread, 2 * BATCH + 5)
    loop.pass_time(1)
    assert [len(batch) for batch in poster.batches] == [BATCH, BATCH, 5]
    assert sum(poster.batches, []) == kept


def test_what_is_not_acknowledged_is_sent_again(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster
) -> None:
    poster.answer = lambda body: {"acknowledged": [reading["seq"] for reading in json.loads(body)["readings"]][::2]}
    kept = keep(loop, spool_thread, 5)
    loop.pass_time(1)
    assert poster.batches == [kept, [kept[1], kept[3]], [kept[3]]]
    assert spool_thread.count == 0


@pytest.mark.parametrize("answer", [None, "OK", {}, {"status": "ok"}, [1, 2, 3], {"Acknowledged": [1]}])
def test_a_200_that_names_no_numbers_acknowledges_nothing(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster, answer: Any
) -> None:
    answers, poster.answer = poster.answer, answer  # None: a captive portal's login page
    kept = keep(loop, spool_thread, 5)
    loop.pass_time(100)
    assert spool_thread.count == 5 and "names no numbers" in sender.last_error
    assert {len(batch) for batch in poster.batches} == {5}  # it is nobody's fault but the answer's
    poster.answer = answers
    loop.pass_time(30)
    assert spool_thread.count == 0 and poster.batches[-1] == kept


def test_a_receiver_that_is_down_gets_them_in_order_when_it_is_back(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster, down: NotDelivered
) -> None:
    answers, poster.answer = poster.answer, down
    kept = []
    for _ in range(60):
        kept += keep(loop, spool_thread, 11)
        loop.pass_time(10)
    assert len(poster.posts) < 40
    assert sender.last_error == "cannot connect"
    poster.answer = answers
    poster.posts.clear()
    loop.pass_time(30)
    assert sum(poster.batches, []) == kept
    assert (spool_thread.count, sender.last_error) == (0, "")


def test_flush_does_not_wait_for_the_pause(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster, down: NotDelivered
) -> None:
    poster.answer = down
    keep(loop, spool_thread, 1)
    loop.pass_time(20)
    before = len(poster.posts)
    sender.flush()
    loop.settle()
    assert len(poster.posts) == before + 1


def test_a_receiver_that_acknowledges_nothing_is_not_tried_again_at_once(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster
) -> None:
    poster.answer = {"acknowledged": []}
    keep(loop, spool_thread, 1)
    loop.pass_time(20)
    assert len(poster.posts) == 5
    assert spool_thread.count == 1 and "acknowledges nothing" in sender.last_error


def refusing(poster: FakePoster, refuses: Any, **attributes: Any) -> None:
    """Have it refuse the batches for which that holds, of their values."""
    answers, refusal = (
        poster.answer,
        NotDelivered("it answers 400", reached=True, **{"for_content": True, **attributes}),
    )
    poster.answer = lambda body: refusal if refuses(values(body)) else answers(body)


def values(body: bytes) -> list[float]:
    return [reading["value"] for reading in json.loads(body)["readings"]]


def test_batches_that_are_too_large_get_smaller_and_stay_so(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster
) -> None:
    refusing(poster, lambda batch: len(batch) > 60, too_large=True)
    keep(loop, spool_thread, 1000)
    loop.pass_time(20)
    assert spool_thread.count == 0
    sizes = [len(batch) for batch in poster.batches]
    assert sizes == [200, 100] + [50] * 20  # refused twice, and never tried again


def test_one_that_is_refused_by_itself_holds_up_nobody_and_is_sent_last(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster
) -> None:
    answers = poster.answer
    refusing(poster, lambda batch: 150.0 in batch)
    keep(loop, spool_thread, 300)
    loop.pass_time(20)
    assert spool_thread.count == 1 and sender.report()["put_last"] >= 1
    keep(loop, spool_thread, 3)
    loop.pass_time(40)
    assert spool_thread.count == 1 and values(poster.posts[-1][2]) == [150.0]  # it is still tried, alone
    poster.answer = answers
    loop.pass_time(30)
    assert spool_thread.count == 0


def test_those_that_are_sent_last_take_turns(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster
) -> None:
    refused = {3.0, 7.0}
    refusing(poster, lambda batch: refused & set(batch))
    keep(loop, spool_thread, 10)
    loop.pass_time(60)
    assert spool_thread.count == 2
    refused.remove(7.0)
    loop.pass_time(60)
    assert spool_thread.count == 1


@pytest.mark.parametrize("status", [301, 401, 403, 404, 429, 503])
def test_a_receiver_that_is_not_ready_is_offered_the_same_again(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster, status: int
) -> None:
    answers, poster.answer = poster.answer, refusal(status, "")
    kept = keep(loop, spool_thread, 300)
    loop.pass_time(100)
    assert {len(batch) for batch in poster.batches} == {BATCH}
    poster.answer = answers
    loop.pass_time(30)
    assert sum(poster.batches[-2:], []) == kept


def test_a_defect_is_reported_once_and_does_not_end_the_delivery(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster
) -> None:
    answers, poster.answer = poster.answer, RecursionError("too deep")
    keep(loop, spool_thread, 2)
    loop.pass_time(60)
    assert [str(defect["exception"]) for defect in loop.defects] == ["too deep"]
    assert "too deep" in sender.last_error
    loop.defects.clear()
    poster.answer = answers
    loop.pass_time(30)
    assert (spool_thread.count, sender.last_error) == (0, "")


def test_the_log_reports_an_outage_once(
    loop: FastLoop,
    spool_thread: SpoolThread,
    sender: Sender,
    poster: FakePoster,
    down: NotDelivered,
    caplog: pytest.LogCaptureFixture,
) -> None:
    answers, poster.answer = poster.answer, down
    keep(loop, spool_thread, 1)
    loop.pass_time(100)
    poster.answer = answers
    loop.pass_time(30)
    assert [(record.name, record.message) for record in caplog.records] == [
        ("gradys.delivery", f"{SINK} takes no readings: cannot connect"),
        ("gradys.delivery", f"{SINK} takes readings again"),
    ]


def test_after_a_receivers_return_nobody_waits_longer_than_documented(
    loop: FastLoop, spool_thread: SpoolThread, sender: Sender, poster: FakePoster, down: NotDelivered
) -> None:
    poster.answer = down
    keep(loop, spool_thread, 1)
    loop.pass_time(300)
    gaps = [after - before for before, after in zip(poster.times, poster.times[1:], strict=False)]
    assert max(gaps) == pytest.approx(20.0)


@pytest.mark.parametrize("numbers", ["all", [1, "2"], [True], {"1": 2}, None])
def test_acknowledgement_that_is_no_list_of_numbers_counts_for_nothing(numbers: Any) -> None:
    with pytest.raises(NotDelivered):
        acknowledged({"acknowledged": numbers}, {1, 2})


def test_numbers_that_were_not_sent_are_not_acknowledged() -> None:
    assert acknowledged({"acknowledged": [1, 99]}, {1, 2}) == {1}


def test_with_the_option_a_200_acknowledges_and_numbers_still_count() -> None:
    for answer in (None, {}, {"status": "ok"}, [7]):
        assert acknowledged(answer, {1, 2}, status_counts=True) == {1, 2}
    assert acknowledged({"acknowledged": [1]}, {1, 2}, status_counts=True) == {1}
    with pytest.raises(NotDelivered, match="names no numbers"):
        acknowledged(None, {1, 2}, status_counts=False)


def test_the_option_of_a_sink_reaches_its_delivery(loop: FastLoop, poster: FakePoster) -> None:
    batch = [Stored(1, Reading("uav-1", 1, "alt", "m", 1.0, 0.0))]
    poster.answer = None
    assert loop.run(HttpSink(sink_address("http://a/r#ack=status"), poster).send(batch)) == {1}
    with pytest.raises(NotDelivered):
        loop.run(HttpSink(sink_address("http://a/r"), poster).send(batch))
    assert {url for _, url, _ in poster.posts} == {"http://a/r"}
