"""The newest position of each device, and the form that a ground station takes. Pure: the clock is an argument."""

from __future__ import annotations

from itertools import count

from mavproxy_gradys.push.position_update import DEVICE, LOCATION
from mavproxy_gradys.station.fleet import FleetVehicle, vehicle
from mavproxy_gradys.station.newest import Newest, newest_of
from mavproxy_gradys.station.reading_row import decoded, reading_row

FIRST_FREE = 1001  # the first number for a device whose system id another device has


class Positions:
    """The newest readings of every device.

    A ground station knows a device by a whole number only. The first device with a system id keeps it; every other
    device gets the next number from FIRST_FREE on.
    """

    def __init__(self) -> None:
        self._readings: dict[str, dict[str, Newest]] = {}
        self._numbers: dict[str, int] = {}
        self._free = count(FIRST_FREE)
        self._changed: set[str] = set()

    def put(self, payload: bytes, now: float) -> None:
        """Add a reading as the MQTT sink publishes it; `now` is s since 1970.

        Raises:
            ValueError: it is not a reading.
        """
        (newest,) = newest_of([reading_row(decoded(payload))], now)
        known = self._readings.setdefault(newest.device, {})
        before = known.get(newest.quantity)
        if before is None or newest.time >= before.time:
            known[newest.quantity] = newest
            self._changed.add(newest.device)

    def take_changed(self) -> list[FleetVehicle]:
        """The devices with a position and a reading since the last call, by name."""
        changed, self._changed = self._changed, set()
        return [
            one for name in sorted(changed) if (one := vehicle(list(self._readings[name].values()))).lat is not None
        ]

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
        if one.device not in self._numbers:
            own = int(one.id) if one.id.isascii() and one.id.isdigit() and len(one.id) < 4 else 0
            taken = not own or own in self._numbers.values()
            self._numbers[one.device] = next(self._free) if taken else own
        return self._numbers[one.device]
