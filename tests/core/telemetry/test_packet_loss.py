from __future__ import annotations

from collections.abc import Callable

import pytest

from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState


def test_packet_loss_counts_what_is_missing_in_the_sequence(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    for sequence in (1, 2, 5, 6):  # 0 was the heartbeat
        hear("attitude", sequence=sequence)
    assert state.packets.share == pytest.approx(2 / 7)


def test_sequence_wraps_around_without_loss(state: VehicleState, hear: Callable[..., VehicleState | None]) -> None:
    for sequence in range(1, 600):
        hear("attitude", sequence=sequence)
    assert (state.packets.received, state.packets.lost) == (600, 0)


def test_duplicate_and_late_messages_are_no_loss(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    for sequence in (1, 2, 2, 1, 3):
        hear("attitude", sequence=sequence)
    assert state.packets.share == 0.0


def test_what_is_missing_is_known_until_it_comes_late(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    hear("attitude", sequence=2)
    assert state.packets.has_any_since(0.0) and state.packets.lost == 1
    hear("attitude", sequence=1)
    assert not state.packets.has_any_since(0.0) and state.packets.lost == 0


def test_other_components_have_sequences_of_their_own(
    state: VehicleState, hear: Callable[..., VehicleState | None]
) -> None:
    hear("attitude", component=154, sequence=90)
    hear("attitude", sequence=1)
    assert state.packets.share == 0.0
