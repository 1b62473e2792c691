from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import BadRequest, NotFound
from mavproxy_uavapi.flights.flight_export import table, texts
from mavproxy_uavapi.flights.flight_file import attachments_of, messages_of
from mavproxy_uavapi.flights.flight_merge import merge
from mavproxy_uavapi.flights.flight_store import Flight, FlightStore
from mavproxy_uavapi.flights.topics import Topics
from mavproxy_uavapi.http.stream.stream_event import When, of_info

NOON = 1_778_500_800.0  # s since 1970


@pytest.fixture
def store(tmp_path: Path) -> FlightStore:
    return FlightStore(tmp_path / "flights")


def record(store: FlightStore, events: list[Any], parameters: bytes = b"", **versions: str) -> Flight:
    """A complete record of these events: kind, name, system, s after noon, info."""
    topics = Topics()
    with store.making(NOON, "it") as (flight, file):
        for kind, name, system, at, info in events:
            file.write(topics.records(of_info(kind, name, system, When(NOON + at, at), info)))
        if parameters:
            file.attach("parameters-1.param", "text/plain", parameters, 0)
        file.note("versions", versions)
        store.finish(Flight(flight.id, "it", "", (events[0][2],), flight.began), file)
    return store.pack(flight.id)


def places(system: int, begin: float, end: float, north: float) -> list[Any]:
    """Where a vehicle is, five times a second."""
    times = [begin + number / 5 for number in range(round((end - begin) * 5))]
    return [("view", "ned", system, at, {"position": {"x": north, "y": at, "z": -5.0}}) for at in times]


def said(system: int, at: float, text: str) -> Any:
    return "event", "statustext", system, at, {"severity": 6, "text": text}


def test_vehicles_of_two_records_are_in_one_by_time(store: FlightStore) -> None:
    first = record(store, places(1, 0.0, 4.0, 1.0), b"A 1\n", MAVProxy="1.8.70")
    second = record(store, places(2, 2.0, 6.0, 2.0), b"A 2\n", MAVProxy="1.8.75")
    flight = merge(store, [first.id, str(store.file(second))], "both")
    assert (flight.name, flight.vehicles, flight.began[11:19], flight.ended[11:19]) == (
        *("both", (1, 2)),
        *("12:00:00", "12:00:05"),
    )
    assert first.id in flight.notes and second.id in flight.notes
    assert flight.versions == {"MAVProxy": "1.8.70", "MAVProxy (2)": "1.8.75"}
    times = [seen.time for seen in messages_of(store.file(flight))]
    assert len(times) == first.messages + second.messages and times == sorted(times)
    assert {one.name: one.data for one in attachments_of(store.file(flight))} == {
        "parameters-1.param": b"A 1\n",
        "parameters-1-2.param": b"A 2\n",
    }


def test_vehicle_that_both_heard_is_there_once_and_gaps_are_filled(store: FlightStore) -> None:
    """The clock of the second is 30 ms ahead."""
    heard = [*places(1, 0.0, 2.0, 1.0), said(1, 2.0, "Arming motors"), *places(1, 6.0, 8.0, 1.0)]
    other = [*places(1, 0.03, 8.03, 2.0), said(1, 2.03, "Arming motors"), said(1, 7.0, "only here")]
    flight = merge(store, [record(store, heard).id, record(store, other).id], "both")
    file = store.file(flight)
    assert [row["text"] for row in texts(file)] == ["Arming motors", "only here"]
    assert sum(seen.topic == "/log" for seen in messages_of(file)) == 2
    seen = [(one.time - NOON, one.data["info"]["position"]["x"]) for one in messages_of(file, "uavapi.View")]
    assert {north for at, north in seen if at < 2.5} == {1.0}
    assert {north for at, north in seen if 3.2 < at < 6.0} == {2.0}
    steps = [after - before for (before, _), (after, _) in zip(seen, seen[1:], strict=False)]
    assert max(steps) < 1.3 and len(list(table(file, 1, 1.0))) >= 6


def test_what_is_said_twice_in_one_record_stays_so(store: FlightStore) -> None:
    again = [said(1, 0.0, "PreArm: no GPS"), said(1, 0.5, "PreArm: no GPS"), said(1, 9.0, "PreArm: no GPS")]
    flight = merge(store, [record(store, again).id], "one")
    assert len(list(texts(store.file(flight)))) == 3


def test_what_is_no_record_is_refused_and_leaves_nothing(store: FlightStore, tmp_path: Path) -> None:
    good = record(store, places(1, 0.0, 1.0, 1.0))
    torn, other = tmp_path / "torn.mcap", tmp_path / "other.mcap"
    torn.write_bytes(store.file(good).read_bytes()[:-20])
    other.write_bytes(b"not a record at all" * 10)
    for path in (torn, other):
        with pytest.raises(BadRequest, match=path.name):
            merge(store, [good.id, str(path)], "both")
    with pytest.raises(NotFound):
        merge(store, ["20260511-120000-none"], "both")
    with pytest.raises(OSError, match="absent"):
        merge(store, ["absent.mcap"], "both")
    assert [flight.id for flight in store.all()] == [good.id]


def test_the_command_merges_and_imports_records(
    store: FlightStore, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from mavproxy_uavapi.flights.commands import run

    one = record(store, places(1, 0.0, 1.0, 1.0))
    copy = tmp_path / "of-the-other-machine.mcap"
    copy.write_bytes(store.file(one).read_bytes())
    assert run(["--folder", str(store.folder), "import", str(copy)]) == 0
    assert run(["--folder", str(store.folder), "merge", one.id, str(copy), "--name", "both"]) == 0
    assert "'of-the-other-machine': vehicle 1" in capsys.readouterr().out
    newest = next(flight for flight in store.all() if flight.name == "both")
    assert newest.messages == one.messages
    assert json.loads((store.folder / f"{newest.id}.json").read_text())["state"] == "complete"
    assert run(["--folder", str(store.folder), "merge", "nothing"]) == 1
