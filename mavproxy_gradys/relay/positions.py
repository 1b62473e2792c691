"""The newest position of each device, and the form that a ground station takes. Pure: the clock is an argument."""

from __future__ import annotations

import math
from itertools import count

from mavproxy_gradys.bounded import Bounded
from mavproxy_gradys.forwarding.quantities import POSITION
from mavproxy_gradys.push.position_update import DEVICE, LOCATION
from mavproxy_gradys.station.fleet import FleetVehicle, vehicle
from mavproxy_gradys.station.newest import Newest, newest_of
from mavproxy_gradys.station.reading_row import decoded, reading_row

FIRST_FREE = 1001  # the first number for a device whose system id another device has
OLD = 10.0  # s after its measurement from which a reading says nothing of the present
MOST_DEVICES = 5000
MOST_QUANTITIES = 50  # of a device


class Device:
    """What is known of a device.

    Attributes:
        readings: the newest by quantity.
        number: its number for ground stations; None before its first update.
    """

    def __init__(self) -> None:
        self.readings: Bounded[str, Newest] = Bounded(MOST_QUANTITIES)
        self.number: int | None = None

    @property
    def at(self) -> float:
        """When its position was measured, s since 1970; -inf without a position."""
        position = self.readings.get(POSITION)
        return -math.inf if position is None else position.time


class Positions:
    """The newest readings of every device; beyond MOST_DEVICES that which was silent longest is forgotten.

    A ground station knows a device by a whole number only. The first device with a system id keeps it; every other
    device gets the next number from FIRST_FREE on.
    """

    def __init__(self) -> None:
        self._devices: Bounded[str, Device] = Bounded(MOST_DEVICES)
        self._taken = {0}  # numbers that a device has, or that nobody may have
        self._free = count(FIRST_FREE)
        self._changed: set[str] = set()

    def put(self, payload: bytes, now: float) -> None:
        """Add a reading as the MQTT sink publishes it; `now` is s since 1970.

        Raises:
            ValueError: it is not a reading, or by its time says nothing of where a device is now: of a clock that is
                ahead, nobody knows how old it is.
        """
        row = reading_row(decoded(payload))
        if abs(now - row.time) > OLD:
            when = f"{now - row.time:.0f} s ago" if row.time < now else "later than now: its clock is ahead"
            raise ValueError(f"{row.device!r:.40} measured it {when}")
        (newest,) = newest_of([row], now)
        device = self._devices.get(newest.device) or Device()
        before = device.readings.get(newest.quantity)
        if before is None or newest.time >= before.time:
            device.readings[newest.quantity] = newest
            self._devices[newest.device] = device
            self._changed.add(newest.device)

    def take_changed(self, now: float) -> list[FleetVehicle]:
        """The devices with a reading since the last call, and with a position of the present, by name.

        Args:
            now: s since 1970.
        """
        changed, self._changed = self._changed, set()
        present = [(name, self._devices[name]) for name in sorted(changed) if name in self._devices]
        known = [vehicle(list(device.readings.values())) for _, device in present if now - device.at <= OLD]
        return [one for one in known if one.lat is not None]

    def form(self, one: FleetVehicle) -> dict[str, str]:
        """The fields of a device's update; those that it does not report are left out."""
        fields = {
            "id": self._number(one),
            "lat": one.lat,
            "lng": one.lng,
            "alt": one.alt or 0.0,
            "ground_speed": one.speed,
            "heading": one.heading,
            "battery_percent": one.battery,
            "device": DEVICE,
            "type": LOCATION,
            "seq": 0,
            "ip": "",
        }
        return {name: str(value) for name, value in fields.items() if value is not None}

    def _number(self, one: FleetVehicle) -> int:
        device = self._devices[one.device]
        if device.number is None:
            own = int(one.id) if one.id.isascii() and one.id.isdigit() and len(one.id) < 4 else 0
            device.number = next(self._free) if own in self._taken else own
            if device.number < FIRST_FREE:
                self._taken.add(device.number)
        return device.number
