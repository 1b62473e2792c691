from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mavproxy_uavapi.core.errors import Busy, NotFound
from mavproxy_uavapi.flights.flight_file import attachments_of
from mavproxy_uavapi.flights.flight_store import COMPLETE, ENDED, Flight, FlightStore

NOON = 1_778_500_800.0  # s since 1970: 2026-05-11T12:00:00Z


def complete(store: FlightStore, at: float, name: str = "") -> Flight:
    flight, file = store.begin([1], at, name)
    file.attach("it", "text/plain", b"x" * 1000, 0)
    file.close(flight.about())
    store.save(replace(flight, state=ENDED))
    return store.pack(flight.id)


@pytest.fixture
def store(tmp_path: Path) -> FlightStore:
    return FlightStore(tmp_path / "flights")


def test_the_newest_comes_first_and_two_of_a_second_have_two_names(store: FlightStore) -> None:
    ids = [complete(store, at, name).id for at, name in ((NOON, ""), (NOON, ""), (NOON + 60, "Área 51 / norte"))]
    assert ids == ["20260511-120000-vehicle1", "20260511-120000-vehicle1-2", "20260511-120100-area-51-norte"]
    assert [flight.id for flight in store.all()] == sorted(ids, reverse=True)
    assert all(store.find(name).state == COMPLETE for name in ids)


def test_a_complete_one_has_its_size_and_hash(store: FlightStore) -> None:
    import hashlib

    flight = complete(store, NOON)
    data = store.file(flight).read_bytes()
    assert (flight.bytes, flight.sha256) == (len(data), hashlib.sha256(data).hexdigest())
    assert store.pack(flight.id) == flight, "packed already"


def test_beyond_the_quota_the_oldest_go(store: FlightStore) -> None:
    kept = [complete(store, NOON + minute * 60) for minute in range(5)]
    room = sum(flight.bytes for flight in kept[2:]) + 1
    assert [flight.id for flight in store.make_room(room)] == [kept[1].id, kept[0].id]
    assert len(list(store.folder.iterdir())) == 6


def test_what_a_crash_left_is_found_and_what_is_recorded_is_left(store: FlightStore) -> None:
    left, file = store.begin([1], NOON)
    now, other = store.begin([2], NOON)
    file.abandon()
    assert store.unpacked() == [left.id]
    assert store.pack(left.id).state == COMPLETE
    assert store.unpacked() == []
    other.close({})
    assert store.unpacked() == [now.id]


def test_one_that_cannot_be_begun_leaves_nothing(store: FlightStore, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_self: FlightStore, _flight: Flight) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FlightStore, "save", full)
    with pytest.raises(OSError, match="No space"):
        store.begin([1], NOON)
    with pytest.raises(OSError, match="No space"), store.making(NOON, "merged"):
        raise AssertionError("it was begun")
    assert list(store.folder.iterdir()) == []


def test_one_that_cannot_be_made_whole_leaves_nothing(store: FlightStore) -> None:
    with pytest.raises(ValueError, match="torn"), store.making(NOON, "merged") as (_, file):
        file.attach("it", "text/plain", b"x", 0)
        raise ValueError("torn")
    assert list(store.folder.iterdir()) == []


def test_what_another_mavproxy_records_is_neither_packed_nor_deleted(store: FlightStore) -> None:
    flight, file = store.begin([1], NOON)
    others = FlightStore(store.folder)
    assert others.unpacked() == []
    with pytest.raises(Busy):
        others.pack(flight.id)
    with pytest.raises(Busy):
        others.remove(flight)
    file.attach("it", "text/plain", b"whole", 0)
    file.close(flight.about())
    (attachment,) = attachments_of(others.file(others.pack(flight.id)))
    assert attachment.data == b"whole"


@pytest.mark.parametrize("name", ["", "..", "20260511-120000-../x", "20260511-120000-none"])
def test_nothing_else_is_a_flight(store: FlightStore, name: str) -> None:
    complete(store, NOON)
    with pytest.raises(NotFound):
        store.find(name)


def test_a_damaged_description_is_no_flight(store: FlightStore) -> None:
    flight = complete(store, NOON)
    (store.folder / f"{flight.id}.json").write_text("{")
    assert store.all() == []
