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
        "time": 99,
    }
    positions.put(json.dumps({**reading, **members}).encode(), 100.0)


def forms(positions: Positions) -> list[dict[str, str]]:
    return [positions.form(vehicle) for vehicle in positions.take_changed(100.0)]


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


def test_what_a_clock_that_is_ahead_has_dated_is_not_posted_as_now() -> None:
    """Half an hour of a backlog may have come just now."""
    with pytest.raises(ValueError, match="its clock is ahead"):
        put(Positions(), time=100 + 1800)


def test_two_devices_with_one_system_id_have_two_numbers_that_stay() -> None:
    positions = Positions()
    for device in ("north-7", "south-7", "buoy"):
        put(positions, device=device, id="" if device == "buoy" else "7")
    first = {form["id"] for form in forms(positions)}
    assert first == {"7", "1001", "1002"}
    put(positions, device="south-7", time=100)
    (form,) = forms(positions)
    assert form["id"] == "1002"  # by name: buoy, north-7, south-7


def test_nothing_is_sent_without_a_position_or_for_an_older_reading() -> None:
    positions = Positions()
    put(positions, quantity="heading", value=1)
    assert forms(positions) == []
    put(positions, time=100)
    assert len(forms(positions)) == 1
    put(positions, time=99, value=[0, 0, 0])
    assert forms(positions) == []


@pytest.mark.parametrize("payload", [b"online", b"\xff", b"{}", b'{"device": 1}'])
def test_other_messages_are_refused(payload: bytes) -> None:
    with pytest.raises(ValueError):
        Positions().put(payload, 100.0)


def test_a_reading_from_the_future_hides_none_that_follow() -> None:
    positions = Positions()
    put(positions, time=109, value=[1, 0, 0])
    assert [form["lat"] for form in forms(positions)] == ["1.0"]
    put(positions, time=100, value=[2, 0, 0])  # the vehicle's clock has been set right
    assert [form["lat"] for form in forms(positions)] == ["2.0"]


def test_position_of_the_past_is_not_sent_with_another_quantity() -> None:
    positions = Positions()
    put(positions, time=95)
    assert len(forms(positions)) == 1
    heading = {"device": "uav-7", "id": "7", "seq": 2, "quantity": "heading", "value": 90, "time": 120}
    positions.put(json.dumps(heading).encode(), 120.0)
    assert positions.take_changed(120.0) == []


def test_a_flood_of_names_is_numbered_in_step_and_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mavproxy_gradys.relay.positions.MOST_DEVICES", 20)
    positions = Positions()
    put(positions, device="uav-7")
    for number in range(100):
        put(positions, device=f"x-{number}", quantity=f"q-{number}")
        put(positions, device=f"x-{number}")
    put(positions, device="uav-8", id="8")
    sent = forms(positions)
    assert len(sent) == 20 and sent[0]["id"] == "8" and len(positions._devices) == 20


def test_a_flood_of_quantities_hides_no_position() -> None:
    positions = Positions()
    for number in range(500):
        put(positions, quantity=f"q-{number}", value=1)
        put(positions)
    assert len(forms(positions)) == 1 and len(positions._devices["uav-7"].readings) <= 50
