from __future__ import annotations

import json
from typing import Any

import pytest

from mavproxy_gradys.forwarding.confirmations import LARGEST, MOST, QUIET, Confirmations
from tests.support.virtual_time import FastLoop


def output(*numbers: Any) -> bytes:
    return json.dumps({"acknowledged": numbers}).encode()


@pytest.fixture
def confirmations() -> Confirmations:
    made = Confirmations()
    made.begin()
    return made


def test_who_waits_has_what_is_confirmed_in_time(loop: FastLoop, confirmations: Confirmations) -> None:
    confirmations.expect({1, 2, 3})
    loop.call_later(1.0, confirmations.take, output(2))
    loop.call_later(2.0, confirmations.take, output(1, 3, 99))
    began = loop.time()
    assert loop.run(confirmations.wait({1, 2, 3}, 20.0)) == {1, 2, 3}
    assert loop.time() - began == pytest.approx(2.0)


def test_what_is_late_is_collected_next_time(loop: FastLoop, confirmations: Confirmations) -> None:
    confirmations.expect({1, 2})
    confirmations.take(output(1))
    assert loop.run(confirmations.wait({1, 2}, 5.0)) == {1}
    confirmations.take(output(2))
    assert confirmations.collect({2, 3}) == {2}
    assert confirmations.collect({2, 3}) == set()


def test_a_connection_that_ends_ends_the_wait(loop: FastLoop, confirmations: Confirmations) -> None:
    confirmations.expect({1})
    loop.call_later(1.0, confirmations.end)
    began = loop.time()
    assert loop.run(confirmations.wait({1}, 20.0)) == set()
    assert loop.time() - began == pytest.approx(1.0)


@pytest.mark.parametrize("nonsense", [b"", b"[]", b"7", b'{"acknowledged": 1}', b'{"acknowledged": [[1], "1", null]}',
                                      b"\xff", None, "text", b"[" * 100_000, output(7)])  # fmt: skip
def test_nonsense_confirms_nothing(confirmations: Confirmations, nonsense: Any) -> None:
    confirmations.expect({1})
    confirmations.take(nonsense)
    assert confirmations.collect({1, 7}) == set()


def test_a_message_that_would_hold_up_mavproxy_is_not_read(confirmations: Confirmations) -> None:
    confirmations.expect({1})
    confirmations.take(b'{"acknowledged": [' + b"[]," * LARGEST + b"1]}")
    assert confirmations.collect({1}) == set()


def test_memory_is_bounded(confirmations: Confirmations) -> None:
    for first in range(0, 10 * MOST, 200):
        confirmations.expect(set(range(first, first + 200)))
    assert len(confirmations._awaited) + len(confirmations._confirmed) <= MOST + 200


def test_those_that_stay_away_after_the_first_ones_are_not_waited_for_long(
    loop: FastLoop, confirmations: Confirmations
) -> None:
    assert confirmations.expect({1, 2, 3})
    loop.call_later(1.0, confirmations.take, output(1))
    loop.call_later(2.0, confirmations.take, output(2))
    began = loop.time()
    assert loop.run(confirmations.wait({1, 2, 3}, 20.0)) == {1, 2}
    assert loop.time() - began == pytest.approx(2.0 + QUIET)
    assert not confirmations.expect({3}) and confirmations.expect({3, 4})
