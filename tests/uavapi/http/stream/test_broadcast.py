from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.http.stream.broadcast import TICK, TelemetryBroadcast
from mavproxy_uavapi.http.stream.stream_news import JOBS_TOLD_FIRST
from mavproxy_uavapi.http.stream.subscription import NamePatterns, Subscription, Wishes
from tests.support.drone import Drone
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api

Hear = Callable[..., Callable[..., list[dict[str, Any]]]]


@pytest.fixture
def hear(host: Host, loop: FastLoop) -> Iterator[Hear]:
    """Subscribes; gives a function that lets time pass and tells what has come, as JSON."""
    broadcast = TelemetryBroadcast(host)
    contexts: list[Any] = []

    def hear(**wishes: Any) -> Any:
        subscription = Subscription(
            Wishes(**{kind: NamePatterns(text) for kind, text in wishes.items()}), loop.call_later
        )

        async def begin() -> None:
            contexts.append(broadcast.heard_by(subscription))
            contexts[-1].__enter__()

        loop.run(begin())

        def come(seconds: float = 0.0) -> list[dict[str, Any]]:
            loop.pass_time(seconds)
            events = loop.run(subscription.next(1.0)) if subscription._queue else []
            return [json.loads(event.json(0)) for event in events]

        return come

    yield hear
    for context in contexts:
        context.__exit__(None, None, None)
    assert host.listeners == [] and host.observers == []


def named(events: list[dict[str, Any]], name: str) -> list[Any]:
    return [event["info"] for event in events if name in (event.get("view"), event.get("event"))]


def test_broadcast_listens_while_somebody_does(host: Host) -> None:
    broadcast = TelemetryBroadcast(host)
    with broadcast.heard_by(Subscription(Wishes())):
        with pytest.raises(KeyError), broadcast.heard_by(Subscription(Wishes())):
            assert len(host.listeners) == 1
            raise KeyError
        assert len(host.listeners) == 1
    assert host.listeners == []


def test_view_is_what_the_read_answers(flying: Drone, hear: Hear, api: Api) -> None:
    come = hear(view="gps,attitude")
    come(1.0)
    events = come(1.0)
    assert {event["view"] for event in events} == {"gps", "attitude"}
    read = api.get("/telemetry/gps").body["info"]
    assert named(events, "gps")[-1].keys() == read.keys()
    assert named(events, "gps")[-1]["position"]["relative_alt"] == 20.0


def test_what_was_known_before_comes_first_with_its_own_time(
    flying: Drone, hear: Hear, loop: FastLoop, host: Host
) -> None:
    flying.power_off()
    loop.pass_time(3.0)
    come = hear(view="gps", event="alive")
    alive, gps = come()[:2]
    assert (alive["event"], gps["view"]) == ("alive", "gps")
    assert alive["time"] - gps["time"] > 2.0


def test_text_that_is_told_again_has_the_same_clock(flying: Drone, hear: Hear, host: Host, loop: FastLoop) -> None:
    before = hear(event="statustext")
    before()
    loop.pass_time(0.1237)
    host.bridge.feed(message_of("statustext", text="hello", severity=4))
    (first,) = [event for event in before(1.0) if event["info"]["text"] == "hello"]
    again = [event for _ in range(20) for event in hear(event="statustext")(0.0371) if event["info"] == first["info"]]
    assert {event["clock"] for event in again} == {first["clock"]}
    assert len(again) == 20


def test_clock_of_events_does_not_step_with_the_wall_clock(
    flying: Drone, hear: Hear, loop: FastLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    come = hear(view="gps", event="alive")
    come(1.0)
    true = time.time
    for step in (3600.0, -3600.0):
        monkeypatch.setattr(time, "time", lambda ahead=step: true() + ahead)
        events = come(2.0)
        assert {event["time"] // 3600 for event in events} <= {(true() + step + n) // 3600 for n in (-5, 5)}
        assert all(0.0 <= loop.time() - event["clock"] <= 2.1 for event in events)


def test_newcomer_hears_of_each_job_that_runs_and_of_the_newest(flying: Drone, hear: Hear, api: Api) -> None:
    drive = api.begin("POST", "/movement/drive_wait", json={"x": 500, "y": 0, "z": 0})
    api.until(api.service.host.jobs.running)
    (old,) = api.service.host.jobs.running()
    for _ in range(JOBS_TOLD_FIRST + 5):
        assert api.post("/command/set_air_speed?new_v=5").status in (200, 429)
    jobs = named(hear(event="job")(), "job")
    assert [job["job"] for job in jobs if job["state"] == "running"] == [old.id]
    assert len(jobs) == JOBS_TOLD_FIRST + 1
    drive.cancel()


def test_status_tells_a_lost_link_though_nothing_arrives(flying: Drone, hear: Hear, host: Host) -> None:
    come = hear(view="status", event="link")
    come(1.0)
    flying.power_off()
    events = come(host.link_watch.timeout + 2 * TICK)
    assert named(events, "link") == [{"alive": False}]
    assert named(events, "status")[-1]["link"]["alive"] is False


def test_events_tell_mode_arming_texts_and_who_commands(flying: Drone, hear: Hear, api: Api, host: Host) -> None:
    come = hear(event="*", view="vehicle")
    come(1.0)
    host.bridge.feed(message_of("statustext", text="hello", severity=4))
    task = api.begin("POST", "/movement/drive_wait", json={"x": 50, "y": 0, "z": 0})
    events = come(2.0)
    assert named(events, "statustext") == [{"severity": 4, "text": "hello"}]
    (authority,) = named(events, "authority")
    assert authority["commanded_by"]["verb"] == "/movement/drive_wait"
    assert {job["state"] for job in named(events, "job")} == {"running"}
    assert named(events, "vehicle")[-1]["commanded_by"] == authority["commanded_by"]
    assert api.post("/command/land?wait=false").status == 202
    events = come(3.0)
    assert named(events, "mode")[0] == {"mode": "LAND"}
    assert [job["error"]["code"] for job in named(events, "job") if job["state"] == "failed"] == ["superseded"]
    task.cancel()


def test_what_other_modules_tell_is_an_event(host: Host, hear: Hear) -> None:
    come = hear(event="tag")
    host.tell("tag", 1, {"id": 7, "seen": True})
    host.tell("delivered", 1, {"count": 3})
    assert [event["info"] for event in come()] == [{"id": 7, "seen": True}]


def test_nothing_ticks_when_nobody_listens(flying: Drone, hear: Hear, loop: FastLoop, host: Host) -> None:
    broadcast = TelemetryBroadcast(host)

    async def listen() -> None:
        with broadcast.heard_by(Subscription(Wishes(event=NamePatterns("*")))):
            assert broadcast._ticks is not None

    loop.run(listen())
    loop.pass_time(2 * TICK)
    assert broadcast._ticks is None
