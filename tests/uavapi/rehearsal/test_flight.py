from __future__ import annotations

import asyncio
import json
import math
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.files.rehearsals import request_file
from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.rehearsal.faults import fault_of
from mavproxy_uavapi.rehearsal.flight import Rehearsal
from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.rehearsal.record import METRES_PER_DEGREE, Record
from mavproxy_uavapi.rehearsal.report import Rehearsed, as_json
from mavproxy_uavapi.rehearsal.script_runs import ScriptRuns
from mavproxy_uavapi.rehearsal.virtual_time import VirtualLoop, run_in_virtual_time
from tests.support.rehearsed import record, sample

MISSION = {
    "items": [
        {"command": "NAV_TAKEOFF", "alt": 10},
        {"command": "NAV_WAYPOINT", "lat": -35.3631, "long": 149.16523, "alt": 10},
        {"command": "NAV_LAND"},
    ]
}


@pytest.fixture
def order(tmp_path: Path) -> Order:
    """A mission in wind."""
    (tmp_path / "m.json").write_text(json.dumps(MISSION))
    return Order((tmp_path / "m.json",), location="CMAC", wind="5,90", gps_noise=0.5, seed=3)


def flown(order: Order, *faults: str) -> Record:
    async def fly() -> Record:
        rehearsal = Rehearsal(order)
        async with rehearsal.up():
            assert rehearsal._companion.service.settings.flights == ""  # off: it is no flight of the real vehicle
            return await rehearsal.fly([fault_of(fault) for fault in faults])

    return run_in_virtual_time(fly(), order.speedup)


def test_same_seed_gives_the_same_flight_to_the_last_bit_until_a_gust(order: Order) -> None:
    calm, again, gusty = (flown(order, *faults) for faults in ((), (), ("wind_gust=25@8m:10",)))
    first, second, third = (as_json([Rehearsed((), record, ())]) for record in (calm, again, gusty))
    assert first == second != third
    assert '"losses": [{' in first
    ways = zip(calm.samples[1], gusty.samples[1], strict=False)
    assert max(math.dist((a.lat, a.lon), (b.lat, b.lon)) * METRES_PER_DEGREE for a, b in ways) > 0.5


def test_request_is_flown_as_it_says(order: Order, tmp_path: Path) -> None:
    readings = [
        (0, round((-35.363261 + n / METRES_PER_DEGREE) * 1e7), 1491652300, 592000, *[0] * 4, 3, 10) for n in (0, 9)
    ]
    body = {"track": "\n".join(map(str, readings)), "ground": 584.0, "transit": 12}
    (tmp_path / "r.json").write_bytes(request_file("/mission/fly-track", body, {}))
    record = flown(replace(order, files=(tmp_path / "r.json",), looks_ahead=False))
    assert record.failure == "" and record.samples[1][-1].armed is False
    (asked,) = record.asked.values()
    assert asked.verb == "/mission/fly-track" and asked.request["transit"] == 12
    assert record.highest(1) == pytest.approx(15, abs=1.0)  # RTL_ALT


@pytest.mark.parametrize("address", ["localhost:8000", "127.0.0.1:8123"])
def test_script_with_the_apis_address_in_it_flies_the_rehearsed_vehicle(
    order: Order, tmp_path: Path, address: str
) -> None:
    lines = ["import urllib.request", f'urllib.request.urlopen("http://{address}/command/arm")']
    (tmp_path / "hard.py").write_text("\n".join(lines))
    record = flown(replace(order, files=(tmp_path / "hard.py",), looks_ahead=False, api_ports=(8123,)))
    assert record.failure == "" and [asked.verb for asked in record.asked.values()] == ["/command/arm"]


def vision_flown(order: Order, **settings: Any) -> Record:
    """The record of vision's mission to a place 6 m north of home."""
    file = order.files[0].with_name("pad.json")
    file.write_bytes(request_file("/vision/mission", {"alt": 4, "north": 6, "east": 0}, settings))
    return flown(replace(order, files=(file,), looks_ahead=False))


def test_mission_by_camera_lands_on_a_tag_where_it_goes(order: Order) -> None:
    pytest.importorskip("cv2")
    record = vision_flown(order)
    (asked,) = record.asked.values()
    assert asked.state == "succeeded" and asked.detail.startswith("Landed on tag 0"), asked
    first, last = record.samples[1][0], record.samples[1][-1]
    assert (last.lat - first.lat) * METRES_PER_DEGREE == pytest.approx(6.0, abs=0.3) and not last.armed


def test_mission_by_camera_to_a_tag_that_lies_elsewhere_comes_home(order: Order) -> None:
    pytest.importorskip("cv2")
    record = vision_flown(order, sim_tags="0:0.30@60,0", leash=1, attempts=1)
    last = record.samples[1][-1]
    assert "no tag in sight" in record.failure and (last.mode, last.armed) == ("RTL", False)


def test_setting_of_the_camera_that_is_refused_is_why_nothing_flew(order: Order) -> None:
    pytest.importorskip("cv2")
    record = vision_flown(order, fov=500)
    assert record.failure == "vision: fov = 500: it takes a number from 5 to 170" and not record.asked
    with pytest.raises(LaunchError, match="fov"):
        vision_flown(replace(order, camera={"fov": 500}))


def test_vehicle_flies_its_mission_without_its_companion(order: Order) -> None:
    record = flown(order, "companion_killed@5m")
    assert record.failure == "" and record.missed == ()
    assert (record.samples[1][-1].mode, record.samples[1][-1].armed) == ("AUTO", False)
    assert not record.losses


def test_ten_at_once_have_ten_ports(order: Order) -> None:
    all_are_up = threading.Barrier(10)

    def port(_: int) -> str:
        async def up() -> str:
            rehearsal = Rehearsal(order)
            async with rehearsal.up():
                all_are_up.wait(60)
                return rehearsal.url

        loop = VirtualLoop(1.0)
        try:
            return loop.run_until_complete(up())
        finally:
            loop.end()

    with ThreadPoolExecutor(10) as threads:
        assert len(set(threads.map(port, range(10)))) == 10


@pytest.mark.parametrize(
    ("setting", "status", "mode", "asked"),
    [
        ("land", 1, "GUIDED", ["/vehicles/1/command/land"]),
        ("rtl", -9, "GUIDED", ["/vehicles/1/command/rtl"]),
        ("hold", 1, "GUIDED", ["/vehicles/1/movement/stop"]),
        ("nothing", 1, "GUIDED", []),
        ("land", 0, "GUIDED", []),
        ("land", 1, "LOITER", []),
    ],
)
def test_vehicle_of_a_script_that_dies_is_handled_as_the_setting_says(
    monkeypatch: pytest.MonkeyPatch, setting: str, status: int, mode: str, asked: list[str]
) -> None:
    rehearsal = Rehearsal(Order((Path("a.py"),), on_script_exit=setting))
    rehearsal._scripts = ScriptRuns(rehearsal.order, "", Path(), Path(), ())
    rehearsal._companion = SimpleNamespace(is_dead=False)  # type: ignore[assignment]
    rehearsal._scripts._processes = {1: SimpleNamespace(returncode=status)}  # type: ignore[dict-item]
    rehearsal.record = record(sample(0.0, height=5.0, mode=mode))
    asks: list[str] = []

    async def ask(_method: str, path: str) -> Any:
        asks.append(path)

    monkeypatch.setattr(rehearsal, "ask", ask)
    asyncio.run(rehearsal._after_deaths())
    assert asks == asked
