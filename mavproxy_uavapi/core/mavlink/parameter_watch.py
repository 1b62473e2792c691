"""Parameters that MAVProxy knows: it may have fetched them before we were loaded, or by MAVLink FTP, which sends no
PARAM_VALUE. Pure: the clock is an argument.
"""

from __future__ import annotations

from collections.abc import Mapping

Key = tuple[int, int]  # system id, component id; as in MAVProxy's own table
Values = dict[str, float]
PERIOD = 1.0  # s between two looks; comparing a thousand parameters takes some ten µs of the main loop


class ParameterWatch:
    """Finds what has changed in MAVProxy's tables since the last look."""

    def __init__(self) -> None:
        self._last_tables: dict[Key, Values] = {}
        self._next = 0.0

    def changes(self, tables: Mapping[Key, Mapping[str, float]], now: float) -> dict[Key, Values]:
        """What is new or different in `tables`, at most every PERIOD s of `now`."""
        if now < self._next:
            return {}
        self._next = now + PERIOD
        changed = {}
        for key, table in tables.items():
            before = self._last_tables.get(key, {})
            if table == before:
                continue
            changed[key] = {name: float(value) for name, value in table.items() if before.get(name) != value}
            self._last_tables[key] = dict(table)
        return {key: values for key, values in changed.items() if values}
