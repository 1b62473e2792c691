"""Position updates in the form of the GrADyS ground station; they are kept in memory."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from mavproxy_gradys.bounded import Bounded
from mavproxy_gradys.forwarding.quantities import POSITION, POSITION_REPRESENTATION
from mavproxy_gradys.station.newest import Newest, newest_of
from mavproxy_gradys.station.reading_row import finite, reading_row, text, whole

ACTIVE = 5.0  # s without an update after which a device is `on_hold`
INACTIVE = 10.0  # s after which it is `inactive`
DEVICE_COLUMNS = ("id", "device", "lat", "lng", "alt", "heading", "battery_percent", "ip", "seq", "age_s", "status")
TABLE_NAMES = {"lng": "lon", "alt": "relative_alt"}  # what other names than the update's the CSV has
NUMBERS = {"id": whole, "type": whole, "seq": whole, "lat": finite, "lng": finite, "alt": finite}
FIELDS = {*DEVICE_COLUMNS, "type", "ground_speed", "air_speed", "ready_to_arm"}
LONGEST_FIELD = 200  # characters
MOST_DEVICES = 5000  # of further ones those that were silent longest are forgotten
SHOWN = {"heading": "deg", "ground_speed": "m/s", "battery_percent": "%"}  # quantities, and their units


def parse(form: Mapping[str, str]) -> dict[str, Any]:
    """Parse a device's update; number fields become numbers, unknown fields are left out.

    Raises:
        ValueError: a number field is not a number, or a field is too long.
        KeyError: `device` or `id` is missing.
    """
    device: dict[str, Any] = {name: text(value, LONGEST_FIELD) for name, value in form.items() if name in FIELDS}
    for name, number in NUMBERS.items():
        if name in device:
            device[name] = number(device[name])
    return {**device, "device": device["device"], "id": device["id"]}


def newest_of_update(device: Mapping[str, Any], now: float) -> Iterator[Newest]:
    """The readings for the fleet's table, of an update that arrived at `now` (s since 1970).

    Raises:
        ValueError: its names are too long.
    """
    named = {"device": f"{device['device']}-{device['id']}", "id": device["id"], "seq": 0, "time": now}
    if {"lat", "lng"} <= device.keys():
        where = [device["lat"], device["lng"], device.get("alt", 0.0)]
        position = {**named, "quantity": POSITION, "representation": POSITION_REPRESENTATION, "value": where}
        yield from newest_of([reading_row(position)], now)
    for quantity, unit in SHOWN.items():
        with contextlib.suppress(KeyError, ValueError):  # it is missing, or not a number
            value = finite(device[quantity])
            row = reading_row({**named, "quantity": quantity, "representation": unit, "value": value})
            yield from newest_of([row], now)


class Updates:
    """The newest update of each device.

    Args:
        clock: s since 1970.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._devices: Bounded[int, dict[str, Any]] = Bounded(MOST_DEVICES)

    def put(self, device: dict[str, Any]) -> None:
        """Add the result of `parse`."""
        self._devices[device["id"]] = {**device, "received": self._clock()}

    def devices(self) -> list[dict[str, Any]]:
        """Every device, with the age of its update and whether it is active."""
        now = self._clock()
        devices = []
        for _, device in sorted(self._devices.items()):
            age = now - device["received"]
            devices.append({**device, "age_s": round(age, 3), "status": status_of(age)})
        return devices


def status_of(age: float) -> str:
    """The status of a device whose last update is `age` s old."""
    return "active" if age < ACTIVE else "on_hold" if age < INACTIVE else "inactive"
