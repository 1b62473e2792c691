from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink import mavwp

from mavproxy_uavapi.core.mission import mission_watch
from mavproxy_uavapi.core.mission.mission_watch import LoadedMissions, MissionWatch, wpl
from tests.support.messages import message_of

FENCE = 1


def item(seq: int, **fields: Any) -> Any:
    return message_of("mission_item_int", seq=seq, command=16, frame=3, x=-353632621, y=1491652374, z=20.0, **fields)


def test_a_list_that_passes_by_is_the_mission_once_all_of_it_has() -> None:
    watch = MissionWatch()
    watch.listen(1, item(0))
    watch.listen(1, message_of("mission_count", count=2))
    watch.listen(1, item(1))
    watch.listen(1, item(1))
    assert watch.newest == {}
    watch.listen(1, item(0, mission_type=FENCE))
    assert watch.newest == {}
    watch.listen(1, item(0))
    assert [one.z for one in watch.newest[1]] == [20.0, 20.0]
    watch.listen(1, message_of("mission_count", count=0))
    assert watch.newest[1] == []


def test_the_last_of_thousands_of_items_is_read_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """All at once held the asyncio thread for 44 ms with 5,000 items."""
    watch, read = MissionWatch(), []
    monkeypatch.setattr(mission_watch, "from_message", read.append)
    watch.listen(1, message_of("mission_count", count=3))
    for seq in range(3):
        watch.listen(1, item(seq))
        assert len(read) == seq + 1


def test_nonsense_is_no_mission_and_breaks_nothing() -> None:
    watch, nowhere = MissionWatch(), message_of("mission_item", seq=0, command=16, x=float("nan"), y=float("inf"))
    watch.put(1, [nowhere])
    watch.listen(1, message_of("mission_count", count=1))
    watch.listen(1, nowhere)
    watch.listen(1, message_of("mission_count", count=1))
    watch.listen(1, item(7))
    assert watch.newest == {}
    watch.listen(1, item(0, param1=float("nan")))
    assert "nan" in wpl(watch.newest[1])


def test_what_mavproxy_has_loaded_counts_once_and_when_it_is_whole() -> None:
    loader, watch = mavwp.MAVWPLoader(), LoadedMissions()
    modules = {"wp": SimpleNamespace(wploader_by_sysid={1: loader})}
    loader.expected_count = 2
    loader.add(item(0))
    assert list(watch.changes(modules)) == [] and list(watch.changes({})) == []
    loader.add(item(1))
    ((system, items),) = watch.changes(modules)
    assert (system, len(items)) == (1, 2)
    assert list(watch.changes(modules)) == []


def test_the_file_is_one_that_ground_stations_read(tmp_path: Path) -> None:
    watch = MissionWatch()
    watch.put(1, [item(0), item(1), message_of("mission_item_int", seq=2, command=178, frame=2, x=3, param2=5.0)])
    path = tmp_path / "mission.waypoints"
    path.write_text(wpl(watch.newest[1]))
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) == 3
    assert (round(loader.item(1).x, 7), round(loader.item(1).y, 7), loader.item(1).z) == (
        -35.3632621,
        149.1652374,
        20.0,
    )
    assert (loader.item(2).command, loader.item(2).param2, loader.item(2).x) == (178, 5.0, 3.0)
