from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.http.broadcast import QUEUED, TOGETHER, Event, Subscription, TelemetryBroadcast


@pytest.fixture
def state(host: Any, msg: Any) -> Any:
    return host.fleet.update(msg("heartbeat"), 0.0)


def take(loop: Any, subscription: Subscription) -> list[Event]:
    return loop.run(subscription.next())


def times(events: list[Event]) -> list[int]:
    return [event.message.time_boot_ms for event in events]


def test_reader_that_falls_behind_loses_the_oldest_and_is_told_how_many(loop: Any, state: Any, msg: Any) -> None:
    subscription = Subscription(frozenset(), None, None)
    for number in range(QUEUED + 25):
        subscription.offer(state, Event(msg("attitude", time_boot_ms=number), 0.0), 1.0)
    assert subscription.dropped == 25
    got = [time for _ in range(QUEUED // TOGETHER) for time in times(take(loop, subscription))]
    assert got == list(range(25, QUEUED + 25))


def test_rate_lets_the_first_through_and_counts_components_apart(loop: Any, state: Any, msg: Any) -> None:
    subscription = Subscription(frozenset(), None, 2.0)
    for tenth in range(11):
        for component in (1, 154):
            event = Event(msg("attitude", component=component, time_boot_ms=tenth), 0.0)
            subscription.offer(state, event, tenth / 10)
    heard = [(event.message.time_boot_ms, event.message.get_srcComponent()) for event in take(loop, subscription)]
    assert heard == [(tenth, component) for tenth in (0, 5, 10) for component in (1, 154)]


def test_event_tells_each_client_what_that_has_lost(msg: Any) -> None:
    import json

    event = Event(msg("attitude", roll=float("nan"), system=3), 12.3456)
    for dropped in (0, 7):
        told = json.loads(event.json(dropped))
        assert (told["dropped"], told["system"], told["name"], told["time"]) == (dropped, 3, "ATTITUDE", 12.346)
        assert told["fields"]["roll"] is None


def test_broadcast_listens_while_somebody_does() -> None:
    listeners: list[Any] = []
    broadcast = TelemetryBroadcast(listeners)
    with broadcast.heard_by(Subscription(frozenset(), None, None)):
        with pytest.raises(KeyError), broadcast.heard_by(Subscription(frozenset(), None, None)):
            assert len(listeners) == 1
            raise KeyError
        assert len(listeners) == 1
    assert listeners == []
