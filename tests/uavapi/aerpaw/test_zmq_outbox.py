"""What a runner said before another one joined reaches it."""

from __future__ import annotations

import pytest

from mavproxy_uavapi.aerpaw.zmq_outbox import REMEMBERED, ZmqOutbox
from tests.support.virtual_time import FastLoop

READY = {"msg_type": "state_transition", "identifier": "ground", "next_state": "ready"}


@pytest.fixture
def outbox(loop: FastLoop) -> ZmqOutbox:
    return ZmqOutbox(loop.time)


def test_runner_that_joins_later_gets_what_it_missed(outbox: ZmqOutbox) -> None:
    outbox.put(READY)
    assert outbox.rest() == [READY]
    outbox.heard("other", joins=True)
    assert outbox.rest() == []
    outbox.heard("ground", joins=True)
    assert outbox.rest() == [READY]


def test_nothing_is_sent_twice_to_a_runner_that_was_there(outbox: ZmqOutbox) -> None:
    outbox.put(READY)
    outbox.heard("ground", joins=False)
    outbox.heard("ground", joins=True)
    outbox.put(READY)
    outbox.heard("ground", joins=True)
    assert outbox.rest() == [READY, READY]


def test_old_message_is_forgotten(loop: FastLoop, outbox: ZmqOutbox) -> None:
    outbox.put(READY)
    outbox.rest()
    loop.pass_time(REMEMBERED + 1)
    outbox.heard("ground", joins=True)
    assert outbox.rest() == []


def test_message_to_all_is_not_kept(loop: FastLoop, outbox: ZmqOutbox) -> None:
    outbox.put({"msg_type": "hello"})
    assert loop.run(outbox.next()) == {"msg_type": "hello"}
    outbox.heard("ground", joins=True)
    assert outbox.rest() == []
