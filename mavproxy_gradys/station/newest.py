"""The newest reading of each quantity of each device, for the fleet's table. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from mavproxy_gradys.bounded import Bounded
from mavproxy_gradys.station.reading_row import ReadingRow

MOST = 20_000  # readings that the table shows; of further ones those that came longest ago leave it
LONGEST_SHOWN = 200  # characters of a value; a longer one is null in the table
LONGEST_UNIT = 64  # characters


class Newest(NamedTuple):
    """The newest reading of one quantity.

    Attributes:
        device, id, quantity, representation, value: as in `ReadingRow`.
        time: when it was measured, s since 1970 by the vehicle's clock; not later than it was stored, by the store's
            clock: a reading from the future would hide all that come before that time.
        received: when the device's last reading of this quantity was stored, s since 1970 by the store's clock.
    """

    device: str
    id: str
    quantity: str
    representation: str
    value: str
    time: float
    received: float


class NewestReadings:
    """The newest readings.

    Attributes:
        changed: those that have changed since the last `take_changed`.
    """

    def __init__(self) -> None:
        self._all: Bounded[tuple[str, str], Newest] = Bounded(MOST)
        self.changed: Bounded[tuple[str, str], Newest] = Bounded(MOST)

    def put(self, readings: Iterable[Newest]) -> None:
        """Add readings; a late one replaces no newer value, but updates `received`.

        A known one that was measured after the present reception came before the station's clock was set back.
        """
        for reading in readings:
            key = reading.device, reading.quantity
            known = self._all.get(key)
            if known is not None and reading.time < known.time <= reading.received:
                reading = known._replace(received=reading.received)  # noqa: PLW2901
            self._all[key] = self.changed[key] = reading

    def take_changed(self) -> list[Newest]:
        """Those that have changed since the last call, by device and quantity."""
        changed, self.changed = self.changed, Bounded(MOST)
        return [changed[key] for key in sorted(changed)]

    def put_back(self, readings: Iterable[Newest]) -> None:
        """Put back the result of `take_changed`, because it could not be written."""
        newer, self.changed = self.changed, Bounded(MOST)
        self.changed.update({(reading.device, reading.quantity): reading for reading in readings})
        self.changed.update(newer)

    def all(self) -> list[Newest]:
        """All readings, by device and quantity."""
        return [self._all[key] for key in sorted(self._all)]


def newest_of(rows: Iterable[ReadingRow], received: float) -> Iterable[Newest]:
    """The newest readings of rows that were stored at `received`."""
    for row in rows:
        value = row.value if len(row.value) <= LONGEST_SHOWN else "null"
        measured, unit = min(row.time, received), row.representation[:LONGEST_UNIT]
        yield Newest(row.device, row.id, row.quantity, unit, value, measured, received)
