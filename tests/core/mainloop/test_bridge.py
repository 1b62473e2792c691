from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import Expired, ModeChanged
from mavproxy_uavapi.core.mainloop.bridge import LONGEST_WAIT, READ_WITHIN, Bridge
from mavproxy_uavapi.core.mainloop.permit import Permit, permitted
from tests.support.mavproxy import MainLoop
from tests.support.virtual_time import FastLoop


class Received(list[Any]):
    """What the asyncio side received; messages that are exceptions are raised."""

    def take(self, message: Any, _came_after: float | None) -> None:
        if isinstance(message, Exception):
            raise message
        self.append((message, threading.current_thread().name))


class Number(int):
    """A message of no interest."""

    def get_type(self) -> str:
        return "NUMBER"


class Word(str):
    """Likewise."""

    def get_type(self) -> str:
        return "WORD"


def fed(value: Any) -> Any:
    """That value as a message."""
    return Number(value) if isinstance(value, int) else Word(value) if isinstance(value, str) else value


class BadMessage(Exception):
    def get_type(self) -> str:
        return "BAD"


@pytest.fixture
def received() -> Received:
    return Received()


@pytest.fixture
def bridge(mpstate: SimpleNamespace, received: Received) -> Iterator[Bridge]:
    bridge = Bridge(mpstate.select_extra, received.take)
    bridge.start()
    yield bridge
    bridge.stop()


def in_loop(bridge: Bridge) -> None:
    """Wait until the loop has done what was queued before."""

    async def nothing() -> None:
        await asyncio.sleep(0)

    bridge.run(nothing())


def test_fed_messages_arrive_in_order_in_the_asyncio_thread(bridge: Bridge, received: Received) -> None:
    for number in range(100):
        bridge.feed(fed(number))
    bridge.turn()
    in_loop(bridge)
    assert received == [(number, "uavapi-loop") for number in range(100)]


def test_bad_message_does_not_stop_the_next(bridge: Bridge, received: Received) -> None:
    defects: list[str] = []
    bridge.loop.set_exception_handler(lambda _, context: defects.append(context["message"]))
    for message in ("one", BadMessage(), "two"):
        bridge.feed(fed(message))
    bridge.turn()
    in_loop(bridge)
    assert [message for message, _ in received] == ["one", "two"]
    assert defects == ["uavapi: defect on BAD"]


def test_nothing_is_handed_over_before_the_main_loops_turn_is_over(bridge: Bridge, received: Received) -> None:
    bridge.feed(fed("one"))
    bridge.feed(fed("two"))
    in_loop(bridge)
    assert received == []
    bridge.turn()
    in_loop(bridge)
    assert [message for message, _ in received] == ["one", "two"]


def test_feed_never_goes_deaf_when_the_loop_is_faster_than_the_main_loop(
    bridge: Bridge, received: Received, monkeypatch: pytest.MonkeyPatch
) -> None:
    call_soon = bridge._thread.call_soon

    def overtaken(call: Any, *args: Any) -> bool:
        done = call_soon(call, *args)
        in_loop(bridge)  # the call is over before the main loop hears that it was taken
        return done

    monkeypatch.setattr(bridge._thread, "call_soon", overtaken)
    for message in ("one", "two", "three"):
        bridge.feed(fed(message))
        bridge.turn()
    assert [message for message, _ in received] == ["one", "two", "three"]


def test_messages_fed_during_a_delivery_come_with_the_next_turn(bridge: Bridge, received: Received) -> None:
    hold = threading.Event()
    bridge.call_soon(hold.wait, 2.0)
    for message in ("one", "two"):  # both turns are over before the asyncio side comes to the first
        bridge.feed(fed(message))
        bridge.turn()
    hold.set()
    in_loop(bridge)
    bridge.feed(fed("three"))
    bridge.turn()
    in_loop(bridge)
    assert [message for message, _ in received] == ["one", "two", "three"]


def test_what_is_to_be_sent_goes_out_between_two_messages_of_a_burst(bridge: Bridge) -> None:
    sent: list[str] = []
    bridge.feed(fed("one"))
    bridge.post(lambda: sent.append("command"))
    bridge.feed(fed("two"))
    assert sent == ["command"]


def test_new_work_waits_while_the_main_loop_is_at_messages(bridge: Bridge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_uavapi.core.mainloop.bridge.LONGEST_WAIT", 60.0)
    bridge.run(bridge.wait_for_main_loop())  # it is at none
    bridge.feed(fed("one"))
    waiting = asyncio.run_coroutine_threadsafe(bridge.wait_for_main_loop(), bridge.loop)
    in_loop(bridge)
    assert not waiting.done()
    bridge.turn()
    waiting.result(30.0)


def test_new_work_does_not_wait_for_ever(bridge: Bridge) -> None:
    bridge.feed(fed("one"))
    began = time.monotonic()
    bridge.run(bridge.wait_for_main_loop())
    assert time.monotonic() - began >= LONGEST_WAIT


def test_feed_after_the_end_is_dropped(mpstate: SimpleNamespace, received: Received) -> None:
    bridge = Bridge(mpstate.select_extra, received.take)
    bridge.start()
    bridge.stop()
    for number in range(3):
        bridge.feed(fed(number))
    bridge.turn()
    assert received == []
    assert len(bridge._inbox) == 0


def test_on_main_runs_in_the_main_loop_and_gives_its_result(bridge: Bridge, main_loop: MainLoop) -> None:
    future = asyncio.run_coroutine_threadsafe(bridge.on_main(threading.get_ident), bridge.loop)
    main_loop.until(future.done)
    assert future.result() == threading.get_ident()


def test_on_main_raises_what_the_call_raised(bridge: Bridge, main_loop: MainLoop) -> None:
    future = asyncio.run_coroutine_threadsafe(bridge.on_main(lambda: 1 / 0), bridge.loop)
    main_loop.until(future.done)
    with pytest.raises(ZeroDivisionError):
        future.result()


def test_on_main_that_was_cancelled_before_it_ran_is_never_run(bridge: Bridge, main_loop: MainLoop) -> None:
    ran: list[int] = []

    async def cancel_at_once() -> None:
        task = asyncio.create_task(bridge.on_main(lambda: ran.append(1)))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    bridge.run(cancel_at_once())
    main_loop.turn()
    bridge.turn()
    assert ran == []


def test_select_wakes_for_a_call_without_any_idle_task(bridge: Bridge, main_loop: MainLoop) -> None:
    ran: list[int] = []
    bridge.post(lambda: ran.append(1))
    main_loop.turn(wait=2.0)
    assert ran == [1]


def test_stop_takes_its_descriptor_out_of_select(mpstate: SimpleNamespace) -> None:
    bridge = Bridge(mpstate.select_extra, lambda *_: None)
    bridge.start()
    assert len(mpstate.select_extra) == 1
    bridge.stop()
    assert mpstate.select_extra == {}
    assert not bridge.running


def test_fifty_starts_and_stops_leave_no_thread_and_no_descriptor(
    mpstate: SimpleNamespace, descriptors: Callable[[], int], threads: Callable[[], list[str]]
) -> None:
    names, before = threads(), descriptors()
    for number in range(50):
        bridge = Bridge(mpstate.select_extra, lambda *_: None)
        if number % 2:
            bridge.start()
            bridge.feed(fed("hello"))
            bridge.turn()
        bridge.stop()
    assert threads() == names
    assert descriptors() == before


FORK = """
import os, socket, warnings
warnings.simplefilter("ignore")
from mavproxy_uavapi.core.errors import Expired, ModeChanged
from mavproxy_uavapi.core.mainloop.bridge import LONGEST_WAIT, READ_WITHIN, Bridge
from mavproxy_uavapi.core.mainloop.permit import Permit, permitted

def is_open(fd):
    try:
        os.fstat(fd)
    except OSError:
        return False
    return True

select_extra = {}
bridge = Bridge(select_extra, print)
bridge.start()
port, kept = socket.socket(), socket.socket()
taken_back = socket.socket()
closed = [port.fileno(), *bridge._calls.filenos()]
bridge.close_in_children(lambda: [port.fileno(), -1])
fileno = taken_back.fileno
bridge.close_in_children(ours := (lambda: [fileno()]))
bridge.keep_in_children(ours)
stopped = Bridge({}, print)
stopped.start()
stopped.stop()
child = os.fork()
if not child:
    wrong = any(is_open(fd) for fd in closed) or not is_open(kept.fileno()) or not is_open(fileno())
    os._exit(3 if wrong else 0)
status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
done = []
bridge.call_soon(done.append, 1)  # the parent's loop and socket are as they were
port.listen()

async def look():
    return done

assert bridge.run(look()) == [1]
bridge.stop()
raise SystemExit(status)
"""


def test_forked_child_closes_our_sockets_and_no_other() -> None:
    environment = {**os.environ, "MAVLINK20": "1"}
    ended = subprocess.run(
        [sys.executable, "-c", FORK], env=environment, capture_output=True, text=True, timeout=20, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, "")


class Heartbeat:
    """A vehicle's heartbeat."""

    def get_type(self) -> str:
        return "HEARTBEAT"

    def get_srcSystem(self) -> int:
        return 1


class Main:
    """A main loop turned by hand, and a message of vehicle 1 that waits for it."""

    def __init__(self, loop: FastLoop, mpstate: SimpleNamespace) -> None:
        self.loop, self.written = loop, list[str]()
        self.bridge = Bridge(mpstate.select_extra, lambda *_: None, loop)
        self.allowed, self.basis = True, 0

    def check(self) -> None:
        if not self.allowed:
            raise ModeChanged("the pilot has it")

    def send(self, name: str = "message", **fields: Any) -> asyncio.Task[None]:
        async def send() -> None:
            permit = Permit(check=self.check, system=1, basis=lambda: self.basis, **{"lasts": 2.0, **fields})
            with permitted(permit):
                await self.bridge.on_main(lambda: self.written.append(name))

        task: asyncio.Task[None] = self.loop.create_task(send())
        self.loop.settle()
        return task

    def turn(self) -> None:
        self.bridge.turn()
        self.loop.settle()


@pytest.fixture
def main(loop: FastLoop, mpstate: SimpleNamespace) -> Iterator[Main]:
    main = Main(loop, mpstate)
    yield main
    main.bridge._calls.close()


def test_message_that_is_still_right_is_written_in_the_next_turn(main: Main) -> None:
    task = main.send()
    main.turn()
    assert main.written == ["message"] and task.done()


def test_heartbeat_since_the_check_has_it_checked_again_and_written(main: Main) -> None:
    task = main.send()
    main.bridge.feed(Heartbeat())
    assert main.written == []
    main.turn()
    main.turn()
    assert main.written == ["message"] and task.done()


def test_message_that_a_heartbeat_makes_wrong_is_never_written(main: Main) -> None:
    task = main.send()
    main.allowed = False
    main.bridge.feed(Heartbeat())
    for _ in range(3):
        main.turn()
    assert main.written == [] and isinstance(task.exception(), ModeChanged)


def test_message_whose_basis_changes_is_checked_again(main: Main) -> None:
    task = main.send()
    main.basis, main.allowed = 1, False
    main.turn()
    assert main.written == [] and isinstance(task.exception(), ModeChanged)


def test_message_that_waited_is_checked_again_after_the_links_are_read(main: Main) -> None:
    main.send(lasts=10.0)
    main.loop.pass_time(4.0)
    unread = True
    main.bridge.links_have_unread = lambda: unread
    for _ in range(3):
        main.turn()
    assert main.written == []
    unread = False
    main.turn()
    assert main.written == ["message"]


def test_link_that_is_never_empty_does_not_keep_a_late_message_for_ever(main: Main) -> None:
    main.send(lasts=10.0)
    main.loop.pass_time(4.0)
    main.bridge.links_have_unread = lambda: True
    for _ in range(int(READ_WITHIN / 0.05) + 2):
        main.turn()
        main.loop.pass_time(0.05)
    assert main.written == ["message"]


def test_setpoint_that_is_late_is_written_although_no_link_is_ever_empty(main: Main) -> None:
    main.send(lasts=0.5)
    main.loop.pass_time(0.15)
    main.bridge.links_have_unread = lambda: True
    for _ in range(6):
        main.turn()
        main.loop.pass_time(0.05)
    assert main.written == ["message"]


def test_message_from_before_a_burst_is_not_written_between_its_messages(main: Main) -> None:
    main.turn()
    main.loop.pass_time(3.0)  # it stands
    task = main.send(lasts=10.0)
    for _ in range(5):
        main.bridge.feed(Number(1))
        main.loop.settle()
    main.allowed = False
    main.bridge.feed(Heartbeat())
    for _ in range(3):
        main.turn()
    assert main.written == [] and isinstance(task.exception(), ModeChanged)


def test_message_that_waits_through_a_second_stand_is_checked_again(main: Main) -> None:
    task = main.send(lasts=10.0)
    main.loop.pass_time(3.0)
    main.turn()
    main.loop.pass_time(1.5)
    main.allowed = False
    main.turn()
    assert main.written == [] and isinstance(task.exception(), ModeChanged)


@pytest.mark.parametrize("seconds", [2.1, 60.0])
def test_message_too_old_is_reported_by_a_standing_loop_and_never_written(main: Main, seconds: float) -> None:
    task = main.send()
    main.loop.pass_time(seconds)
    assert isinstance(task.exception(), Expired)
    main.turn()
    assert main.written == []


def test_message_whose_sender_is_cancelled_is_never_written(main: Main) -> None:
    task = main.send()
    task.cancel()
    main.loop.settle()
    main.turn()
    assert main.written == []


def test_what_stops_a_vehicle_is_written_first(main: Main) -> None:
    main.send("movement")
    main.send("stop", stops=True)
    main.turn()
    assert main.written == ["stop", "movement"]
