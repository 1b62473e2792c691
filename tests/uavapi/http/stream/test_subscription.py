from __future__ import annotations

import json
from typing import Any

import pytest

from mavproxy_uavapi.http.stream.stream_event import Event, When, of_message
from mavproxy_uavapi.http.stream.subscription import QUEUED, TOGETHER, NamePatterns, Subscription, Wishes
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

ALL = Wishes(NamePatterns("*"))
THEN = When(0.0, 0.0)


def take(loop: FastLoop, subscription: Subscription) -> list[Event]:
    return loop.run(subscription.next(1.0))


def numbers(events: list[Event]) -> list[int]:
    return [json.loads(event.json(0))["fields"]["time_boot_ms"] for event in events]


def attitude(number: int, **header: Any) -> Event:
    return of_message(message_of("attitude", time_boot_ms=number, **header), THEN)


def test_reader_that_falls_behind_loses_the_oldest_and_is_told_how_many(loop: FastLoop) -> None:
    subscription = Subscription(ALL)
    for number in range(QUEUED + 25):
        subscription.offer(attitude(number), 1.0)
    assert subscription.dropped == 25
    kept = [number for _ in range(QUEUED // TOGETHER) for number in numbers(take(loop, subscription))]
    assert kept == list(range(25, QUEUED + 25))


def test_rate_lets_the_first_through_and_counts_components_apart(loop: FastLoop) -> None:
    subscription = Subscription(Wishes(NamePatterns("*"), rate=2.0))
    passed = []
    for tenth in range(11):
        for component in (1, 154):
            subscription.offer(attitude(tenth, component=component), tenth / 10)
        if tenth % 5 == 0:
            passed += numbers(take(loop, subscription))
    assert passed == [0, 0, 5, 5, 10, 10]


def test_of_what_comes_too_often_the_newest_passes_in_its_time(loop: FastLoop) -> None:
    subscription = Subscription(Wishes(NamePatterns("*"), rate=2.0), loop.call_later)
    for tenth in range(3):
        subscription.offer(attitude(tenth), tenth / 10)
    assert numbers(take(loop, subscription)) == [0]
    loop.pass_time(0.5)
    assert numbers(take(loop, subscription)) == [2]
    subscription.offer(attitude(3), 0.7)  # 0.2 s after that one
    subscription.close()
    loop.pass_time(1.0)
    subscription.offer(attitude(4), 1.7)
    assert numbers(take(loop, subscription)) == [4]


def test_slow_reader_with_a_rate_gets_the_newest_of_each_and_every_event(loop: FastLoop) -> None:
    subscription = Subscription(Wishes(NamePatterns("*"), event=NamePatterns("mode"), rate=2.0))
    for second in range(3 * QUEUED):
        for system in (1, 2):
            subscription.offer(attitude(second, system=system), float(second))
        if second in (10, 20):
            subscription.offer(Event("event", "mode", 1, THEN, lambda second=second: {"info": second}), float(second))
    bodies = [json.loads(event.json(0)) for event in take(loop, subscription)]
    assert [(body["system"], body["fields"]["time_boot_ms"]) for body in bodies[:2]] == [
        (1, 3 * QUEUED - 1),
        (2, 3 * QUEUED - 1),
    ]
    assert [body["info"] for body in bodies[2:]] == [10, 20]
    assert subscription.dropped == 0


def test_no_rate_holds_an_event_back(loop: FastLoop) -> None:
    subscription = Subscription(Wishes(event=NamePatterns("mode"), rate=1.0), loop.call_later)
    for mode in ("GUIDED", "LOITER", "GUIDED"):
        subscription.offer(Event("event", "mode", 1, THEN, lambda mode=mode: {"info": mode}), 0.0)
    assert [json.loads(event.json(0))["info"] for event in take(loop, subscription)] == ["GUIDED", "LOITER", "GUIDED"]


@pytest.mark.parametrize(
    ("wishes", "wanted"),
    [
        (Wishes(NamePatterns("GPS*")), True),
        (Wishes(NamePatterns("ATTITUDE, GPS_RAW_INT")), True),
        (Wishes(NamePatterns("GPS_RAW_IN")), False),
        (Wishes(view=NamePatterns("*"), event=NamePatterns("*")), False),
        (Wishes(NamePatterns("*"), systems=frozenset({3})), True),
        (Wishes(NamePatterns("*"), systems=frozenset({4, 5})), False),
    ],
)
def test_names_may_have_wildcards(wishes: Wishes, wanted: bool) -> None:
    assert (of_message(message_of("gps_raw_int", system=3), THEN) in wishes) is wanted


def test_event_of_no_vehicle_is_for_those_who_want_one(loop: FastLoop) -> None:
    assert Event("event", "alive", 0, THEN, dict) in Wishes(event=NamePatterns("*"), systems=frozenset({4}))


def test_event_tells_each_client_what_that_has_lost() -> None:
    event = of_message(message_of("attitude", roll=float("nan"), system=3), When(12.3456, 7.0))
    for dropped in (0, 7):
        body = json.loads(event.json(dropped))
        assert (body["dropped"], body["system"], body["name"], body["time"]) == (dropped, 3, "ATTITUDE", 12.346)
        assert body["clock"] == 7.0
        assert body["fields"]["roll"] is None


def test_who_keeps_all_loses_no_value_that_it_has_not_read_yet(loop: FastLoop) -> None:
    subscription = Subscription(Wishes(NamePatterns("*"), rate=8.0), queued=100, keeps_all=True)
    for number in range(64):
        subscription.offer(attitude(number), number / 64)
    assert numbers(subscription.take()) == list(range(0, 64, 8)) and subscription.dropped == 0
