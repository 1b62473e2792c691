"""The ways that a mission leads along."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_way import Setting, Stop, landing_items, ways

HERE = Stop(-35.0, 149.0, 5.0)
RELATIVE, AMSL, TERRAIN = 3, 0, 10
HOME_AMSL = 584.0


def item(command: int, lat: float = 0.0, lon: float = 0.0, alt: float = 0.0, frame: int = RELATIVE, **params: float):
    four = tuple(params.get(f"p{number}", 0.0) for number in range(1, 5))
    return MissionItem(command, frame, four, round(lat * 1e7), round(lon * 1e7), alt)


def waypoint(lat: float, alt: float = 10.0, frame: int = RELATIVE):
    return item(mavlink.MAV_CMD_NAV_WAYPOINT, lat, 149.0, alt, frame)


def led(*items: MissionItem, start: Stop | None = HERE, radius: float = 0.0, heights_matter: bool = True):
    return list(ways(items, Setting(start, HOME_AMSL, radius, heights_matter)))


def test_ways_lead_from_place_to_place() -> None:
    legs = led(waypoint(-35.001), waypoint(-35.002, 20.0))
    assert legs == [[HERE, Stop(-35.001, 149.0, 10.0)], [Stop(-35.001, 149.0, 10.0), Stop(-35.002, 149.0, 20.0)]]
    assert led(waypoint(-35.001), start=None) == [[Stop(-35.001, 149.0, 10.0)]]


def test_take_off_climbs_where_it_is_before_it_goes_on() -> None:
    takeoff = item(mavlink.MAV_CMD_NAV_TAKEOFF, alt=30.0)
    climb, leg = led(takeoff, waypoint(-35.001))
    assert climb == [HERE, HERE._replace(up=30.0), HERE._replace(up=30.0)]
    assert leg[0].up == 30.0
    assert led(takeoff, waypoint(-35.001), start=None) == [[Stop(-35.001, 149.0, 10.0)]]


def test_nothing_in_an_item_means_as_it_is() -> None:
    hover = item(mavlink.MAV_CMD_NAV_LOITER_TIME)
    keeps = item(mavlink.MAV_CMD_NAV_WAYPOINT, -35.001, 149.0, 0.0)
    assert led(hover, keeps) == [[HERE, HERE], [HERE, Stop(-35.001, 149.0, 5.0)]]


def test_heights_above_the_sea_count_from_home_and_terrain_is_refused_where_heights_matter() -> None:
    assert led(waypoint(-35.001, 600.0, AMSL))[0][1].up == 16.0
    with pytest.raises(OutsideEnvelope, match="terrain"):
        led(waypoint(-35.001, 20.0, TERRAIN))
    assert led(waypoint(-35.001, 20.0, TERRAIN), heights_matter=False)[0][1].lat == -35.001


def test_jump_leads_back() -> None:
    jump = item(mavlink.MAV_CMD_DO_JUMP, p1=1.0, p2=3.0)
    assert led(waypoint(-35.001), waypoint(-35.002), jump)[2] == [
        Stop(-35.002, 149.0, 10.0),
        Stop(-35.001, 149.0, 10.0),
    ]


@pytest.mark.parametrize(
    ("radius", "named", "wanted"), [(0.0, 40.0, 40.0), (0.0, -25.0, 25.0), (60.0, 0.0, 60.0), (0.0, 0.0, 10.0)]
)
def test_circles_are_ways_too(radius: float, named: float, wanted: float) -> None:
    turns = item(mavlink.MAV_CMD_NAV_LOITER_TURNS, -35.001, 149.0, 10.0, p1=2.0, p3=named)
    _, circle = led(turns, radius=radius)
    distances = [math.hypot(*offset(-35.001, 149.0, stop.lat, stop.lon)) for stop in circle]
    assert all(wanted <= distance <= 1.04 * wanted for distance in distances)


def test_landing_and_return_are_not_refused() -> None:
    land = item(mavlink.MAV_CMD_NAV_LAND, -35.001, 149.0, 0.0)
    home = item(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    assert led(land, home) == [[HERE, Stop(-35.001, 149.0, 5.0)]]
    assert led(item(mavlink.MAV_CMD_NAV_LAND)) == []


@pytest.mark.parametrize(
    "command",
    [
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
        mavlink.MAV_CMD_NAV_GUIDED_ENABLE,
        mavlink.MAV_CMD_NAV_SCRIPT_TIME,
        mavlink.MAV_CMD_NAV_FOLLOW,
        65_000,
        mavlink.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT,
        mavlink.MAV_CMD_DO_SET_HOME,
        mavlink.MAV_CMD_DO_REPOSITION,
    ],
)
def test_what_leads_nobody_knows_where_is_refused(command: int) -> None:
    with pytest.raises(OutsideEnvelope, match="mission item 1"):
        led(item(command, -35.0, 149.0, 10.0))


def test_cameras_and_speeds_lead_nowhere() -> None:
    camera = item(mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST, p1=10.0)
    speed = item(mavlink.MAV_CMD_DO_CHANGE_SPEED, p1=1.0, p2=5.0)
    region = item(mavlink.MAV_CMD_DO_SET_ROI_LOCATION, -36.0, 149.0, 0.0)
    assert led(camera, speed, region) == []


def test_items_that_land_or_return() -> None:
    land, start = item(mavlink.MAV_CMD_NAV_LAND), item(mavlink.MAV_CMD_DO_LAND_START)
    back = item(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    there = waypoint(-35.001)
    assert landing_items([]) == landing_items([there]) == frozenset()
    assert landing_items([there, land, there, back]) == {2, 4}
    assert landing_items([there, start, there, land]) == {2, 3, 4}
