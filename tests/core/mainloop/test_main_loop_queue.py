from __future__ import annotations

import selectors
import threading
from collections.abc import Callable, Iterator

import pytest

from mavproxy_uavapi.core.mainloop.main_loop_queue import MainLoopQueue


@pytest.fixture
def queue() -> Iterator[MainLoopQueue]:
    queue = MainLoopQueue()
    yield queue
    queue.close()


def readable(queue: MainLoopQueue) -> bool:
    with selectors.DefaultSelector() as selector:
        selector.register(queue.fileno(), selectors.EVENT_READ)
        return bool(selector.select(0))


def test_calls_run_in_the_order_in_which_they_were_put(queue: MainLoopQueue) -> None:
    ran: list[int] = []
    for number in range(5):
        queue.put(lambda number=number: ran.append(number))
    assert ran == []
    queue.drain()
    assert ran == [0, 1, 2, 3, 4]


def test_put_wakes_select_until_it_was_read(queue: MainLoopQueue) -> None:
    assert not readable(queue)
    ran: list[int] = []
    queue.put(lambda: ran.append(1))
    assert readable(queue)
    queue.on_readable(None)
    assert ran == [1]
    assert not readable(queue)


def test_spurious_wake_up_is_harmless(queue: MainLoopQueue) -> None:
    queue.on_readable(None)
    queue.drain()


def test_what_a_call_queues_waits_for_the_next_time(queue: MainLoopQueue) -> None:
    ran: list[str] = []

    def again() -> None:
        ran.append("again")
        queue.put(again)

    queue.put(again)
    queue.drain()
    assert ran == ["again"]
    queue.drain()
    assert ran == ["again"] * 2


def test_full_pipe_loses_no_call(queue: MainLoopQueue) -> None:
    ran: list[int] = []
    for number in range(5000):
        queue.put(lambda number=number: ran.append(number))
    while readable(queue):
        queue.on_readable(None)
    assert ran == list(range(5000))


def test_any_thread_may_put(queue: MainLoopQueue) -> None:
    ran: list[int] = []
    puts: list[Callable[[], None]] = [lambda: ran.append(threading.get_ident())] * 100
    threads = [threading.Thread(target=lambda: [queue.put(put) for put in puts]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    queue.drain()
    assert ran == [threading.get_ident()] * 400


def test_after_close_nothing_is_kept_and_nothing_raised() -> None:
    queue = MainLoopQueue()
    queue.put(lambda: pytest.fail("ran after close"))
    queue.close()
    queue.put(lambda: pytest.fail("ran after close"))
    queue.on_readable(None)
    queue.drain()
    assert queue.filenos() == [-1, -1]
