from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.rehearsal import twins
from mavproxy_uavapi.rehearsal.twins import Twins
from tests.support.rehearsed import record, sample

END = {
    "latitude": 1.0,
    "longitude": 2.0,
    "altitude_above_home": 0.0,
    "mode": "LAND",
    "armed": False,
    "time_boot_ms": 9000,
}


class Truth:
    """A vehicle whose twins end at once, but those that lose something of `fails`."""

    system, offset = 1, 2.0

    def __init__(self, *fails: str) -> None:
        self._fails = fails
        self.began: list[str] = []

    async def tell(self, line: Mapping[str, Any]) -> None:
        self.began.append(line["fault"])
        if line["fault"] not in self._fails:
            await asyncio.to_thread(Path(line["file"]).write_text, json.dumps(END), encoding="utf-8")


def test_twins_fly_on_from_moments_of_the_flight_and_their_ends_are_its_losses(tmp_path: Path) -> None:
    truth, flown = Truth(), record(sample(5.0, height=10.0))
    flying = Twins(tmp_path)

    async def fly() -> None:
        for at in (5.0, 6.0, 15.0):
            flown.samples[1].append(sample(at, height=10.0))
            await asyncio.gather(*(flying.look([truth], flown) for _ in range(2)))  # type: ignore[list-item]
        await flying.end(flown)

    asyncio.run(fly())
    assert truth.began == ["silence", "ekf_bad"] * 2
    assert sorted((loss.at, loss.what, loss.seconds) for loss in flown.losses) == [
        (5.0, "gps", 2.0),
        (5.0, "link", 2.0),
        (15.0, "gps", -8.0),
        (15.0, "link", -8.0),
    ]
    assert not flown.said


def test_twin_that_never_ends_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(twins, "END_WITHIN", 0.2)
    flown = record(sample(5.0, height=10.0))
    flying = Twins(tmp_path)

    async def fly() -> None:
        await flying.look([Truth("ekf_bad")], flown)  # type: ignore[list-item]
        await flying.end(flown)

    asyncio.run(fly())
    assert [loss.what for loss in flown.losses] == ["link"]
    assert [(said.at, said.kind, said.text) for said in flown.said] == [
        (5.0, "twin", "where it would end without its gps is not known: its twin has not ended")
    ]
