from __future__ import annotations

import random
from typing import Any

from mavproxy_uavapi.core.link.log_pieces import WHOLE_LIST, LogEntry, LogList, LogPieces
from tests.support.messages import message_of


def entry(number: int, of: int = 3, last: int = 3, **fields: Any) -> Any:
    return message_of("log_entry", id=number, num_logs=of, last_log_num=last, **fields)


def test_list_is_complete_when_each_id_was_heard() -> None:
    listing = LogList()
    assert listing.missing == WHOLE_LIST
    listing.take(entry(1, size=10, time_utc=5))
    assert listing.missing == (2, 3)
    listing.take(entry(3, size=30))
    assert listing.missing == (2, 2)
    listing.take(entry(2, size=20, last=2))
    assert listing.missing is None
    assert listing.entries == [LogEntry(1, 10, 5), LogEntry(2, 20, None), LogEntry(3, 30, None)]


def test_vehicle_without_logs_says_so_in_an_entry() -> None:
    listing = LogList()
    listing.take(entry(0, of=0, last=0))
    assert listing.missing is None and listing.entries == []


def test_ids_may_begin_at_zero() -> None:
    listing = LogList()
    listing.take(entry(0, of=2, last=1))
    assert listing.missing == (1, 1)


def test_entry_beyond_the_list_is_none_of_it() -> None:
    listing = LogList()
    listing.take(entry(1))
    listing.take(entry(9))
    assert [listed.id for listed in listing.entries] == [1]


def test_gaps_are_requested_in_their_order_and_never_more_than_a_chunk() -> None:
    pieces = LogPieces(1000)
    assert pieces.next_gap(300) == (0, 300)
    assert pieces.take(0, 90) and pieces.take(180, 270) and pieces.take(990, 1000)
    assert pieces.next_gap(300) == (90, 180)
    assert not pieces.take(20, 80)
    assert pieces.take(60, 181), "a part of it is new"
    assert pieces.next_gap(300) == (270, 570)
    assert pieces.done == 280
    assert pieces.take(0, 1000)
    assert (pieces.next_gap(300), pieces.done) == (None, 1000)


def test_empty_log_and_empty_piece() -> None:
    assert LogPieces(0).next_gap(90) is None
    pieces = LogPieces(10)
    assert not pieces.take(5, 5) and not pieces.take(7, 3)
    assert pieces.next_gap(90) == (0, 10)


def test_any_order_of_any_pieces_is_counted_as_a_set_counts_it() -> None:
    chance = random.Random(3)
    for _ in range(200):
        size = chance.randint(1, 60)
        pieces, here = LogPieces(size), set[int]()
        for _ in range(40):
            start = chance.randrange(size)
            end = min(start + chance.randint(0, 12), size)
            new = set(range(start, end)) - here
            assert pieces.take(start, end) is bool(new)
            here |= new
            assert pieces.done == len(here)
            gap = pieces.next_gap(size)
            absent = sorted(set(range(size)) - here)
            assert (gap is None) is (not absent)
            if gap is not None:
                assert gap[0] == absent[0]
                assert set(range(*gap)) <= set(absent)
                assert gap[1] == size or gap[1] in here
