"""What each type makes of each item, as ArduPilot's sources have it."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.table import (
    ATTITUDE_TIME,
    HARMLESS,
    KINDS,
    OF_TYPE,
    REASONS,
    Deed,
    deed_of,
    is_navigation,
)


def item(command: int, first: float = 0.0) -> MissionItem:
    return MissionItem(command, 3, (first, 0.0, 0.0, 0.0), 0, 0, 0.0)


def test_what_is_in_no_table_is_known_to_nobody() -> None:
    known = set().union(*(OF_TYPE[kind] for kind in KINDS))
    for command in range(65_536):
        if command not in known and command not in (
            mavlink.MAV_CMD_DO_FENCE_ENABLE,
            mavlink.MAV_CMD_NAV_GUIDED_ENABLE,
        ):
            assert all(deed_of(kind, item(command)) is None for kind in KINDS), command


@pytest.mark.parametrize("kind", KINDS)
def test_only_navigation_items_fly_stay_or_are_skipped(kind: str) -> None:
    moving = set(Deed) - {Deed.NOTHING, Deed.SPEED, Deed.JUMP, Deed.JUMP_TO_TAG}
    for command, deed in OF_TYPE[kind].items():
        assert (deed in moving) is is_navigation(command), command


def test_a_type_skips_what_its_autopilot_cannot_start() -> None:
    for command in (mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_LOITER_TO_ALT):
        assert deed_of("rover", item(command)) is Deed.SKIP
        assert deed_of("copter", item(command)) is not Deed.SKIP
    assert deed_of("copter", item(ATTITUDE_TIME)) is None and deed_of("plane", item(ATTITUDE_TIME)) is Deed.SKIP


def test_fence_may_be_switched_on_only_and_guidance_off_only() -> None:
    for kind in KINDS:
        fence = mavlink.MAV_CMD_DO_FENCE_ENABLE
        assert [deed_of(kind, item(fence, value)) for value in (0, 1, 2)] == [None, Deed.NOTHING, None]
    assert deed_of("copter", item(mavlink.MAV_CMD_NAV_GUIDED_ENABLE, 0)) is Deed.SKIP
    assert deed_of("copter", item(mavlink.MAV_CMD_NAV_GUIDED_ENABLE, 1)) is None


def test_a_vehicle_of_an_unknown_type_takes_only_what_moves_nothing() -> None:
    assert all(deed_of("other", item(command)) is Deed.NOTHING for command in HARMLESS)
    assert deed_of("other", item(mavlink.MAV_CMD_NAV_WAYPOINT)) is None


def test_each_reason_is_for_an_item_that_some_type_is_refused() -> None:
    assert all(
        any(deed_of(kind, item(command)) is None for kind in KINDS)
        for command in set(REASONS) - {mavlink.MAV_CMD_NAV_GUIDED_ENABLE}
    )
