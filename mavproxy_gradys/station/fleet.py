"""The present state of the fleet, and its alarms. Pure."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

from mavproxy_gradys.forwarding.quantities import POSITION
from mavproxy_gradys.station.newest import Newest
from mavproxy_gradys.station.reading_row import number_of
from mavproxy_gradys.station.store import FleetNow

FORGOTTEN = 24 * 3600.0  # s after its last reading until a vehicle leaves the table
BATTERY = ("battery_percent", "battery")  # quantities in %, in order of preference
SPEED = ("ground_speed", "speed")  # m/s
SILENT, LOW_BATTERY = "silent", "battery"
NUMBERS = {int, float}


@dataclass(frozen=True)
class FleetVehicle:
    """One vehicle.

    Attributes:
        device, id: its names.
        lat, lng, alt: degrees, m above home; None if not reported.
        heading, speed, battery: degrees, m/s, %; None if not reported.
        time: when its newest reading was measured, s since 1970 by its own clock.
        received: when its last reading was stored, s since 1970 by the store's clock.
        quantities: the reported quantities and their units.
    """

    device: str
    id: str
    lat: float | None
    lng: float | None
    alt: float | None
    heading: float | None
    speed: float | None
    battery: float | None
    time: float
    received: float
    quantities: dict[str, str]


@dataclass(frozen=True)
class AlarmLimits:
    """The limits of the alarms.

    Attributes:
        silent: s without a reading.
        battery: smallest %.
    """

    silent: float
    battery: float


class Alarm(NamedTuple):
    """An alarm of a vehicle: `kind` is SILENT or LOW_BATTERY."""

    device: str
    kind: str


def changes(before: FleetVehicle | None, now: FleetVehicle) -> dict[str, Any]:
    """The members of a vehicle that differ from `before`, and its device; all members if there is no `before`."""
    if before is None:
        return vars(now)
    known = vars(before)
    return {name: value for name, value in vars(now).items() if name == "device" or value != known[name]}


def vehicles(fleet: FleetNow) -> list[FleetVehicle]:
    """The vehicles with a reading in the last FORGOTTEN s, by name."""
    known = [vehicle(list(readings)) for _, readings in groupby(fleet.newest, lambda newest: newest.device)]
    return [one for one in known if fleet.now - one.received < FORGOTTEN]


def vehicle(readings: Sequence[Newest]) -> FleetVehicle:
    """The vehicle that sent these readings, one per quantity."""
    values = {newest.quantity: json.loads(newest.value) for newest in readings}
    lat, lng, alt = place_of(values.get(POSITION))
    return FleetVehicle(
        device=readings[0].device,
        id=readings[0].id,
        lat=lat,
        lng=lng,
        alt=alt,
        heading=first_number(values, ("heading",)),
        speed=first_number(values, SPEED),
        battery=first_number(values, BATTERY),
        time=max(newest.time for newest in readings),
        received=max(newest.received for newest in readings),
        quantities={newest.quantity: newest.representation for newest in readings},
    )


def place_of(value: Any) -> tuple[float | None, float | None, float | None]:
    """Latitude, longitude (degrees) and height of a position; all None if it is invalid."""
    if not isinstance(value, list) or len(value) < 2 or not NUMBERS.issuperset(map(type, value)):
        return None, None, None
    lat, lng, alt = (*map(float, value), None)[:3]
    if lat is None or lng is None or not (abs(lat) <= 90 and abs(lng) <= 180):
        return None, None, None
    return lat, lng, alt


def first_number(values: dict[str, Any], quantities: Iterable[str]) -> float | None:
    """The number of the first quantity that is reported."""
    return next((number_of(values[quantity]) for quantity in quantities if quantity in values), None)


def alarms(fleet_vehicles: Iterable[FleetVehicle], now: float, limits: AlarmLimits) -> list[Alarm]:
    """The alarms at `now` (s since 1970, the store's clock).

    A reading that was stored in the future came before that clock was set back: it says nothing of the present.
    """
    raised = []
    for one in fleet_vehicles:
        if abs(now - one.received) > limits.silent:
            raised.append(Alarm(one.device, SILENT))
        if one.battery is not None and one.battery < limits.battery:
            raised.append(Alarm(one.device, LOW_BATTERY))
    return raised
