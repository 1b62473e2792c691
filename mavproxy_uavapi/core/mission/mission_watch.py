"""The missions that vehicles are seen to have, by what passes by and by MAVProxy's own lists: nobody is asked."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from pymavlink import mavutil

from mavproxy_uavapi.core.mission.mission_files import MissionItem, from_message

mavlink = mavutil.mavlink

COUNT, ITEMS = "MISSION_COUNT", ("MISSION_ITEM_INT", "MISSION_ITEM")


class MissionWatch:
    """The newest mission of each vehicle. Asyncio thread only.

    Attributes:
        newest: items by system id, home first; of a vehicle that nobody has asked there is none.
    """

    def __init__(self) -> None:
        self.newest: dict[int, list[MissionItem]] = {}
        # How many are to come, and those that have, each read as it comes: thousands at once would hold the thread.
        self._coming: dict[int, tuple[int, dict[int, MissionItem | None]]] = {}

    def put(self, system: int, items: Sequence[Any]) -> None:
        """Take a whole mission, as messages; one with a place that is no number is none."""
        self._take(system, [_item(message) for message in items])

    def _take(self, system: int, items: Sequence[MissionItem | None]) -> None:
        if None not in items:
            self.newest[system] = [item for item in items if item is not None]

    def listen(self, system: int, message: Any) -> None:
        """Take a message of a vehicle, whoever asked for it."""
        name = message.get_type()
        if name == COUNT and message.mission_type == mavlink.MAV_MISSION_TYPE_MISSION:
            self._coming[system] = message.count, {}
            if message.count == 0:
                self.put(system, ())
        elif name in ITEMS and message.mission_type == mavlink.MAV_MISSION_TYPE_MISSION and system in self._coming:
            count, items = self._coming[system]
            if message.seq < count:
                items[message.seq] = _item(message)
            if len(items) == count:
                del self._coming[system]
                self._take(system, [items[number] for number in sorted(items)])


def _item(message: Any) -> MissionItem | None:
    """The item of a message; None where its place is no number."""
    return from_message(message) if math.isfinite(message.x) and math.isfinite(message.y) else None


class LoadedMissions:
    """Finds which missions MAVProxy's module `wp` has loaded since the last look. MAVProxy's main loop only."""

    def __init__(self) -> None:
        self._seen: dict[int, tuple[float, int]] = {}

    def changes(self, modules: Any) -> Iterator[tuple[int, list[Any]]]:
        """System id and items, as messages, of each mission that is new or different, and whole.

        Args:
            modules: MAVProxy's public modules, by name.
        """
        module = modules.get("wp")
        for system, loader in () if module is None else list(module.wploader_by_sysid.items()):
            now = loader.last_change, loader.count()
            is_whole = now[1] == getattr(loader, "expected_count", 0)
            if is_whole and now != self._seen.get(system, (0, 0)):
                self._seen[system] = now
                yield system, [loader.item(number) for number in range(now[1])]


def wpl(items: Sequence[MissionItem]) -> str:
    """A mission, home first, as the file that every ground station reads: QGC WPL 110."""
    lines = ["QGC WPL 110"]
    for number, item in enumerate(items):
        x, y = (item.x / 1e7, item.y / 1e7) if item.has_location else (float(item.x), float(item.y))
        params = (*item.params, x, y, item.z)
        texts = (f"{value:.8f}" for value in params)
        lines.append(
            "\t".join(
                [f"{number}\t{int(number == 0)}\t{item.frame}\t{item.command}", *texts, f"{item.autocontinue:d}"]
            )
        )
    return "\n".join(lines) + "\n"
