"""Parameters that MAVProxy knows: it may have fetched them before we were loaded, or by MAVLink FTP, which sends no
PARAM_VALUE.
"""

from __future__ import annotations

from collections.abc import Mapping

Key = tuple[int, int]  # system id, component id; as in MAVProxy's own table
Values = dict[str, float]


class ParameterWatch:
    """Finds what has changed in MAVProxy's tables since the last look."""

    def __init__(self) -> None:
        self._last_tables: dict[Key, Values] = {}

    def changes(self, tables: Mapping[Key, Mapping[str, float]]) -> dict[Key, Values]:
        """What is new or different in `tables`. To compare a thousand parameters takes some ten µs."""
        changed = {}
        for key, table in tables.items():
            before = self._last_tables.get(key, {})
            if table == before:
                continue
            changed[key] = {name: float(value) for name, value in table.items() if before.get(name) != value}
            self._last_tables[key] = dict(table)
        return {key: values for key, values in changed.items() if values}
