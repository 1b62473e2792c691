"""What the relay makes of readings."""

from __future__ import annotations

import json
from typing import Any

import pytest

from mavproxy_gradys.relay.positions import Positions


def put(positions: Positions, **members: Any) -> None:
    reading = {
        "device": "uav-7",
        "id": "7",
        "seq": 1,
        "quantity": "position",
        "value": [-15.8, -47.9, 20.0],
        "time": 9,
    }
    positions.put(json.dumps({**reading, **members}).encode(), 100.0)


def forms(positions: Positions) -> list[dict[str, str]]:
    return [positions.form(vehicle) for vehicle in positions.take_changed()]


def test_a_form_has_the_fields_of_the_ground_station() -> None:
    positions = Positions()
    put(positions)
    put(positions, quantity="heading", value=91.5)
    put(positions, quantity="battery", value=80)
    assert forms(positions) == [
        {"id": "7", "lat": "-15.8", "lng": "-47.9", "alt": "20.0", "heading": "91.5", "battery_percent": "80.0",
         "device": "uav", "type": "102", "seq": "0", "ip": ""}
    ]  # fmt: skip
    assert forms(positions) == []


def test_two_devices_with_one_system_id_have_two_numbers_that_stay() -> None:
    positions = Positions()
    for device in ("north-7", "south-7", "buoy"):
        put(positions, device=device, id="" if device == "buoy" else "7")
    first = {form["id"] for form in forms(positions)}
    assert first == {"7", "1001", "1002"}
    put(positions, device="south-7", time=10)
    (form,) = forms(positions)
    assert form["id"] == "1002"  # by name: buoy, north-7, south-7


def test_without_a_position_nothing_is_sent_and_an_older_reading_changes_nothing() -> None:
    positions = Positions()
    put(positions, quantity="heading", value=1)
    assert forms(positions) == []
    put(positions, time=10)
    assert len(forms(positions)) == 1
    put(positions, time=9, value=[0, 0, 0])
    assert forms(positions) == []


@pytest.mark.parametrize("payload", [b"online", b"\xff", b"{}", b'{"device": 1}'])
def test_other_messages_are_refused(payload: bytes) -> None:
    with pytest.raises(ValueError):
        Positions().put(payload, 100.0)


def test_a_reading_from_the_future_hides_none_that_follow() -> None:
    positions = Positions()
    put(positions, time=9000, value=[1, 0, 0])
    assert [form["lat"] for form in forms(positions)] == ["1.0"]
    put(positions, time=100, value=[2, 0, 0])  # the vehicle's clock has been set right
    assert [form["lat"] for form in forms(positions)] == ["2.0"]
