"""The newest reading of each quantity of each device: what the fleet's table shows. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from mavproxy_gradys.station.reading_row import ReadingRow


class Newest(NamedTuple):
    """The newest reading of one quantity.

    Attributes:
        device, id, quantity, representation, value: as in `ReadingRow`.
        time: when it was measured, s since 1970 by the vehicle's clock.
        received: when the device's last one of this quantity was kept, s since 1970 by the store's clock.
    """

    device: str
    id: str
    quantity: str
    representation: str
    value: str
    time: float
    received: float


class NewestReadings:
    """The newest of all that was put in.

    Attributes:
        changed: those that are new since `take_changed`.
    """

    def __init__(self) -> None:
        self._all: dict[tuple[str, str], Newest] = {}
        self.changed: dict[tuple[str, str], Newest] = {}

    def put(self, readings: Iterable[Newest]) -> None:
        """Take readings; what a vehicle sends late replaces nothing, but shows that it is there."""
        for reading in readings:
            key = reading.device, reading.quantity
            known = self._all.get(key)
            if known is not None and reading.time < known.time:
                reading = known._replace(received=reading.received)  # noqa: PLW2901
            self._all[key] = self.changed[key] = reading

    def take_changed(self) -> list[Newest]:
        """Those that are new since the last call, by device and quantity."""
        changed, self.changed = self.changed, {}
        return [changed[key] for key in sorted(changed)]

    def put_back(self, readings: Iterable[Newest]) -> None:
        """Take back what `take_changed` gave: it could not be told."""
        self.changed = {**{(reading.device, reading.quantity): reading for reading in readings}, **self.changed}

    def all(self) -> list[Newest]:
        """All, by device and quantity."""
        return [self._all[key] for key in sorted(self._all)]


def newest_of(rows: Iterable[ReadingRow], received: float) -> Iterable[Newest]:
    """Rows that were kept at that time, as they are shown."""
    for row in rows:
        yield Newest(row.device, row.id, row.quantity, row.representation, row.value, row.time, received)
