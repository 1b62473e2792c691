from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net.addresses import station
from mavproxy_gradys.push.pusher import Pusher
from mavproxy_gradys.push.statistics import StationTally
from mavproxy_gradys.settings import GradysSettings
from mavproxy_uavapi.core.host import Host
from tests.gradys.conftest import FakePoster, TelemetrySource
from tests.support.virtual_time import FastLoop


@pytest.fixture
def push(
    loop: FastLoop, host: Host, telemetry: TelemetrySource, settings: Callable[..., GradysSettings]
) -> Callable[..., Pusher]:
    """Begins to push to a station: `push(poster, ip="192.0.2.2")`."""

    def begin(poster: FakePoster, address: str = "127.0.0.1:9", **values: Any) -> Pusher:
        where = station(address)
        snapshot = settings(**{"ip": "192.0.2.2", **values})
        pusher = Pusher(where, host, snapshot, StationTally(where.url, lambda: 0.0), poster)

        async def a_little_later() -> None:  # so that no turn falls on the end of a test's second
            await asyncio.sleep(0.1)
            await pusher.run()

        pusher.task = loop.create_task(a_little_later())  # type: ignore[attr-defined]
        return pusher

    return begin


def sending(loop: FastLoop, seconds: float, *vehicles: Any) -> None:
    """Let time go by, in which the vehicles tell all four times a second."""
    for _ in range(round(seconds * 4)):
        for telemetry in vehicles:
            telemetry.send_all()
        loop.pass_time(0.25)


def test_once_a_second_with_numbers_that_advance(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    host_api = ("0.0.0.0", 8000)
    push(poster)._host.api_address = host_api
    sending(loop, 5, telemetry)
    assert [form["seq"] for form in poster.forms] == ["0", "1", "2", "3", "4"]
    assert poster.times == pytest.approx([1000.1, 1001.1, 1002.1, 1003.1, 1004.1])
    assert poster.posts[0][1] == "http://127.0.0.1:9/update-info/"
    assert poster.forms[0]["ip"] == "192.0.2.2:8000/"


def test_slow_answers_do_not_make_the_interval_drift(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    poster.takes = 0.7
    push(poster)
    sending(loop, 5, telemetry)
    assert poster.times == pytest.approx([1000.1, 1001.1, 1002.1, 1003.1, 1004.1])


def test_an_update_is_never_sent_while_the_one_before_is_on_its_way(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    poster.takes = 1.5
    push(poster)
    sending(loop, 6, telemetry)
    assert poster.times == pytest.approx([1000.1, 1002.1, 1004.1])


def test_dropped_by_the_station_is_counted_apart(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    poster.answer = {"type": 101}
    pusher = push(poster)
    sending(loop, 3, telemetry)
    vehicle = pusher.tally.vehicle(10)
    assert (vehicle.sent, vehicle.acknowledged, vehicle.dropped, vehicle.seq) == (3, 3, 3, 3)


def test_a_200_that_is_no_json_is_an_acknowledgement(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    poster.answer = None
    pusher = push(poster)
    sending(loop, 2, telemetry)
    assert (pusher.tally.total("acknowledged"), pusher.tally.total("dropped")) == (2, 0)


def test_a_number_is_used_again_until_it_is_acknowledged(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher], down: NotDelivered
) -> None:
    push(poster)
    sending(loop, 2, telemetry)
    poster.answer = down
    sending(loop, 2, telemetry)
    poster.answer = {"type": 103}
    sending(loop, 3, telemetry)
    assert [form["seq"] for form in poster.forms] == ["0", "1", "2", "2", "2", "3"]


def test_a_station_that_is_down_is_tried_less_and_less_often(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher], down: NotDelivered
) -> None:
    poster.answer = down
    pusher = push(poster)
    sending(loop, 130, telemetry)
    gaps = [after - before for before, after in zip(poster.times, poster.times[1:], strict=False)]
    assert gaps[:5] == pytest.approx([1, 2, 4, 8, 16], abs=1.01)
    assert all(gap == pytest.approx(30, abs=1.01) for gap in gaps[5:])
    assert pusher.tally.last_error == "cannot connect"
    report = pusher.tally.report(loop.time())
    assert 0 < report["next_try_s"] <= 30


def test_after_an_outage_the_interval_is_as_before_and_nothing_old_goes(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher], down: NotDelivered
) -> None:
    poster.answer = down
    push(poster)
    sending(loop, 20, telemetry)
    before = len(poster.posts)
    poster.answer = {"type": 103}
    sending(loop, 40, telemetry)
    times = poster.times[before:]
    assert times[0] <= 1020 + 30
    assert times == pytest.approx([times[0] + n for n in range(len(times))], abs=0.01)
    assert times[0] % 1 == pytest.approx(0.1)


def test_one_vehicle_asks_whether_the_station_is_back(
    loop: FastLoop,
    host: Host,
    telemetry: TelemetrySource,
    poster: FakePoster,
    push: Callable[..., Pusher],
    down: NotDelivered,
) -> None:
    fleet = [telemetry, *(type(telemetry)(host, system) for system in range(11, 31))]
    poster.answer, poster.takes = down, 0.1
    push(poster)
    sending(loop, 1, *fleet)
    assert len(poster.posts) == len(fleet)  # nobody knew yet
    poster.posts.clear()
    sending(loop, 2, *fleet)
    assert len(poster.posts) == 1
    poster.answer = {"type": 103}
    sending(loop, 8, *fleet)
    assert {form["id"] for form in poster.forms} == {str(system) for system in range(10, 31)}


def test_every_vehicle_has_its_own_id_and_numbers(
    loop: FastLoop, host: Host, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    push(poster)
    sending(loop, 2, telemetry)
    second = type(telemetry)(host, 11)
    sending(loop, 2, telemetry, second)
    reported = [(form["id"], form["seq"]) for form in poster.forms]
    assert reported == [("10", "0"), ("10", "1"), ("10", "2"), ("11", "0"), ("10", "3"), ("11", "1")]


def test_a_vehicle_that_the_station_refuses_does_not_hold_up_the_others(
    loop: FastLoop, host: Host, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    second = type(telemetry)(host, 11)
    second.send_all()
    refusal = NotDelivered("it answers 500", reached=True)
    poster.answer = lambda body: refusal if b"id=10&" in body else {"type": 103}
    pusher = push(poster)
    sending(loop, 8, telemetry, second)
    assert pusher.tally.vehicle(11).acknowledged == 8
    assert pusher.tally.vehicle(10).failed == 4  # at 0, 1, 3 and 7 s
    assert pusher.tally.vehicle(10).last_error == "it answers 500"


def test_old_positions_are_never_pushed_and_the_tally_says_why(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    pusher = push(poster, max_age=2)
    sending(loop, 2, telemetry)
    for _ in range(8):
        telemetry.send("heartbeat")
        loop.pass_time(0.5)
    assert len(poster.posts) == 4
    vehicle = pusher.tally.vehicle(10)
    assert "s old" in vehicle.why_not and vehicle.withheld == 2
    sending(loop, 2, telemetry)
    assert len(poster.posts) == 6 and vehicle.why_not == ""


def test_without_a_fix_nothing_is_pushed(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    telemetry.MESSAGES = {**telemetry.MESSAGES, "gps_raw_int": {"fix_type": 1}}
    telemetry.send_all()
    pusher = push(poster)
    sending(loop, 3, telemetry)
    assert poster.posts == []
    assert "no position fix" in pusher.tally.vehicle(10).why_not


OWN_ADDRESS = "mavproxy_gradys.push.pusher.own_address"


def test_ip_that_is_not_set_is_found_out_and_seldom_looked_up_again(
    loop: FastLoop,
    telemetry: TelemetrySource,
    poster: FakePoster,
    push: Callable[..., Pusher],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    requested: list[float] = []

    async def own_address(*_: Any) -> str:
        requested.append(loop.time())
        return "192.0.2.7"

    monkeypatch.setattr(OWN_ADDRESS, own_address)
    pusher = push(poster, ip="")
    sending(loop, 40, telemetry)
    assert {form["ip"] for form in poster.forms} == {"192.0.2.7/"}  # uavapi is not loaded: no port
    assert len(requested) == 2
    assert "names no API" in pusher.tally.note


async def unknown(*_: Any) -> str:
    raise OSError(-2, "Name or service not known")


async def silence(*_: Any) -> str:
    await asyncio.sleep(1000)
    raise AssertionError("not reached")


@pytest.mark.parametrize(
    ("own_address", "says"),
    [(unknown, "Name or service not known"), (silence, "the name server did not answer")],
    ids=["unknown", "silent"],
)
def test_name_server_without_an_answer_is_an_error_like_any_other(
    loop: FastLoop,
    telemetry: TelemetrySource,
    poster: FakePoster,
    push: Callable[..., Pusher],
    monkeypatch: pytest.MonkeyPatch,
    own_address: Callable[..., Awaitable[str]],
    says: str,
) -> None:
    monkeypatch.setattr(OWN_ADDRESS, own_address)
    pusher = push(poster, ip="", timeout=2)
    sending(loop, 3, telemetry)
    assert poster.posts == []
    assert says in pusher.tally.last_error
    assert pusher.tally.total("sent") == 0


def test_the_log_reports_an_outage_and_a_refusal_once(
    loop: FastLoop,
    telemetry: TelemetrySource,
    poster: FakePoster,
    push: Callable[..., Pusher],
    down: NotDelivered,
    caplog: pytest.LogCaptureFixture,
) -> None:
    push(poster)
    for answer in (down, {"type": 103}, NotDelivered("it answers 500", reached=True), {"type": 103}):
        poster.answer = answer
        sending(loop, 40, telemetry)
    url = "http://127.0.0.1:9"
    assert [(record.name, record.message) for record in caplog.records] == [
        ("gradys.push", f"{url} does not answer: cannot connect"),
        ("gradys.push", f"{url} answers again"),
        ("gradys.push", f"{url} refuses vehicle 10: it answers 500"),
        ("gradys.push", f"{url} takes vehicle 10 again"),
    ]


def test_a_dead_station_does_not_delay_another(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher], down: NotDelivered
) -> None:
    dead = type(poster)(loop)
    dead.answer, dead.takes = down, 3.0
    push(dead, "127.0.0.1:8")
    push(poster)
    sending(loop, 10, telemetry)
    assert len(poster.posts) == 10
    assert poster.times == pytest.approx([1000.1 + n for n in range(10)])


def test_cancelling_ends_the_updates_on_their_way_and_closes(
    loop: FastLoop, telemetry: TelemetrySource, poster: FakePoster, push: Callable[..., Pusher]
) -> None:
    poster.takes = 100.0
    pusher = push(poster)
    sending(loop, 1, telemetry)
    pusher.task.cancel()
    loop.settle()
    assert pusher.task.done() and poster.closed
    assert asyncio.all_tasks(loop) == set()
