"""Logs as ArduPilot's SITL 4.7 and MAVProxy wrote them; of most messages only each 20th or so is left."""

from __future__ import annotations

from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.flights.flight_export import table, texts
from mavproxy_uavapi.flights.flight_file import attachments_of
from mavproxy_uavapi.flights.flight_import import take
from mavproxy_uavapi.flights.flight_store import COMPLETE, FlightStore

CORPUS = Path(__file__).parents[2] / "corpus" / "flights"


@pytest.fixture
def store(tmp_path: Path) -> FlightStore:
    return FlightStore(tmp_path)


@pytest.mark.parametrize(
    ("name", "began", "mode", "highest", "text"),
    [
        ("arducopter-4.7.bin", "2026-11-26T06:26:24", "GUIDED", 5.0, "ArduCopter V4.7.0-dev"),
        ("arduplane-4.7.bin", "", "AUTO", 20.0, "ArduPlane V4.7.0-dev"),
        ("mavproxy-1.8.tlog", "", "GUIDED", 5.0, ""),
    ],
)
def test_a_log_of_another_program_is_a_record_with_its_times(
    store: FlightStore, name: str, began: str, mode: str, highest: float, text: str
) -> None:
    flight = take(store, CORPUS / name)
    assert (flight.state, flight.name, flight.vehicles) == (COMPLETE, Path(name).stem, (1,))
    assert flight.began.startswith(began) and flight.began < flight.ended
    rows = list(table(store.file(flight), 1, 1.0))
    assert mode in {row["mode"] for row in rows}
    assert max(row.get("relative_alt") or 0.0 for row in rows) > highest
    late = rows[-1]
    assert -90 < late["lat"] < 90 and late["battery_mv"] > 9000 and late["satellites"] >= 6
    assert any(one["text"].startswith(text) for one in texts(store.file(flight)))
    (parameters,) = attachments_of(store.file(flight))
    assert parameters.name == "parameters-1.param" and len(parameters.data.splitlines()) > 3


@pytest.mark.parametrize("data", [b"", b"\xa3\x95", b"no log at all" * 100])
@pytest.mark.parametrize("suffix", [".tlog", ".bin"])
def test_what_is_no_log_is_refused(store: FlightStore, tmp_path: Path, data: bytes, suffix: str) -> None:
    path = tmp_path / f"it{suffix}"
    path.write_bytes(data)
    with pytest.raises(BadRequest):
        take(store, path)
    assert store.all() == []
