from __future__ import annotations

import selectors
import threading
from collections.abc import Callable, Iterator

import pytest

from mavproxy_uavapi.core.mainloop.main_loop_queue import MainLoopQueue


@pytest.fixture
def outbox() -> Iterator[MainLoopQueue]:
    outbox = MainLoopQueue()
    yield outbox
    outbox.close()


def readable(outbox: MainLoopQueue) -> bool:
    with selectors.DefaultSelector() as selector:
        selector.register(outbox.fileno(), selectors.EVENT_READ)
        return bool(selector.select(0))


def test_calls_run_in_the_order_in_which_they_were_put(outbox: MainLoopQueue) -> None:
    ran: list[int] = []
    for number in range(5):
        outbox.put(lambda number=number: ran.append(number))
    assert ran == []
    outbox.drain()
    assert ran == [0, 1, 2, 3, 4]


def test_put_wakes_select_until_it_was_read(outbox: MainLoopQueue) -> None:
    assert not readable(outbox)
    ran: list[int] = []
    outbox.put(lambda: ran.append(1))
    assert readable(outbox)
    outbox.on_readable(None)
    assert ran == [1]
    assert not readable(outbox)


def test_spurious_wake_up_is_harmless(outbox: MainLoopQueue) -> None:
    outbox.on_readable(None)
    outbox.drain()


def test_what_a_call_queues_waits_for_the_next_time(outbox: MainLoopQueue) -> None:
    ran: list[str] = []

    def again() -> None:
        ran.append("again")
        outbox.put(again)

    outbox.put(again)
    outbox.drain()
    assert ran == ["again"]
    outbox.drain()
    assert ran == ["again"] * 2


def test_full_pipe_loses_no_call(outbox: MainLoopQueue) -> None:
    ran: list[int] = []
    for number in range(5000):
        outbox.put(lambda number=number: ran.append(number))
    while readable(outbox):
        outbox.on_readable(None)
    assert ran == list(range(5000))


def test_any_thread_may_put(outbox: MainLoopQueue) -> None:
    ran: list[int] = []
    puts: list[Callable[[], None]] = [lambda: ran.append(threading.get_ident())] * 100
    threads = [threading.Thread(target=lambda: [outbox.put(put) for put in puts]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    outbox.drain()
    assert ran == [threading.get_ident()] * 400


def test_after_close_nothing_is_kept_and_nothing_raised() -> None:
    outbox = MainLoopQueue()
    outbox.put(lambda: pytest.fail("ran after close"))
    outbox.close()
    outbox.put(lambda: pytest.fail("ran after close"))
    outbox.on_readable(None)
    outbox.drain()
    assert outbox.filenos() == [-1, -1]
