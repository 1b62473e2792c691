"""At which items an autopilot may go on with its mission."""

from __future__ import annotations

import asyncio
import math
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace.mission_guard import MissionGuard
from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.telemetry.vehicle_state import Received

Cmd = mavlink
WAYPOINT, JUMP, LAND_START, YAW, DELAY = (
    Cmd.MAV_CMD_NAV_WAYPOINT,
    Cmd.MAV_CMD_DO_JUMP,
    Cmd.MAV_CMD_DO_LAND_START,
    Cmd.MAV_CMD_CONDITION_YAW,
    Cmd.MAV_CMD_CONDITION_DELAY,
)


def starts(commands: list[int], current: int, restarts: float | None, mode: str = "AUTO") -> list[int]:
    items = [MissionItem(command, 3, (1.0, 1.0, 0.0, 0.0), 0, 0, 10.0) for command in commands]
    message = mavlink.MAVLink_mission_current_message(current, len(items), mavlink.MISSION_STATE_ACTIVE)
    parameters = {} if restarts is None else {"MIS_RESTART": restarts}
    state: Any = SimpleNamespace(
        newest=lambda _: Received(message, 5.0), parameters=parameters, trip=SimpleNamespace(deadline=0.1)
    )
    vehicle: Any = SimpleNamespace(state=state, clock=lambda: math.nan)
    return MissionGuard(vehicle, tuple).starts(items, mode)


@pytest.mark.parametrize(("restarts", "at"), [(0.0, [2]), (1.0, [1]), (None, [1, 2])])
def test_a_mission_goes_on_at_its_present_item_or_begins_anew(restarts: float | None, at: list[int]) -> None:
    assert starts([WAYPOINT] * 3, 2, restarts) == at


def test_return_by_the_mission_may_resume_it_once_whatever_mis_restart_is() -> None:
    """ArduCopter's `enter_auto_rtl` in AUTO: `set_force_resume` holds for the next switch to AUTO."""
    assert starts([WAYPOINT, WAYPOINT, LAND_START, WAYPOINT], 4, 1.0) == [1, 4]


@pytest.mark.parametrize("condition", [YAW, DELAY])
def test_a_mission_may_go_on_at_a_condition_whose_jump_is_taken_once_more(condition: int) -> None:
    """`AP_Mission::resume`: a jump that was the last one leads on to the next item instead."""
    assert starts([WAYPOINT, condition, JUMP, WAYPOINT], 1, 0.0) == [1, 2]
    assert starts([WAYPOINT, condition, WAYPOINT, JUMP, WAYPOINT], 1, 0.0) == [1]


def test_a_mission_may_be_uploaded_but_not_begun_before_the_first_fix() -> None:
    """Until then ArduPilot tells a latitude and a longitude of 0."""
    vehicle: Any = SimpleNamespace(state=SimpleNamespace(position=SimpleNamespace(place=(0.0, 0.0))))
    guard = MissionGuard(vehicle, tuple)
    items = [MissionItem(WAYPOINT, 3, (0.0, 0.0, 0.0, 0.0), -350000000, 1490000000, 10.0)]
    asyncio.run(guard.look_at_mission(items, from_here=False))
    with pytest.raises(OutsideEnvelope, match=r"item 1 .* is \d+ km away"):
        asyncio.run(guard.look_at_mission(items, from_here=True))
    vehicle.state.position.place = (-35.0, 29.0)
    with pytest.raises(OutsideEnvelope, match=r"item 1 .* is \d+ km away"):
        asyncio.run(guard.look_at_mission(items, from_here=False))
