"""The legs that a mission leads along."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.airspace.forecast import Pace
from mavproxy_uavapi.core.errors import OutsideEnvelope
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_legs import WANTED, MissionRoute, PathPoint, Setting
from mavproxy_uavapi.core.mission.mission_way import landing_places, route
from mavproxy_uavapi.core.mission.returns import return_height
from mavproxy_uavapi.core.mission.table import landing_starts, return_starts

HOME = (-35.0, 149.0)
HERE = PathPoint(*HOME, 5.0)
RELATIVE, AMSL, MISSION, TERRAIN = 3, 0, 2, 10
HOME_AMSL = 584.0
PACE = Pace(10.0, 2.5, 1.5)
Cmd = mavlink
NORTH = 1e-3  # degrees, about 111 m


def item(command: int, lat: float = 0.0, alt: float = 0.0, frame: int = RELATIVE, **params: float) -> MissionItem:
    four = tuple(params.get(f"p{number}", 0.0) for number in range(1, 5))
    lon = 149.0 if lat else 0.0
    return MissionItem(command, frame, four, round(lat * 1e7), round(lon * 1e7), alt)


def waypoint(steps: float, alt: float = 10.0, frame: int = RELATIVE, **params: float) -> MissionItem:
    return item(Cmd.MAV_CMD_NAV_WAYPOINT, -35.0 + steps * NORTH, alt, frame, **params)


def jump(to: int, times: int) -> MissionItem:
    return item(Cmd.MAV_CMD_DO_JUMP, p1=to, p2=times)


def led(
    *items: MissionItem, kind: str = "copter", start: PathPoint | None = HERE, starts: Any = (1,), **more: Any
) -> MissionRoute:
    given = {"home": HOME, "home_amsl": HOME_AMSL, **more}
    return route(items, Setting(kind, start, **given), starts)


def led_straight(*items: MissionItem, **more: Any) -> MissionRoute:
    """As `led`, of a plane, each leg as one: the part in which it turns, and the rest."""
    whole: list[Any] = []
    for leg in led(*items, kind="plane", **more).legs:
        if whole and whole[-1].margin > 0 and whole[-1].seq == leg.seq and whole[-1].end == leg.begin:
            leg = leg._replace(begin=whole.pop().begin)  # noqa: PLW2901
        whole.append(leg)
    return MissionRoute(tuple(whole))


def steps(way: MissionRoute) -> list[tuple[float, float]]:
    """Where the legs end: in steps north of home, and m up."""
    return [(round((leg.end.lat + 35.0) / NORTH, 3), round(leg.end.up, 2)) for leg in way.legs]


def test_ways_lead_from_place_to_place() -> None:
    way = led(waypoint(1), waypoint(2, 20.0))
    assert steps(way) == [(1, 10), (2, 20)] and not way.loops
    assert way.legs[0].begin == HERE and way.legs[1].begin == way.legs[0].end
    assert steps(led(waypoint(1), start=None)) == [(1, 10)]


@pytest.mark.parametrize("command", [Cmd.MAV_CMD_NAV_TAKEOFF, Cmd.MAV_CMD_NAV_VTOL_TAKEOFF])
def test_a_copter_climbs_where_it_stands_whatever_place_its_takeoff_has(command: int) -> None:
    assert steps(led(item(command, -35.0 + NORTH, 30.0), waypoint(0, 30.0))) == [(0, 30), (0, 30)]
    assert steps(led(item(command, 0.0, 2.0), start=HERE._replace(up=4.0))) == [(0, 4)]
    assert steps(led(item(command, 0.0, 0.0), start=HERE._replace(up=0.0))) == [(0, 1)]
    assert steps(led(item(command, 0.0, 30.0), waypoint(1, 10), start=None)) == [(1, 10)]


@pytest.mark.parametrize("frame", [RELATIVE, AMSL, MISSION])
def test_height_zero_is_as_each_type_has_it(frame: int) -> None:
    at_zero = -HOME_AMSL if frame != RELATIVE else 0.0
    assert steps(led(waypoint(1, 0.0, frame))) == [(1, 5)]
    assert steps(led_straight(waypoint(1, 0.0, frame)))[0] == (1, at_zero)
    nowhere = item(Cmd.MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, frame)
    assert steps(led(nowhere, kind="plane"))[0] == (0, 5)
    stays = item(Cmd.MAV_CMD_NAV_LOITER_UNLIM, -35.0 + NORTH, 0.0, frame)
    assert steps(led_straight(stays))[0] == (1, 5.0 if frame == RELATIVE else at_zero)
    assert steps(led(waypoint(1, 7.0, frame), kind="rover", start=HERE._replace(up=0.0))) == [(1, 0)]


def test_heights_amsl_count_from_home_terrain_is_refused_if_they_matter() -> None:
    assert steps(led(waypoint(1, 600.0, AMSL))) == steps(led(waypoint(1, 600.0, MISSION))) == [(1, 16)]
    with pytest.raises(OutsideEnvelope, match="terrain"):
        led(waypoint(1, 20.0, TERRAIN))
    assert len(led(waypoint(1, 20.0, TERRAIN), heights_matter=False).legs) == 1
    with pytest.raises(OutsideEnvelope, match="AMSL"):
        led(waypoint(1, 600.0, AMSL), home_amsl=None)


def test_markers_with_a_place_lead_nowhere() -> None:
    for command in (Cmd.MAV_CMD_DO_LAND_START, Cmd.MAV_CMD_DO_GO_AROUND, Cmd.MAV_CMD_DO_SET_ROI_LOCATION, 188):
        assert steps(led(waypoint(1), item(command, -35.0 + 5 * NORTH, 10.0), waypoint(2))) == [(1, 10), (2, 10)]


def test_rover_skips_what_it_cannot_do_and_goes_on_after_its_return() -> None:
    skipped = [item(c, -35.0 + 5 * NORTH) for c in (21, 22, 31, 82, 84, 85)]
    way = led(
        waypoint(1, p1=1), *skipped, waypoint(2), item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH), waypoint(1), kind="rover"
    )
    assert steps(way) == [(1, 0), (2, 0), (0, 0), (1, 0)]


def test_a_jump_is_flown_and_left_until_heights_repeat() -> None:
    way = led(waypoint(1, 0.0), waypoint(2, 20.0), jump(1, 3), waypoint(3))
    assert way.loops
    assert set(steps(way)) == {(1, 5), (2, 20), (1, 20), (3, 10)}
    assert steps(led(waypoint(1), jump(1, 0), waypoint(3))) == [(1, 10), (3, 10)]
    for_ever = led(waypoint(1), waypoint(2), jump(1, -1), waypoint(9))
    assert set(steps(for_ever)) == {(1, 10), (2, 10)}


def test_a_jump_to_an_item_without_a_place_leads_to_what_follows_it() -> None:
    speed = item(Cmd.MAV_CMD_DO_CHANGE_SPEED, p1=1.0, p2=5.0)
    way = led(waypoint(1), speed, waypoint(2), jump(2, 1))
    assert {leg.fastest.level for leg in way.legs[1:]} == {5.0} and way.legs[0].fastest.level == 10.0


def test_a_jump_to_a_tag_leads_to_the_first_of_that_number() -> None:
    tag, to_tag = item(Cmd.MAV_CMD_JUMP_TAG, p1=7.0), item(Cmd.MAV_CMD_DO_JUMP_TAG, p1=7.0, p2=-1.0)
    assert set(steps(led(waypoint(1), tag, waypoint(2), to_tag, waypoint(9)))) == {(1, 10), (2, 10)}
    assert steps(led(waypoint(1), to_tag, waypoint(9))) == [(1, 10)], "a jump to nowhere ends a mission"


def test_jumps_without_end_and_without_a_leg_end_the_mission() -> None:
    assert steps(led(waypoint(1), jump(2, -1), waypoint(9))) == [(1, 10)]
    assert steps(led(waypoint(1), jump(2, -1), kind="plane"))[-1][0] != 1, "a plane returns then"


def test_heights_that_never_repeat_are_refused() -> None:
    takeoff = item(Cmd.MAV_CMD_NAV_VTOL_TAKEOFF, alt=0.2)
    with pytest.raises(OutsideEnvelope, match="too many ways"):
        led(takeoff, jump(1, -1), kind="plane", parameters={"Q_ENABLE": 1.0})


def test_it_begins_at_each_item_at_which_it_may() -> None:
    assert steps(led(waypoint(1), waypoint(2), starts=[2])) == [(2, 10)]
    either = led(waypoint(1), waypoint(2), starts=[1, 2])
    assert either.loops and {leg.begin for leg in either.legs if leg.end.lat > -35.0 + 1.5 * NORTH} == {
        HERE, PathPoint(-35.0 + NORTH, 149.0, 10.0)
    }  # fmt: skip


@pytest.mark.parametrize(("kind", "named", "wanted"), [("copter", -25.0, 25.0), ("plane", 0.0, 60.0)])
def test_circles_are_ways_too(kind: str, named: float, wanted: float) -> None:
    turns = item(Cmd.MAV_CMD_NAV_LOITER_TURNS, -35.0 + NORTH, 10.0, p1=2.0, p3=named)
    way = led(turns, kind=kind, radius=60.0 if kind == "plane" else 0.0)
    on_it = [math.hypot(*offset(-35.0 + NORTH, 149.0, leg.end.lat, leg.end.lon)) for leg in way.legs if leg.seq == 1]
    assert max(on_it) == pytest.approx(wanted / math.cos(math.pi / 12), rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "command", "first", "seconds"),
    [
        ("plane", "NAV_LOITER_TIME", 600.0, 600.0),
        ("plane", "NAV_LOITER_TURNS", 5.0, 5 * math.tau * 60 / 10),
        ("copter", "NAV_LOITER_TURNS", 5.0, 5 * math.tau * 60 / math.sqrt(2.5 * 60 / 2)),
        ("copter", "NAV_LOITER_TURNS", 0.5, math.tau * 60 / math.sqrt(2.5 * 60 / 2)),
    ],
)
def test_all_rounds_of_a_circle_take_their_time(kind: str, command: str, first: float, seconds: float) -> None:
    """For the battery's reserve it counted as one round, whatever the item said."""
    circle = item(getattr(Cmd, f"MAV_CMD_{command}"), -35.0 + 5 * NORTH, 10.0, p1=first, p3=60.0)
    legs = [leg for leg in led(circle, kind=kind, radius=60.0).legs if leg.circles and leg.seq == 1]
    lasts = sum(math.hypot(*offset(*leg.begin[:2], *leg.end[:2])) / leg.slowest.level for leg in legs)
    assert lasts == pytest.approx(seconds, abs=25.0), "along a polygon, and the way onto it"
    fastest = math.sqrt(2.5 * 60 / 2) if kind == "copter" else 10.0
    assert [leg.fastest.level for leg in legs] == pytest.approx([fastest] * len(legs)), "AC_Circle::calc_velocities"


def test_a_copter_leaves_a_circle_where_its_turns_end() -> None:
    for turns, side in ((2.0, -1), (0.5, 1)):
        circle = item(Cmd.MAV_CMD_NAV_LOITER_TURNS, -35.0 + NORTH, 10.0, p1=turns, p3=20.0)
        begin = led(circle, waypoint(5)).legs[-1].begin
        assert offset(-35.0 + NORTH, 149.0, begin.lat, begin.lon)[0] == pytest.approx(20.0 * side, abs=0.1)


def test_a_copter_goes_on_circling_in_a_delay_and_leaves_anywhere() -> None:
    circle = item(Cmd.MAV_CMD_NAV_LOITER_TURNS, -35.0 + NORTH, 10.0, p1=1.0, p3=20.0)
    delay = item(Cmd.MAV_CMD_NAV_DELAY, p1=9.0)
    assert [leg.margin for leg in led(circle, delay, waypoint(5), waypoint(6)).legs][-2:] == [20.0, 0.0]


def test_loiter_to_alt_goes_there_before_it_climbs_or_sinks_even_to_zero() -> None:
    change = item(Cmd.MAV_CMD_NAV_LOITER_TO_ALT, -35.0 + NORTH, 0.0)
    assert steps(led(change)) == [(1, 5), (1, 0)]


def test_landing_is_level_to_above_its_place_and_its_descent_is_marked() -> None:
    way = led(waypoint(1, 20.0), item(Cmd.MAV_CMD_NAV_LAND, -35.0 + 2 * NORTH, 3.0), waypoint(9))
    assert steps(way) == [(1, 20), (2, 20), (2, 0)]
    assert [leg.is_last for leg in way.legs] == [False, False, True]
    glide = led_straight(waypoint(1, 20.0), item(Cmd.MAV_CMD_NAV_LAND, -35.0 + 2 * NORTH, 3.0)).legs[1]
    assert glide.lands and not glide.is_last and glide.end.up == 3.0


def test_a_takeoff_behind_a_landing_goes_on_from_the_ground() -> None:
    land, takeoff = item(Cmd.MAV_CMD_NAV_LAND), item(Cmd.MAV_CMD_NAV_TAKEOFF, alt=8.0)
    delay = item(Cmd.MAV_CMD_NAV_DELAY, p1=3.0)
    assert steps(led(waypoint(1), land, delay, takeoff, waypoint(2)))[-2:] == [(1, 8), (2, 10)]


def test_a_copter_returns_as_its_parameters_say() -> None:
    back = item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    assert steps(led(waypoint(1), back, parameters={"RTL_ALT": 3000.0})) == [(1, 10), (1, 30), (0, 30), (0, 0)]
    assert steps(led(waypoint(1), back, parameters={"RTL_ALT_M": 30.0}))[1] == (1, 30)
    near = PathPoint(-35.0 + 2e-5, 149.0, 5.0)
    assert return_height({"RTL_ALT": 3000.0}, near, HOME) == pytest.approx(3 * 2e-5 * 111318.8, abs=0.01)
    assert return_height({"RTL_ALT": 3000.0, "RTL_CONE_SLOPE": 0.0}, near, HOME) == 30.0
    with pytest.raises(OutsideEnvelope, match="home is not known"):
        led(waypoint(1), back, home=None)
    assert steps(led(waypoint(1), back, home=None, start=None)) == [(1, 10)]
    with pytest.raises(OutsideEnvelope, match="rally"):
        led(waypoint(1), back, has_rally=True)


def test_a_plane_returns_at_the_end_of_its_mission_and_may_land_then() -> None:
    way = led(waypoint(1, 50.0), kind="plane", radius=60.0, parameters={"RTL_ALTITUDE": 80.0})
    turning, home = [(leg, step) for leg, step in zip(way.legs, steps(way), strict=True) if leg.seq == 2][:2]
    assert turning[0].margin > 0 and home[1] == (0, 80)
    start, land = item(Cmd.MAV_CMD_DO_LAND_START), item(Cmd.MAV_CMD_NAV_LAND, -35.0 + 3 * NORTH)
    stays = item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    lands = led(
        waypoint(1, 50.0), stays, start, land, kind="plane", parameters={"RTL_ALTITUDE": 80.0, "RTL_AUTOLAND": 1}
    )
    assert (3, 0) in steps(lands) and (3, 0) not in steps(led(waypoint(1, 50.0), stays, start, land, kind="plane"))


def test_a_plane_without_hover_motors_passes_over_what_needs_them() -> None:
    for command in (Cmd.MAV_CMD_NAV_VTOL_LAND, Cmd.MAV_CMD_NAV_PAYLOAD_PLACE):
        there = item(command, -35.0 + 4 * NORTH, 0.0)
        assert 4 not in [north for north, _ in steps(led(waypoint(1, 50.0), there, kind="plane"))]
        hovers = led(waypoint(1, 50.0), there, kind="plane", parameters={"Q_ENABLE": 1.0})
        assert (4, 50) in steps(hovers) and (4, 0) in steps(hovers)


def test_a_plane_flies_on_behind_a_waypoint_that_says_so() -> None:
    way = led(waypoint(1, 50.0, p3=100.0), waypoint(1, 50.0, p1=1.0), kind="plane", start=HERE._replace(up=50.0))
    assert (pytest.approx(1 + 100 / 111.3, abs=0.01), 50) in steps(way)
    onward = next(leg for leg in way.legs if leg.seq == 2)
    assert onward.begin == onward.end or onward.margin >= 100, "and its next leg begins at the waypoint itself"


def test_speeds_count_from_their_item_on_and_behind_a_condition_perhaps() -> None:
    def levels(*items: MissionItem, kind: str = "copter") -> list[tuple[float, float]]:
        return [
            (leg.fastest.level, leg.slowest.level) for leg in led(*items, kind=kind).legs if leg.seq <= len(items)
        ]

    slow = item(Cmd.MAV_CMD_DO_CHANGE_SPEED, p1=1.0, p2=3.0)
    assert levels(waypoint(1), slow, waypoint(2)) == [(10, 10), (3, 3)]
    assert levels(item(Cmd.MAV_CMD_CONDITION_DELAY, p1=5.0), slow, waypoint(2)) == [(10, 3)]
    assert levels(slow, waypoint(2), kind="plane") == [(10, 3)] * 2, "it turns first"
    assert levels(item(Cmd.MAV_CMD_DO_CHANGE_SPEED, p1=1.0, p2=-1.0), waypoint(1)) == [(10, 10)]
    descent = item(Cmd.MAV_CMD_DO_CHANGE_SPEED, p1=3.0, p2=0.5)
    assert led(descent, waypoint(1)).legs[0].fastest == PACE._replace(descent=0.5)


@pytest.mark.parametrize(
    ("kind", "parameters", "back", "onward"),
    [
        ("copter", {}, 10.0, None),
        ("copter", {"RTL_SPEED": 700.0}, 7.0, None),
        ("rover", {}, 10.0, 10.0),
        ("rover", {"RTL_SPEED": 7.0}, 7.0, 7.0),
    ],
)
def test_return_is_as_fast_as_the_parameters_say_not_as_the_mission(
    kind: str, parameters: dict[str, float], back: float, onward: float | None
) -> None:
    """As ArduCopter's mode_rtl.cpp and Rover's mode_rtl.cpp have it; a rover drives on as fast."""
    slow, returns = item(Cmd.MAV_CMD_DO_CHANGE_SPEED, p1=1.0, p2=4.0), item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    items = slow, waypoint(3), returns, *([waypoint(2)] if onward else [])
    legs = led(*items, kind=kind, parameters=parameters).legs
    assert {leg.fastest.level for leg in legs if leg.seq == 2} == {4.0}
    assert {leg.fastest.level for leg in legs if leg.seq == 3} == {back}
    assert {leg.fastest.level for leg in legs if leg.seq == 4} == ({onward} if onward else set())


@pytest.mark.parametrize(
    ("kind", "parameter", "by"),
    [
        ("copter", {"OA_TYPE": 2.0}, Cmd.MAV_CMD_NAV_WAYPOINT),
        ("rover", {"OA_TYPE": 1.0}, Cmd.MAV_CMD_NAV_WAYPOINT),
        ("rover", {"SAIL_ENABLE": 1.0}, Cmd.MAV_CMD_NAV_WAYPOINT),
        ("plane", {"TERRAIN_FOLLOW": 1.0}, Cmd.MAV_CMD_NAV_WAYPOINT),
        ("copter", {"RTL_ALT_TYPE": 1.0}, Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH),
        ("plane", {"Q_RTL_MODE": 2.0}, Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH),
        ("plane", {"Q_RTL_MODE": 3.0}, Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH),
        ("plane", {"LAND_TYPE": 1.0}, Cmd.MAV_CMD_NAV_LAND),
    ],
)
def test_a_parameter_that_has_a_vehicle_fly_other_ways_is_named(
    kind: str, parameter: dict[str, float], by: int
) -> None:
    there, other = item(by, -35.0 + 2 * NORTH, 50.0), item(Cmd.MAV_CMD_NAV_LOITER_UNLIM, -35.0 + NORTH, 50.0)
    (name,) = parameter
    with pytest.raises(OutsideEnvelope, match=f"item 1.*{name}"):
        led(there, kind=kind, parameters=parameter)
    assert (name,) in WANTED[kind], "it is asked for"
    led(there, kind=kind, parameters={name: 0.0})
    if by != Cmd.MAV_CMD_NAV_WAYPOINT:
        led(other, kind=kind, parameters=parameter)
    elif name == "TERRAIN_FOLLOW":
        led(there, other, kind=kind, parameters=parameter, heights_matter=False)


@pytest.mark.parametrize(
    ("parameters", "ahead"), [({"RTL_CLIMB_MIN": 20.0}, 190.0), ({"FLIGHT_OPTIONS": 16.0}, 285.0), ({}, 0.0)]
)
def test_a_plane_that_climbs_before_it_turns_home_is_so_far_beside_its_way(
    parameters: dict[str, float], ahead: float
) -> None:
    """ArduPlane's mode_rtl.cpp limits its bank until then."""
    air: Any = {"kind": "plane", "start": HERE._replace(up=50.0), "radius": 60.0}
    given = {"RTL_ALTITUDE": 80.0, **parameters}
    home = [leg for leg in led(waypoint(20, 50.0), **air, parameters=given).legs if leg.seq == 2]
    assert ahead + 40.0 <= home[0].margin <= ahead + 110.0, "and two radii of the turn"


def test_a_quadplane_that_lands_after_its_return_sinks_anywhere_near_home() -> None:
    air: Any = {"kind": "plane", "start": HERE._replace(up=50.0), "radius": 60.0, "fastest": Pace(25.0, 9.0, 9.0)}
    down = led(waypoint(20, 50.0), **air, parameters={"RTL_ALTITUDE": 80.0, "Q_RTL_MODE": 1.0}).legs[-1]
    assert down.lands and (down.begin.up, down.end) == (80.0, PathPoint(*HOME, 0.0))
    assert down.margin == pytest.approx(156.25), "QuadPlane::stopping_distance"
    assert not any(leg.lands for leg in led(waypoint(20, 50.0), **air, parameters={"RTL_ALTITUDE": 80.0}).legs)


def test_plane_on_its_return_path_may_begin_on_each_of_its_legs() -> None:
    """RTL_AUTOLAND 4: `jump_to_closest_mission_leg`; without DO_LAND_START it was taken to circle at home."""
    items = waypoint(1, 50.0), item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH), item(188), waypoint(7, 50.0)
    assert (7, 50) in steps(led(*items, kind="plane", parameters={"RTL_AUTOLAND": 4.0}))


@pytest.mark.parametrize("autoland", [1.0, 4.0])
def test_a_return_that_leads_into_the_mission_again_ends_when_it_repeats(autoland: float) -> None:
    """Without a landing behind its DO_LAND_START the walk went on for ever, and with it the upload."""
    items = item(Cmd.MAV_CMD_DO_LAND_START), item(188), waypoint(1, 50.0)
    assert led(*items, kind="plane", parameters={"RTL_AUTOLAND": autoland}).loops


def test_waits_are_told() -> None:
    way = led(waypoint(1, p1=4.0), item(Cmd.MAV_CMD_NAV_DELAY, p1=0.0), item(Cmd.MAV_CMD_NAV_LOITER_TIME, p1=9.0))
    assert [leg.waits for leg in way.legs] == [4.0, math.inf, 9.0]


@pytest.mark.parametrize(
    "command",
    [
        Cmd.MAV_CMD_NAV_SPLINE_WAYPOINT,
        Cmd.MAV_CMD_NAV_SCRIPT_TIME,
        Cmd.MAV_CMD_NAV_FOLLOW,
        65_000,
        Cmd.MAV_CMD_DO_SET_HOME,
        Cmd.MAV_CMD_DO_FENCE_ENABLE,
        Cmd.MAV_CMD_DO_AUX_FUNCTION,
        Cmd.MAV_CMD_DO_PARACHUTE,
        Cmd.MAV_CMD_DO_ENGINE_CONTROL,
        Cmd.MAV_CMD_DO_SEND_SCRIPT_MESSAGE,
    ],
)
def test_what_leads_anywhere_is_refused_by_number_name_and_reason(command: int) -> None:
    with pytest.raises(OutsideEnvelope, match=rf"mission item 2 \(\w+, command {command}\): .*: \w+") as caught:
        led(waypoint(1), item(command, -35.0, 10.0))
    assert caught.value.outside["item"] == 2


def test_a_plane_is_faster_on_the_leg_to_its_landing() -> None:
    """SITL's plane, seeds 8105 and 8125 of benchmarks/mission_differences.py: 28.8 m/s for 25.5."""
    way = led_straight(waypoint(10, 80.0), item(Cmd.MAV_CMD_NAV_LAND, -35.0 + 20 * NORTH), fastest=Pace(25.5, 9, 9))
    assert [leg.fastest.level for leg in way.legs] == [25.5, *[pytest.approx(30.6)] * (len(way.legs) - 1)]


@pytest.mark.parametrize(("options", "by_wing"), [(0.0, False), (6.0, True)])
def test_quadplane_takes_off_and_lands_upright_unless_its_options_differ(options: float, by_wing: bool) -> None:
    parameters = {"Q_ENABLE": 1.0, "Q_OPTIONS": options}
    items = item(Cmd.MAV_CMD_NAV_TAKEOFF, alt=30.0), waypoint(9, 30.0), item(Cmd.MAV_CMD_NAV_LAND, -35.0 + 18 * NORTH)
    way = led(*items, kind="plane", start=PathPoint(*HOME, 0.0), heading=0.0, parameters=parameters)
    assert (way.legs[0].end[:2] != HOME) is by_wing
    assert (way.legs[-1].begin.up == 30.0 and way.legs[-1].end[:2] == way.legs[-1].begin[:2]) is not by_wing


@pytest.mark.parametrize("command", [Cmd.MAV_CMD_NAV_LAND, Cmd.MAV_CMD_NAV_TAKEOFF, Cmd.MAV_CMD_NAV_LOITER_TO_ALT])
def test_what_a_rover_skips_draws_it_if_it_does_not_stop_before(command: int) -> None:
    """SITL's rover, seed 11 of benchmarks/mission_differences.py: AR_WPNav has planned the leg to the next item."""
    skipped, after = item(command, -35.0 + 5 * NORTH, 10.0), waypoint(9)
    with pytest.raises(OutsideEnvelope, match="item 2 .*drives towards its place"):
        led(waypoint(1), skipped, after, kind="rover")
    with pytest.raises(OutsideEnvelope, match="item 1 "):
        led(skipped, waypoint(1), jump(1, 1), kind="rover")
    for stops in (waypoint(1, p1=1), item(Cmd.MAV_CMD_NAV_LOITER_TIME, -35.0 + NORTH, p1=1)):
        assert steps(led(stops, skipped, after, kind="rover"))[-1] == (9, 0)
    assert steps(led(waypoint(1), item(command), after, kind="rover"))[-1] == (9, 0)


def test_a_rover_that_is_at_its_waypoint_drives_a_loop() -> None:
    """SITL's rover, seed 12 of benchmarks/mission_differences.py: 9.4 m."""
    assert led(waypoint(1), waypoint(1), waypoint(9), kind="rover").legs[-1].margin == 12.0


def test_a_copter_that_is_at_its_waypoint_may_fly_beyond_the_next() -> None:
    """SITL's copter, seed 7130 of benchmarks/mission_differences.py: 10.8 m, where a tag leads back to the place."""
    tag, to_tag = item(Cmd.MAV_CMD_JUMP_TAG, p1=7.0), item(Cmd.MAV_CMD_DO_JUMP_TAG, p1=7.0, p2=2.0)
    assert max(leg.margin for leg in led(tag, waypoint(1), to_tag, waypoint(9)).legs) == 12.0
    assert led(waypoint(1, 10.0), waypoint(1, 20.0), waypoint(9)).legs[-1].margin < 1.0, "it has climbed there"


def test_copter_that_need_not_climb_in_a_loiter_to_alt_does_not_stop() -> None:
    """Seed 5052 of benchmarks/fuzz_missions.py: 1.6 m beside its next leg, and stopped there before the mast."""
    climb = item(Cmd.MAV_CMD_NAV_LOITER_TO_ALT, -35.0 + NORTH, 10.0)
    assert led(waypoint(2), climb, waypoint(9)).legs[-1].margin == 5.0
    assert led(waypoint(2), climb, waypoint(8), waypoint(9)).legs[-1].margin == 0.0


@pytest.mark.parametrize(
    ("command", "parameters", "seconds"),
    [
        ("NAV_LAND", {}, 20 / 1.5 + 10 / 0.5),
        ("NAV_RETURN_TO_LAUNCH", {"RTL_CONE_SLOPE": 0.0}, 20 / 1.5 + 10 / 0.5),
        ("NAV_LAND", {"LAND_SPEED": 20.0}, 20 / 1.5 + 10 / 0.2),
        ("NAV_LAND", {"LAND_SPEED_HIGH": 500.0}, 20 / 5.0 + 10 / 0.5),
        ("NAV_PAYLOAD_PLACE", {}, 30 / 0.5),
        ("NAV_PAYLOAD_PLACE", {"PLDP_SPEED_DN": 0.3}, 30 / 0.3),
        ("NAV_PAYLOAD_PLACE", {"PLDP_SPEED_DN": 9.0}, 30 / 1.5),
    ],
)
def test_a_copter_lands_slower_than_it_descends_or_faster(
    command: str, parameters: dict[str, float], seconds: float
) -> None:
    """The forecast had it on the ground, or at its load's place, when it still came down."""
    down = item(getattr(Cmd, f"MAV_CMD_{command}"), alt=30.0)
    legs = led(waypoint(1, 30.0, p1=1), down, waypoint(2, 30.0), parameters=parameters).legs
    leg = next(leg for leg in legs if leg.lands)
    assert 0 <= (leg.begin.up - leg.end.up) / leg.slowest.descent - seconds <= 5.01
    high = max(parameters.get("LAND_SPEED_HIGH", 0.0) / 100, 1.5)
    assert leg.fastest.descent == high and legs[-1].slowest.descent in (1.5, leg.slowest.descent)


def test_a_copter_swings_off_its_circle() -> None:
    """Seeds 5 and 133 of benchmarks/mission_differences.py: up to 7.3 m beside the leg that follows."""
    turns = item(Cmd.MAV_CMD_NAV_LOITER_TURNS, -35.0 + 3 * NORTH, 10.0, p1=1, p3=12)
    assert led(waypoint(1), turns, waypoint(9)).legs[-1].margin == pytest.approx(7.7, abs=0.1)


def test_a_plane_climbs_ahead_and_turns_within_a_stretch() -> None:
    """SITL's plane came to 50 m 165 m ahead, and to 100 m 299 m ahead."""
    for up, flown in ((50.0, 165.0), (100.0, 299.0)):
        items = item(Cmd.MAV_CMD_NAV_TAKEOFF, alt=up, p1=15.0), waypoint(9, 100.0)
        way = led(*items, kind="plane", start=PathPoint(*HOME, 0.0), heading=90.0)
        climb, _, leg = way.legs[:3]
        ends = [offset(*HOME, *place[:2]) for place in (climb.end, leg.begin)]
        assert all(abs(north) < 0.1 for north, _ in ends) and climb.end.up == leg.begin.up == up
        assert abs(ends[1][1] - flown) < leg.margin and flown < ends[0][1] < 3 * flown
    in_the_air = led(*items, kind="plane", start=PathPoint(*HOME, 120.0), heading=90.0).legs
    assert in_the_air[0].end == PathPoint(*HOME, 120.0) and in_the_air[-1].margin == 0.0


def test_plane_that_turns_about_begins_its_leg_two_radii_beside_it() -> None:
    """Seeds 0 and 1 of benchmarks/mission_differences.py: 99 m beside its way at 22 m/s, 113 m at 24 m/s."""
    fast = Pace(24.0, 5.0, 5.0)
    more: Any = {"kind": "plane", "start": HERE._replace(up=80.0), "radius": 60.0, "fastest": fast, "slowest": fast}
    there = waypoint(20, 80.0)
    turning, on_it = led(there, **more).legs[:2]  # it circles, and may begin in any direction
    assert 117 < turning.margin <= 180 and turning.end == on_it.begin and on_it.margin == 0.0
    assert 200 < math.hypot(*offset(*turning.begin[:2], *turning.end[:2])) < 400
    assert [leg.margin for leg in led(there, waypoint(30, 80.0), **more).legs[:3]] == [turning.margin, 0.0, 0.0]
    about = led(there, waypoint(1, 80.0), **more).legs[2:4]
    assert [leg.margin for leg in about] == [turning.margin, 0.0], "likewise in its way"
    east = MissionItem(Cmd.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0,) * 4, there.x, there.y + 300_000, 80.0)
    assert led(there, east, **more).legs[2].margin < 100, "a right angle carries it one radius"
    banking = {"ROLL_LIMIT_DEG": 20.0}
    assert led(there, **more, parameters=banking).legs[0].margin > 300
    short = led(waypoint(1, 80.0), waypoint(2, 80.0), **more).legs
    assert [leg.margin for leg in short[:2]] == [turning.margin] * 2, "after a short leg it may still turn"


def test_items_that_land() -> None:
    land, there = item(Cmd.MAV_CMD_NAV_LAND), item(Cmd.MAV_CMD_NAV_LAND, -35.0 + NORTH)
    back = item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    begins = item(Cmd.MAV_CMD_DO_LAND_START)
    items = [waypoint(1), land, begins, there, back]
    assert landing_places(items, "copter", HOME) == {2: None, 4: (pytest.approx(-35.0 + NORTH), 149.0), 5: HOME}
    assert landing_places(items, "plane", HOME) == {2: None, 4: (pytest.approx(-35.0 + NORTH), 149.0)}
    assert not landing_places(items, "rover", HOME)
    assert landing_starts(items) == return_starts(items) == [3]
    assert return_starts([waypoint(1), item(188), waypoint(2), begins, land]) == [2, 3, 4, 5]


def test_copter_behind_a_passed_waypoint_sinks_to_the_payloads_height() -> None:
    """Seed 16 of benchmarks/mission_differences.py on ArduCopter's SITL: it hung there at 3 m for good."""
    there = item(Cmd.MAV_CMD_NAV_PAYLOAD_PLACE, -35.0 + 2 * NORTH, 3.0, p1=4.0)
    speed = item(Cmd.MAV_CMD_DO_CHANGE_SPEED, p1=1.0, p2=4.0)
    for before in ([waypoint(1, 15.0)], [waypoint(1, 15.0), speed]):
        with pytest.raises(OutsideEnvelope, match="PAYLOAD_PLACE.*own height") as refused:
            led(*before, there)
        assert refused.value.outside["item"] == len(before) + 1
    waits, level = waypoint(1, 15.0, p1=1.0), item(Cmd.MAV_CMD_NAV_PAYLOAD_PLACE, -35.0 + 2 * NORTH, 15.0, p1=4.0)
    for mission in ([waits, there], [waypoint(1, 15.0), level], [there]):
        assert led(*mission).legs[-1].end.up == led(*mission).legs[-3].end.up


@pytest.mark.parametrize(
    "strange", [jump(65_537, 1), item(Cmd.MAV_CMD_DO_JUMP_TAG, p1=65_543.0, p2=1.0), waypoint(1, p1=-70_000.0)]
)
def test_numbers_that_the_autopilot_stores_as_others_are_refused(strange: MissionItem) -> None:
    with pytest.raises(OutsideEnvelope, match="16 bits"):
        led(waypoint(1), strange, waypoint(2))


@pytest.mark.parametrize(("first", "options", "is_known"), [(0.0, 0, True), (1.0, 0, False), (0.0, 16, False)])
def test_a_landing_with_hover_motors_that_is_approached_by_wing_is_refused(
    first: float, options: int, is_known: bool
) -> None:
    land = item(Cmd.MAV_CMD_NAV_VTOL_LAND, -35.0 + 9 * NORTH, p1=first)
    hovers: Any = {"kind": "plane", "parameters": {"Q_ENABLE": 1.0, "Q_OPTIONS": float(options)}}
    if is_known:
        assert led(waypoint(1), land, **hovers).legs[-1].is_last
        return
    with pytest.raises(OutsideEnvelope, match="VTOL_LAND.*circles"):
        led(waypoint(1), land, **hovers)
    led(waypoint(1), land, kind="plane")  # without them it passes it over


def test_an_upright_landing_off_a_circle_is_refused() -> None:
    """In SITL a QuadPlane was 90 m beside its last leg then."""
    circle = item(Cmd.MAV_CMD_NAV_LOITER_TIME, -35.0 + 5 * NORTH, 40.0, p1=10.0)
    land = item(Cmd.MAV_CMD_NAV_LAND, -35.0 + 30 * NORTH)
    hovers: Any = {"kind": "plane", "parameters": {"Q_ENABLE": 1.0}, "radius": 60.0}
    with pytest.raises(OutsideEnvelope, match="NAV_LAND.*upright"):
        led(waypoint(1, 40.0), circle, land, **hovers)
    assert led(waypoint(1, 40.0), circle, waypoint(20, 40.0), land, **hovers).legs[-1].is_last
    assert led(waypoint(1, 40.0), circle, land, kind="plane", radius=60.0).legs


def test_plane_that_may_turn_early_is_so_far_beside_the_next_leg() -> None:
    air: Any = {"kind": "plane", "start": HERE._replace(up=80.0), "radius": 60.0}
    for accepted, margin in ((250.0, 250.0), (4000.0, 255.0), (0.0, 0.0)):
        legs = led(waypoint(20, 80.0, p2=accepted), waypoint(40, 80.0), **air).legs
        assert next(leg for leg in legs if leg.seq == 2).margin == margin


def test_plane_that_circles_where_it_is_may_do_so_along_its_last_circle() -> None:
    air: Any = {"kind": "plane", "start": HERE._replace(up=80.0), "radius": 60.0}
    turns = item(Cmd.MAV_CMD_NAV_LOITER_TURNS, -35.0 + 20 * NORTH, 80.0, p1=1.0, p3=200.0)
    here, there = item(Cmd.MAV_CMD_NAV_LOITER_UNLIM), item(Cmd.MAV_CMD_NAV_LOITER_UNLIM, -35.0 + 90 * NORTH, 80.0)
    assert {leg.margin for leg in led(turns, there, **air).legs if leg.seq == 2} == {200.0, 15.0}
    assert min(leg.margin for leg in led(turns, here, **air).legs if leg.seq == 2 and leg.begin != leg.end) >= 200


@pytest.mark.parametrize(
    ("after", "lines_up"),
    [
        ([], False),
        ([item(Cmd.MAV_CMD_NAV_RETURN_TO_LAUNCH)], False),
        ([item(Cmd.MAV_CMD_NAV_VTOL_TAKEOFF, -35.0 + 50 * NORTH), waypoint(40, 80.0)], False),
        ([waypoint(20.3, 80.0)], False),
        ([waypoint(40, 80.0)], True),
    ],
)
def test_plane_leaves_its_circle_towards_the_next_place_or_anywhere(after: list[MissionItem], lines_up: bool) -> None:
    """SITL's plane, seed 51 of benchmarks/mission_differences.py: 147 m beside its way home from a last circle."""
    fast = Pace(25.5, 5.0, 5.0)
    air: Any = {"kind": "plane", "start": HERE._replace(up=80.0), "radius": 80.0, "fastest": fast, "slowest": fast}
    circle = item(Cmd.MAV_CMD_NAV_LOITER_TURNS, -35.0 + 20 * NORTH, 80.0, p1=2.0)
    onward = next(leg for leg in led(circle, *after, **air).legs if leg.seq >= 2)
    assert onward.margin == 80.0 if lines_up else 200.0 <= onward.margin <= 300.0


def test_waypoint_where_the_plane_is_may_be_anywhere_on_its_last_circle() -> None:
    """SITL's plane, seed 116 of benchmarks/mission_differences.py: 134 m beside the leg behind it."""
    air: Any = {"kind": "plane", "start": HERE._replace(up=80.0), "radius": 60.0}
    circle = item(Cmd.MAV_CMD_NAV_LOITER_TURNS, -35.0 + 20 * NORTH, 80.0, p1=1.0)
    turn_about = next(leg for leg in led(waypoint(20, 80.0), waypoint(5, 80.0), **air).legs if leg.seq == 2).margin
    onward = led(circle, item(Cmd.MAV_CMD_NAV_WAYPOINT), waypoint(60, 80.0), **air).legs
    assert next(leg for leg in onward if leg.seq == 3).margin == 60.0 + turn_about


def test_a_plane_comes_to_a_circle_from_inside_anywhere_in_it() -> None:
    air: Any = {"kind": "plane", "start": HERE._replace(up=80.0), "radius": 60.0}
    wide = item(Cmd.MAV_CMD_NAV_LOITER_UNLIM, -35.0 + 5 * NORTH, 80.0, p3=1500.0)
    approach, *_ = led(wide, **air).legs
    assert approach.margin >= 1500


def test_the_speeds_of_a_mission_are_asked_for() -> None:
    """Without AIRSPEED_CRUISE a plane counted as flying at 12 m/s."""
    named = {kind: {name for names in WANTED[kind] for name in names} for kind in WANTED}
    assert {"WP_SPD", "WPNAV_SPEED_UP"} <= named["copter"] and "AIRSPEED_CRUISE" in named["plane"]
    assert {"WP_SPEED", "CRUISE_SPEED"} <= named["rover"]


def test_a_plane_that_is_given_a_speed_is_faster_over_the_ground() -> None:
    """SITL's plane, seed 1 of benchmarks/mission_differences.py: 27.9 m/s with an airspeed of 24 m/s."""
    faster = item(Cmd.MAV_CMD_DO_CHANGE_SPEED, p2=24.0)
    leg = led(faster, waypoint(9, 80.0), kind="plane", start=HERE._replace(up=80.0), radius=60.0).legs[-1]
    assert 27.5 < leg.fastest.level < 28.5


def test_an_item_whose_height_is_no_number_is_refused() -> None:
    with pytest.raises(OutsideEnvelope, match="item 2"):
        led(waypoint(1), waypoint(2, math.nan))


def test_plane_that_circles_in_a_loop_is_anywhere_and_soon_refused() -> None:
    """Seed 197 of benchmarks/mission_differences.py: it was refused as "too many ways", after 24 s."""
    air: Any = {"kind": "plane", "start": HERE._replace(up=80.0), "radius": 60.0}
    here = item(Cmd.MAV_CMD_NAV_LOITER_TIME, p1=5.0)
    with pytest.raises(OutsideEnvelope, match="item 2 .*give it a place"):
        led(waypoint(20, 80.0), here, item(Cmd.MAV_CMD_DO_JUMP, p1=2.0, p2=2.0), **air)
    led(waypoint(20, 80.0), here, waypoint(40, 80.0), item(Cmd.MAV_CMD_DO_JUMP, p1=1.0, p2=2.0), **air)
