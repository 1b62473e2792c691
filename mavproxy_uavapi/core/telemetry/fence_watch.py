"""The fences that MAVProxy's module `fence` has loaded. MAVProxy's main loop only."""

from __future__ import annotations

from typing import Any


class FenceWatch:
    """Finds which fences have changed since the last look."""

    def __init__(self) -> None:
        self._seen: dict[int, list[Any]] = {}

    def changes(self, modules: Any) -> dict[int, list[Any]]:
        """By system id, the items of each fence that is new or different.

        A fence that MAVProxy is still reading does not count yet.

        Args:
            modules: MAVProxy's public modules, by name.
        """
        module = modules.get("fence")
        loaders = {} if module is None else dict(module.wploader_by_sysid)
        changed = {}
        for system, loader in loaders.items():
            items = [loader.item(number) for number in range(loader.count())]
            if len(items) == getattr(loader, "expected_count", 0) and items != self._seen.get(system, []):
                changed[system] = self._seen[system] = items
        return changed

    def forget(self) -> None:
        """Treat every fence as new."""
        self._seen = {}
