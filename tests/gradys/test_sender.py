from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.keeper import Keeper
from mavproxy_gradys.readings import Reading
from mavproxy_gradys.sender import BATCH, Sender
from mavproxy_gradys.sinks import HttpSink, acknowledged
from mavproxy_gradys.spool import Spool

SINK = "http://a/readings"


@pytest.fixture
def keeper(loop: Any, tmp_path: Path, at_once: None) -> Iterator[Keeper]:
    keeper = Keeper(lambda: Spool(tmp_path / "spool.db", 1e9, 1e9, clock=loop.time), loop.time)
    loop.run(keeper.start([SINK]))
    yield keeper
    loop.run(keeper.stop())


@pytest.fixture
def sender(loop: Any, keeper: Keeper, poster: Any, settings: Any, monkeypatch: pytest.MonkeyPatch) -> Sender:
    """Sends to `poster` from now on."""
    poster.answer = lambda body: {"acknowledged": [reading["seq"] for reading in json.loads(body)["readings"]]}
    monkeypatch.setattr("mavproxy_gradys.sender.make_sink", lambda url, settings: HttpSink(url, poster))
    sender = Sender(SINK, keeper, loop.time, lambda: 0.0)
    loop.create_task(sender.run(settings()))
    return sender


def keep(loop: Any, keeper: Keeper, count: int) -> list[int]:
    kept: list[int] = loop.run(keeper.keep([Reading("uav-1", 1, "alt", "m", float(n), 5.0) for n in range(count)]))
    return kept


def test_readings_go_out_at_once_and_leave_the_spool(loop: Any, keeper: Any, sender: Any, poster: Any) -> None:
    kept = keep(loop, keeper, 3)
    loop.pass_time(0.1)
    assert poster.batches == [kept]
    assert (keeper.count, sender.acknowledged) == (0, 3)
    first = json.loads(poster.posts[0][2])["readings"][0]
    named = {"quantity": "alt", "representation": "m", "value": 0.0, "time": 5.0}
    assert first == {"device": "uav-1", "id": "1", "seq": kept[0], **named}


def test_many_go_in_batches_in_order(loop: Any, keeper: Any, sender: Any, poster: Any) -> None:
    kept = keep(loop, keeper, 2 * BATCH + 5)
    loop.pass_time(1)
    assert [len(batch) for batch in poster.batches] == [BATCH, BATCH, 5]
    assert sum(poster.batches, []) == kept


def test_what_is_not_acknowledged_is_sent_again(loop: Any, keeper: Any, sender: Any, poster: Any) -> None:
    poster.answer = lambda body: {"acknowledged": [reading["seq"] for reading in json.loads(body)["readings"]][::2]}
    kept = keep(loop, keeper, 5)
    loop.pass_time(1)
    assert poster.batches == [kept, [kept[1], kept[3]], [kept[3]]]
    assert keeper.count == 0


def test_a_200_without_numbers_acknowledges_all(loop: Any, keeper: Any, sender: Any, poster: Any) -> None:
    poster.answer = None
    keep(loop, keeper, 5)
    loop.pass_time(0.1)
    assert keeper.count == 0


def test_a_receiver_that_is_down_gets_them_in_order_when_it_is_back(
    loop: Any, keeper: Any, sender: Any, poster: Any, down: Any
) -> None:
    answers, poster.answer = poster.answer, down
    kept = []
    for _ in range(600):
        kept += keep(loop, keeper, 11)
        loop.pass_time(1)
    assert len(poster.posts) < 30
    assert sender.last_error == "cannot connect"
    poster.answer = answers
    poster.posts.clear()
    loop.pass_time(30)
    assert sum(poster.batches, []) == kept
    assert (keeper.count, sender.last_error) == (0, "")


def test_flush_does_not_wait_for_the_pause(loop: Any, keeper: Any, sender: Any, poster: Any, down: Any) -> None:
    poster.answer = down
    keep(loop, keeper, 1)
    loop.pass_time(20)
    before = len(poster.posts)
    sender.flush()
    loop.settle()
    assert len(poster.posts) == before + 1


def test_a_receiver_that_acknowledges_nothing_is_not_asked_again_at_once(
    loop: Any, keeper: Any, sender: Any, poster: Any
) -> None:
    poster.answer = {"acknowledged": []}
    keep(loop, keeper, 1)
    loop.pass_time(20)
    assert len(poster.posts) == 5
    assert keeper.count == 1 and "acknowledges nothing" in sender.last_error


def test_batches_that_are_too_large_get_smaller(loop: Any, keeper: Any, sender: Any, poster: Any) -> None:
    answers = poster.answer
    too_large = NotDelivered("it answers 413", reached=True, too_large=True)
    poster.answer = lambda body: too_large if len(json.loads(body)["readings"]) > 60 else answers(body)
    keep(loop, keeper, 200)
    loop.pass_time(60)
    assert keeper.count == 0


@pytest.mark.parametrize("numbers", ["all", [1, "2"], [True], {"1": 2}, None])
def test_an_acknowledgement_that_is_no_list_of_numbers_acknowledges_nothing(numbers: Any) -> None:
    with pytest.raises(NotDelivered):
        acknowledged({"acknowledged": numbers}, {1, 2})


def test_numbers_that_were_not_sent_are_not_acknowledged() -> None:
    assert acknowledged({"acknowledged": [1, 99]}, {1, 2}) == {1}
