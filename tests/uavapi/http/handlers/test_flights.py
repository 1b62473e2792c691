"""Who may read what of a flight; `tests/uavapi/flights/test_recorder.py` has the rest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.flights.flight_store import Flight, FlightStore
from mavproxy_uavapi.http.handlers import flights
from tests.support import tokens
from tests.support.virtual_time import FastLoop
from tests.uavapi.http.conftest import Api


@pytest.fixture
def flight(api: Api, tmp_path: Path) -> Flight:
    """A flight in which a script printed something, and tokens of each role."""
    file = tokens.write(tmp_path / "tokens", tokens.ALL)
    api.service.settings = replace(api.service.settings, flights=str(tmp_path / "flights"), tokens=file)
    api.service.tokens.use(file)
    api.service.tokens.take()
    store = FlightStore(tmp_path / "flights")
    with store.making(1_778_500_800.0, "survey") as (begun, journal):
        journal.attach("script-square_20260511_120000_out.log", "text/plain", b"corner 1\n", 0)
        store.finish(begun, journal)
    return store.pack(begun.id)


@pytest.mark.parametrize(("name", "status"), [("tower", 403), ("anna", 403), ("boss", 200)])
def test_what_a_script_printed_is_for_admins_and_the_rest_for_all(
    api: Api, loop: FastLoop, flight: Flight, monkeypatch: pytest.MonkeyPatch, name: str, status: int
) -> None:
    asked: list[list[str]] = []

    async def export(command: list[str], _timeout: float) -> Any:
        asked.append(command)
        Path(command[command.index("--output") + 1]).write_bytes(b"PK")  # noqa: ASYNC240
        return SimpleNamespace(status=0)

    async def status_of(ending: str) -> int:
        async with api.client.get(f"/flights/{flight.id}{ending}", headers=who) as answer:
            return int(answer.status)

    monkeypatch.setattr(flights, "run_tool", export)
    who = tokens.bearer(name)
    assert loop.run(status_of(".mcap")) == status
    assert loop.run(status_of(".zip")) == 200
    assert asked[0][-1] == ("--without=" if name == "boss" else "--without=script-")
    assert list(api.get(f"/flights/{flight.id}", headers=who).body["files"]) == list(flight.files)
