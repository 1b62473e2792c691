from __future__ import annotations

import asyncio
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.rehearsal.flight import Rehearsal
from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.rehearsal.record import BLIND, Sample
from mavproxy_uavapi.rehearsal.script_runs import ScriptRuns
from tests.support.rehearsed import record, sample


def test_rehearsal_is_recorded_as_no_flight_of_the_real_vehicle() -> None:
    name, _, keywords = Rehearsal(Order((Path("a.py"),)))._options(5769, Path()).module[0].partition(":")
    assert (name, json.loads(keywords)["flights"]) == ("uavapi", "off")


class Truth:
    """A vehicle of which the API knows late."""

    system = 1

    def __init__(self, lag: float) -> None:
        self.lag = lag

    async def sample(self) -> Sample:
        return sample(0.0)


@pytest.mark.parametrize(("lag", "is_judged"), [(1.0, True), (9.0, False)])
def test_flight_that_begins_after_the_machine_was_too_slow_is_not_judged(
    monkeypatch: pytest.MonkeyPatch, lag: float, is_judged: bool
) -> None:
    rehearsal = Rehearsal(Order((Path("a.py"),)))
    rehearsal._truths = [Truth(lag)]  # type: ignore[list-item]

    async def flown() -> None:
        return None

    async def fly() -> bool:
        before = ScriptRuns(rehearsal.order, "", Path())
        before.killed.set()
        rehearsal._scripts, rehearsal._run_dir = before, Path()
        await rehearsal._begin_record(())
        rehearsal._looks = asyncio.create_task(rehearsal._look())
        await asyncio.wait({rehearsal._looks}, timeout=0.2)
        monkeypatch.setattr(rehearsal, "_flown", flown)
        rehearsal._supervisor = SimpleNamespace(stop=asyncio.Event())  # type: ignore[assignment]
        record = await rehearsal.fly()
        rehearsal._looks.cancel()
        assert not rehearsal._scripts.killed.is_set()
        return not record.lag > BLIND

    assert asyncio.run(fly()) == is_judged


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
    rehearsal._scripts = ScriptRuns(rehearsal.order, "", Path())
    rehearsal._scripts._processes = {1: SimpleNamespace(returncode=status)}  # type: ignore[dict-item]
    rehearsal.record = record(sample(0.0, height=5.0, mode=mode))
    asks: list[str] = []

    async def ask(_method: str, path: str) -> Any:
        asks.append(path)

    monkeypatch.setattr(rehearsal, "ask", ask)
    asyncio.run(rehearsal._after_deaths())
    assert asks == asked
