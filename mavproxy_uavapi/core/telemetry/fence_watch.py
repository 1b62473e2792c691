"""The fences that MAVProxy's module `fence` has loaded, and that we have uploaded. MAVProxy's main loop only."""

from __future__ import annotations

from typing import Any


class FenceWatch:
    """Finds which fences have changed since the last look."""

    def __init__(self) -> None:
        self._seen: dict[int, list[Any]] = {}
        self._loaded: dict[int, list[Any]] = {}  # by MAVProxy, at the last look
        self._uploaded: dict[int, tuple[list[Any] | None, list[Any]]] = {}  # by us; and what MAVProxy had loaded then

    def note(self, system: int, items: list[Any]) -> None:
        """A vehicle has this fence now, until MAVProxy loads another one."""
        self._uploaded[system] = self._loaded.get(system), items
        self._seen[system] = items

    def changes(self, modules: Any) -> dict[int, list[Any]]:
        """By system id, the items of each fence that is new or different.

        A fence that MAVProxy is still reading does not count yet.

        Args:
            modules: MAVProxy's public modules, by name.
        """
        module = modules.get("fence")
        loaders = {} if module is None else dict(module.wploader_by_sysid)
        for system, loader in loaders.items():
            items = [loader.item(number) for number in range(loader.count())]
            if len(items) == getattr(loader, "expected_count", 0):
                self._loaded[system] = items
        fences = dict(self._loaded)
        for system, (before, items) in list(self._uploaded.items()):
            if self._loaded.get(system) == before:
                fences[system] = items
            else:
                del self._uploaded[system]
        changed = {system: items for system, items in fences.items() if items != self._seen.get(system, [])}
        self._seen |= changed
        return changed

    def forget(self) -> None:
        """Treat every fence as new."""
        self._seen = {}
