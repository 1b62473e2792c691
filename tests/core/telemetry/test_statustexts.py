from __future__ import annotations

from collections.abc import Callable

import pytest

from mavproxy_uavapi.core.telemetry.statustexts import CHUNK_TIMEOUT, KEPT
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState


def test_status_text_in_chunks_is_one_text(state: VehicleState, hear: Callable[..., VehicleState | None]) -> None:
    hear("statustext", at=3.0, text="a" * 50, id=7, chunk_seq=0)
    hear("statustext", at=3.0, text="another", id=0)
    assert state.statustexts.since(0.0) == ["another"]
    hear("statustext", at=3.1, text="b" * 50, id=7, chunk_seq=1)
    hear("statustext", at=3.2, text="end", id=7, chunk_seq=2)
    assert state.statustexts.since(0.0) == ["another", "a" * 50 + "b" * 50 + "end"]
    hear("statustext", at=3.3, text="again", id=7, chunk_seq=0)
    assert state.statustexts.since(3.3) == ["again"]


@pytest.mark.parametrize(
    ("lost", "text"), [((0,), "…bcd"), ((1,), "a…cd"), ((1, 2), "a…d"), ((0, 1), "…cd"), ((0, 1, 2), "…d")]
)
def test_lost_chunk_leaves_one_gap(
    state: VehicleState, hear: Callable[..., VehicleState | None], lost: tuple[int, ...], text: str
) -> None:
    for number, letter in enumerate("abcd"):
        if number not in lost:
            hear("statustext", text=letter * (50 if letter != "d" else 3), id=7, chunk_seq=number)
    expected = "".join(letter if letter == "…" else letter * (50 if letter != "d" else 3) for letter in text)
    assert state.statustexts.since(0.0) == [expected]


def test_text_whose_last_chunk_is_lost_is_reported_after_a_while(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    hear("statustext", at=3.0, text="a" * 50, id=7, chunk_seq=0)
    hear("attitude", at=3.0 + CHUNK_TIMEOUT - 0.1)
    assert state.statustexts.since(0.0) == []
    hear("attitude", at=3.1 + CHUNK_TIMEOUT)
    assert state.statustexts.since(0.0) == ["a" * 50]


def test_chunk_that_comes_twice_is_reported_once(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    for number, text in ((0, "a" * 50), (0, "a" * 50), (1, "end")):
        hear("statustext", text=text, id=7, chunk_seq=number)
    assert state.statustexts.since(0.0) == ["a" * 50 + "end"]


def test_texts_since_a_moment_include_it(state: VehicleState, hear: Callable[..., VehicleState | None]) -> None:
    for at, text in ((1.0, "one"), (2.0, "two"), (3.0, "three")):
        hear("statustext", at=at, text=text)
    assert state.statustexts.since(2.0) == ["two", "three"]


def test_old_status_texts_are_forgotten(state: VehicleState, hear: Callable[..., VehicleState | None]) -> None:
    for number in range(KEPT + 5):
        hear("statustext", text=str(number))
    texts = list(state.statustexts)
    assert (len(texts), texts[0].text) == (KEPT, "5")
