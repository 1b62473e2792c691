"""The relay and a ground station that answers as the real one does.

The exchange was recorded with gradys-gs on Django 4.2 and Channels 3.0: 103 while a browser watches, 101 otherwise,
500 for an `id` that is not a whole number.
"""

from __future__ import annotations

import json
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net.addresses import station
from mavproxy_gradys.relay.relay import Pushes, Relay
from tests.support.virtual_time import FastLoop

ANSWER = {"id": 1, "type": 103, "seq": 0, "lat": 0, "lng": 0, "alt": 0, "DATA": "0"}


class GroundStation:
    """A ground station behind the relay's HTTP client.

    Attributes:
        updates: the forms of the updates that it answered with 200.
        down: whether it does not answer.
        closed: whether the client was closed.
    """

    def __init__(self) -> None:
        self.updates: list[dict[str, str]] = []
        self.down = self.closed = False

    async def post(self, url: str, body: bytes, content_type: str) -> Any:
        assert (urlsplit(url).path, content_type) == ("/update-info/", "application/x-www-form-urlencoded")
        if self.down:
            raise NotDelivered("no answer within 5 s")
        form = {name: values[0] for name, values in parse_qs(body.decode(), strict_parsing=False).items()}
        if not form["id"].isdigit():
            raise NotDelivered("it answers 500", reached=True)
        self.updates.append(form)
        return ANSWER

    async def close(self) -> None:
        self.closed = True


def take(relay: Relay, number: int, at: float, device: str = "uav") -> None:
    reading = {"device": f"{device}-{number}", "id": str(number), "seq": 1, "quantity": "position"}
    payload = json.dumps({**reading, "value": [-15.8, -47.9, 20.0], "time": at}).encode()
    relay.take(f"fleet/{number}/position", payload)


def rig(loop: FastLoop, *stations: GroundStation) -> tuple[Relay, list[Pushes], Any]:
    relay = Relay((urlsplit("mqtt://127.0.0.1"), 1883), "fleet/#", wall=lambda: 100.0)
    pushes = [Pushes(station("gs:8000"), poster) for poster in stations]
    return relay, pushes, loop.create_task(relay.push(pushes, 1.0))


def test_a_fleet_of_hundreds_is_on_every_ground_station(loop: FastLoop) -> None:
    first, second = GroundStation(), GroundStation()
    relay, pushes, task = rig(loop, first, second)
    for number in range(1, 251):
        for device in ("north", "south"):
            take(relay, number, 99.0, device)
    loop.pass_time(1.5)
    assert len({form["id"] for form in first.updates}) == len(first.updates) == 500
    assert first.updates == second.updates and pushes[0].sent == 500
    task.cancel()
    loop.pass_time(1)
    assert first.closed and second.closed


def test_a_vehicle_that_says_nothing_new_is_not_posted_again(loop: FastLoop) -> None:
    gs = GroundStation()
    relay, _, task = rig(loop, gs)
    take(relay, 1, 97.0)
    take(relay, 1, 98.0)
    loop.pass_time(5.5)
    assert len(gs.updates) == 1
    take(relay, 1, 99.0)
    loop.pass_time(1.5)
    assert len(gs.updates) == 2
    task.cancel()
    loop.pass_time(1)


def test_a_station_that_is_down_disturbs_no_other(loop: FastLoop, caplog: pytest.LogCaptureFixture) -> None:
    up, down = GroundStation(), GroundStation()
    down.down = True
    relay, pushes, task = rig(loop, down, up)
    for second in range(3):
        for number in range(1, 21):
            take(relay, number, 95.0 + second)
        loop.pass_time(1.0)
    loop.pass_time(1.0)
    assert (len(up.updates), pushes[0].sent, pushes[0].failed) == (60, 0, 60)
    down.down = False
    take(relay, 1, 99.0)
    loop.pass_time(1.5)
    assert [form["id"] for form in down.updates] == ["1"]
    assert [record.getMessage().split(": ")[0] for record in caplog.records] == [
        "http://gs:8000 does not take updates",
        "http://gs:8000 takes updates again",
    ]
    task.cancel()
    loop.pass_time(1)


def test_a_backlog_of_hours_is_not_posted_as_now(loop: FastLoop, caplog: pytest.LogCaptureFixture) -> None:
    gs = GroundStation()
    relay, _, task = rig(loop, gs)
    for age in (89.0, 60.0, 20.0):
        take(relay, 1, 100.0 - age)
        loop.pass_time(1.5)
    assert gs.updates == [] and "s ago" in caplog.records[0].getMessage()
    take(relay, 1, 99.0)
    loop.pass_time(1.5)
    assert len(gs.updates) == 1
    task.cancel()
    loop.pass_time(1)


def test_a_reading_on_a_topic_that_ends_like_a_status_is_one(loop: FastLoop) -> None:
    gs = GroundStation()
    relay, _, task = rig(loop, gs)
    reading = {"device": "uav-1", "id": "1", "seq": 1, "quantity": "position", "value": [1, 2, 3], "time": 99.0}
    relay.take("plant/status", json.dumps(reading).encode())
    loop.pass_time(1.5)
    assert len(gs.updates) == 1
    task.cancel()
    loop.pass_time(1)


def test_what_is_no_reading_is_left_out(loop: FastLoop) -> None:
    gs = GroundStation()
    relay, _, task = rig(loop, gs)
    for topic, payload in (("fleet/1/status", b"online"), ("fleet/1/alt", b"poison")):
        relay.take(topic, payload)
    loop.pass_time(2)
    assert gs.updates == []
    task.cancel()
    loop.pass_time(1)


def test_a_defect_is_reported_while_the_relay_goes_on(loop: FastLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    gs = GroundStation()
    relay, _, task = rig(loop, gs)
    with monkeypatch.context() as defective:
        defective.setattr(gs, "post", None)
        take(relay, 1, 97.0)
        loop.pass_time(1.5)
    assert [defect["message"] for defect in loop.defects] == ["a defect ended the posts to a ground station"]
    loop.defects.clear()
    take(relay, 1, 98.0)
    loop.pass_time(1.0)
    assert len(gs.updates) == 1
    task.cancel()
    loop.pass_time(1)
