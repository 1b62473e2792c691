from __future__ import annotations

import contextlib

import pytest

from mavproxy_uavapi.core.errors import TooManyRequests
from mavproxy_uavapi.core.streaming import SharedSlots


def test_no_few_callers_take_all_places() -> None:
    slots = SharedSlots(120, "streams are open")
    with contextlib.ExitStack() as taken:
        for who in ("first", "second", "third", "newcomer"):
            with pytest.raises(TooManyRequests, match=r"to this caller already"):
                while True:
                    taken.enter_context(slots.one_more_of(who))
        assert slots.count == 60 + 30 + 15 + 8
    assert (slots.count, slots._taken) == (0, {})


def test_places_that_are_all_taken_are_refused_to_anybody() -> None:
    slots = SharedSlots(3, "streams are open")
    with contextlib.ExitStack() as taken:
        for who in ("first", "second", "third"):
            taken.enter_context(slots.one_more_of(who))
        for who in ("first", "newcomer"):
            with pytest.raises(TooManyRequests, match=r"3 streams are open already"), slots.one_more_of(who):
                pass
