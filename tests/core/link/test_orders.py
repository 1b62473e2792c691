"""What raw messages that steer in GUIDED are read as: DO_REPOSITION and mission items that are for now."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.core.link.messages import GlobalTarget

RELATIVE, AMSL = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL
WAYPOINT, LAND = mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LAND
PLACE = (-350000000, 1490000000, 20.0)
THERE = orders.GoTo(GlobalTarget(-35.0, 149.0, 20.0))


def reposition(*parameters: float, frame: int = RELATIVE) -> Any:
    return mavlink.MAVLink_command_int_message(1, 1, frame, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, *parameters, *PLACE)


def item(current: int, command: int = WAYPOINT, frame: int = RELATIVE, mission_type: int = 0) -> Any:
    head = (1, 1, 0, frame, command, current, 1, 0.0, 0.0, 0.0, 0.0)
    return mavlink.MAVLink_mission_item_int_message(*head, *PLACE, mission_type)


def test_a_reposition_that_says_only_where_is_a_way_there() -> None:
    assert orders.order_of(reposition(-1, 0, 0, 0)) == THERE
    assert orders.order_of(reposition(-1, 1, 0, 0)) == THERE  # and it switches to GUIDED


@pytest.mark.parametrize(
    "message",
    [
        pytest.param(reposition(30, 0, 0, 0), id="a speed, which a rover takes"),
        pytest.param(reposition(-1, 0, 5000, 0), id="a radius, which a plane takes"),
        pytest.param(reposition(-1, 0, 0, 0, frame=AMSL), id="above the sea"),
        pytest.param(item(2, frame=AMSL), id="an item above the sea"),
        pytest.param(item(2, command=LAND), id="an item that is no waypoint"),
        pytest.param(item(2, mission_type=1), id="an item of a fence"),
        pytest.param(item(3), id="an altitude"),
    ],
)
def test_where_more_is_said_nobody_knows_where_it_leads(message: Any) -> None:
    assert isinstance(orders.order_of(message), orders.Unknown)


def test_an_item_for_now_is_a_way_there() -> None:
    assert orders.order_of(item(2)) == THERE
    head = (1, 1, 0, RELATIVE, WAYPOINT, 2, 1, 0.0, 0.0, 0.0, 0.0)
    assert orders.order_of(mavlink.MAVLink_mission_item_message(*head, -35.0, 149.0, 20.0)) == THERE


@pytest.mark.parametrize("frame", [RELATIVE, AMSL])
def test_an_item_of_an_upload_changes_the_mission(frame: int) -> None:
    assert orders.order_of(item(0, frame=frame)) == orders.ChangeMission()
