from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from mavproxy_uavapi.core.telemetry.fence_watch import FenceWatch


class Loader:
    """MAVProxy's list of one vehicle's fence."""

    def __init__(self, *items: str) -> None:
        self._items, self.expected_count = items, len(items)

    def count(self) -> int:
        return len(self._items)

    def item(self, number: int) -> str:
        return self._items[number]


def modules(**loaders: Loader) -> dict[str, Any]:
    by_system = {int(name.removeprefix("of_")): loader for name, loader in loaders.items()}
    return {"fence": SimpleNamespace(wploader_by_sysid=by_system)}


def test_a_fence_counts_once_and_when_all_of_it_is_there() -> None:
    watch, loader = FenceWatch(), Loader("a", "b")
    loader.expected_count = 3
    assert watch.changes(modules(of_1=loader)) == {}
    loader.expected_count = 2
    assert watch.changes(modules(of_1=loader)) == {1: ["a", "b"]}
    assert watch.changes(modules(of_1=loader)) == {}


def test_an_uploaded_fence_counts_until_mavproxy_loads_another_one() -> None:
    watch = FenceWatch()
    assert watch.changes(modules(of_1=Loader("old"))) == {1: ["old"]}
    watch.note(1, ["ours"])
    assert watch.changes(modules(of_1=Loader("old"))) == {}
    watch.forget()
    assert watch.changes(modules(of_1=Loader("old"))) == {1: ["ours"]}
    assert watch.changes(modules(of_1=Loader("new"))) == {1: ["new"]}


def test_an_uploaded_fence_counts_without_mavproxys_module() -> None:
    watch = FenceWatch()
    watch.note(1, ["ours"])
    watch.forget()
    assert watch.changes({}) == {1: ["ours"]}
