"""The mission that is checked is the mission that is flown: where, how fast, and who is near; in virtual time."""

from __future__ import annotations

import asyncio
import gc
import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.mission.mission_legs import Leg
from mavproxy_uavapi.sim.geodesy import Location
from tests.rules.test_envelope import put
from tests.rules.test_separation import SEPARATION, make, mode, pair, to  # noqa: F401
from tests.support import stages
from tests.support.crossing_flights import Fleet
from tests.support.envelopes import FIELD, feature, field, place, square
from tests.support.make_world import MakeWorld
from tests.support.messages import message_of
from tests.support.world import World, item_at

pytestmark = pytest.mark.matrix

MAST = (40.0, 60.0, 10.0, 40.0)  # of FIELD: from north, to north, half its width, height; m


def at(north: float, east: float, alt: float, command: str = "NAV_WAYPOINT", **more: Any) -> dict[str, Any]:
    lat, lon = place(north, east)
    return {"command": command, "lat": lat, "long": lon, "alt": alt, **more}


def upload(world: World, items: list[dict[str, Any]]) -> str:
    return str(world.ask("POST", "/mission/waypoints", {"items": items}).outcome)


class Depth:
    """How deep the vehicle truly was in the mast so far, m."""

    def __init__(self, world: World) -> None:
        self.deepest, self._world = 0.0, world
        self._task = world.loop.create_task(self._look())

    async def _look(self) -> None:
        while True:
            north, east, down = self._world.at
            inside = min(north - MAST[0], MAST[1] - north, MAST[2] - abs(east), MAST[3] + down)
            self.deepest = max(self.deepest, inside)
            await asyncio.sleep(0.05)


def fly(world: World, items: list[dict[str, Any]], seconds: float = 60.0) -> float:
    """Upload and fly a mission as far as it is allowed; how deep it came into the mast."""
    depth = Depth(world)
    if upload(world, items) == "200":
        world.ask("POST", "/mission/start")
    world.pass_time(seconds)
    return depth.deepest


def test_landing_sequence_behind_the_missions_end_is_begun_by_nobody(make_world: MakeWorld) -> None:
    world = make_world(allow_raw=True)
    put(world, FIELD)
    world.until(lambda: world.host.registry.find(1).state.home)
    items = [at(5, 0, 10), {"command": "NAV_RETURN_TO_LAUNCH"}, at(5, 0, 10, "DO_LAND_START"), at(95, 0, 10)]
    assert upload(world, [*items, {"command": "NAV_LAND"}]) == "200"
    depth = Depth(world)
    begin = {"command": "MAV_CMD_DO_LAND_START", "confirmation": 0, **{f"param{number}": 0 for number in range(1, 8)}}
    raw = world.ask("POST", "/message", {"name": "COMMAND_LONG", "fields": begin})
    assert raw.outcome == "409 outside_envelope"
    assert world.ask("GET", "/command/set_mode?mode=AUTO_RTL").outcome == "409 outside_envelope"
    world.pass_time(30.0)
    assert depth.deepest == 0.0


def test_checked_mission_begins_where_a_raw_message_arms_the_vehicle(make_world: MakeWorld) -> None:
    world = make_world(World.boot, vehicle="rover", allow_raw=True)
    put(world, {"type": "FeatureCollection", "features": [feature("pond", square(10, 50), "exclusion")]})
    world.pass_time(3.0)
    assert upload(world, [at(20, 0, 0), at(20, 30, 0)]) == "200"
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "200"
    arm = {"command": "MAV_CMD_COMPONENT_ARM_DISARM", "confirmation": 0, **{f"param{n}": 0 for n in range(2, 8)}}
    assert world.ask("POST", "/message", {"name": "COMMAND_LONG", "fields": {**arm, "param1": 1}}).outcome == "200"
    world.pass_time(30.0)
    assert world.vehicle.mode.name == "AUTO" and math.dist(world.at[:2], (20, 30)) < 5.0


def test_a_landing_sequence_that_takes_off_again_is_not_begun(make_world: MakeWorld) -> None:
    """ArduCopter shows AUTO from the takeoff on, as if its pilot had switched to it: it flew unwatched, 10 m deep."""
    world = make_world()
    put(world, FIELD)
    world.until(lambda: world.host.registry.find(1).state.home)
    again = [at(10, 0, 10), at(0, 0, 12, "NAV_TAKEOFF"), at(10, 60, 10), at(90, 60, 10), at(90, 0, 10)]
    assert upload(world, [at(5, 0, 10), at(5, 5, 10, "DO_LAND_START"), *again]) == "200"
    depth, switched = Depth(world), world.ask("GET", "/command/set_mode?mode=AUTO_RTL").outcome
    if switched == "200":
        world.until(lambda: world.copter.mission.current == 5, step=0.1)
        world.pass_time(2.0)
        world.copter.mission.items[7] = item_at(*place(50, 0))  # another station changes its end
        world.pass_time(60.0)
    assert (switched, depth.deepest) == ("409 outside_envelope", 0.0)
    assert (
        upload(world, [at(5, 0, 10), at(5, 5, 10, "DO_LAND_START"), at(10, 0, 10), {"command": "NAV_LAND"}]) == "200"
    )
    assert world.ask("GET", "/command/set_mode?mode=AUTO_RTL").outcome == "200"


def test_a_circle_without_a_radius_is_refused(make_world: MakeWorld) -> None:
    """ArduCopter flies it as wide as its last circle, whoever flew that, or not at all: then to its middle."""
    world = make_world()
    put(world, FIELD)
    refused = world.ask("POST", "/mission/waypoints", {"items": [at(25, 0, 10, "NAV_LOITER_TURNS", param1=1)]})
    assert refused.outcome == "409 outside_envelope" and "param3" in refused.body["detail"]
    named = at(0, 40, 10, "NAV_LOITER_TURNS", param1=1, param3=12)
    assert upload(world, [named, at(0, -30, 10, "NAV_LOITER_TURNS", param1=1)]) == "200"


@pytest.mark.parametrize(("turns", "outcome"), [(1, "200"), (50, "409 outside_envelope")])
def test_each_round_of_a_circle_takes_of_the_battery(make_world: MakeWorld, turns: int, outcome: str) -> None:
    world = make_world()
    limits = {"reserve": 20, "endurance": 600}
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(200))], "limits": limits})
    circle = at(0, 60, 10, "NAV_LOITER_TURNS", param1=turns, param3=20)
    assert upload(world, [at(0, 60, 10), circle, at(0, -60, 10)]) == outcome


def test_nobody_comes_onto_a_circle_after_its_first_round(pair: Fleet) -> None:  # noqa: F811
    """The legs of its first round counted as flown: another one was allowed to hover 2 m beside it."""
    assert pair.ask(2, "movement/go_to_gps_wait", to(60, 100)).outcome == "200"
    circle = [at(0, 0, 10), at(60, 0, 10, "NAV_LOITER_TURNS", param1=4, param3=-30), at(0, 0, 10)]
    assert pair.world.ask("POST", "/vehicles/1/mission/waypoints", {"items": circle}).outcome == "200"
    assert pair.ask(1, "mission/start").outcome == "200"
    pair.world.until(lambda: pair.world.copter.mission.current == 2, step=0.1)
    while pair.world.copter.mission.current == 2:
        assert pair.ask(2, "movement/go_to_gps", to(60, 32)).outcome == "409 too_near"
        pair.loop.pass_time(5.0)
    pair.loop.pass_time(8.0)
    assert pair.ask(2, "movement/go_to_gps", to(60, 32)).outcome == "200"


@pytest.mark.parametrize("marker", ["DO_LAND_START", "DO_GO_AROUND", "DO_SET_ROI_LOCATION"])
def test_the_place_of_a_marker_is_no_corner_of_the_way(make_world: MakeWorld, marker: str) -> None:
    world = make_world()
    put(world, FIELD)
    items = [at(5, 0, 10), at(45, 60, 0, marker), at(95, 0, 10), {"command": "NAV_LAND"}]
    assert fly(world, items) == 0.0


@pytest.mark.parametrize("skipped", ["NAV_LAND", "NAV_TAKEOFF", "NAV_LOITER_TURNS", "NAV_LOITER_TO_ALT"])
def test_what_a_rover_passes_over_is_no_corner_of_its_way(make_world: MakeWorld, skipped: str) -> None:
    world = make_world(lambda w: w.armed(), vehicle="rover")
    features = [feature("field", square(100)), feature("mast", square(10, 50), "exclusion")]
    put(world, {"type": "FeatureCollection", "features": features})
    items = [at(5, 0, 0), at(45, 60, 10, skipped, param3=1), at(95, 0, 0)]
    assert fly(world, items, 10.0) == 0.0
    assert math.hypot(*world.at[:2]) < 1.0, "it has not begun"


def test_a_takeoff_with_a_place_climbs_where_it_stands(make_world: MakeWorld) -> None:
    """Behind it the way leads through the mast; a takeoff at its own place would lead around it."""
    world = make_world()
    put(world, FIELD)
    assert fly(world, [at(0, 60, 15, "NAV_TAKEOFF"), at(90, 60, 15), at(90, 0, 15)], 5.0) == 0.0
    assert world.ask("GET", "/command/guided").outcome == "200"
    world.pass_time(3.0)
    assert upload(world, [at(90, 60, 15, "NAV_TAKEOFF"), at(95, 0, 15)]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "409 outside_envelope"


def test_set_mode_auto_is_held_against_the_item_it_goes_on_with(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, FIELD)
    assert upload(world, [at(0, 40, 10), at(90, 40, 10), at(90, 0, 10), {"command": "NAV_LAND"}]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.until(lambda: world.copter.mission.current == 3, step=0.1)
    assert world.ask("GET", "/command/guided").outcome == "200"
    for corner in (to(90, 50), to(0, 50), to(0, 0)):
        assert world.ask("POST", "/movement/go_to_gps_wait", corner).outcome == "200"
    depth = Depth(world)
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "409 outside_envelope"
    world.pass_time(30.0)
    assert depth.deepest == 0.0


def test_a_mission_that_was_changed_may_go_on_at_what_was_pending_before(make_world: MakeWorld) -> None:
    """SITL's copter, whose mission had a condition at 2, flew to the new item 2, and reported 3: unchecked."""
    world = make_world()
    put(world, FIELD)
    delay = {"command": "CONDITION_DELAY", "param1": 300}
    assert upload(world, [at(0, 30, 10), delay, at(90, 30, 10), at(90, 40, 10)]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.until(lambda: world.copter.mission.current == 3, step=0.1)
    world.pass_time(1.0)
    assert world.ask("GET", "/command/guided").outcome == "200"
    assert world.ask("POST", "/movement/go_to_gps_wait", to(20, 0)).outcome == "200"
    assert upload(world, [at(90, 30, 10), at(90, 0, 10), at(90, 90, 10), at(20, 90, 10), at(20, 30, 10)]) == "200"
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "409 outside_envelope"
    assert upload(world, [at(20, 30, 10), at(20, -30, 10), at(20, 60, 10)]) == "200"
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "200"


def test_jump_to_items_without_a_height_leads_higher_in_its_second_round(make_world: MakeWorld) -> None:
    """The first round flies below the roof, the second one into it."""
    world = make_world()
    roof = feature("roof", square(10, 60, 60), "exclusion", floor=15)
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(100)), roof]})
    corners = [at(30, 60, 0), at(90, 60, 0), at(90, 0, 10)]
    again = {"command": "DO_JUMP", "param1": 1, "param2": 3}
    assert upload(world, [*corners, again]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    assert world.ask("GET", "/command/guided").outcome == "200"
    world.pass_time(3.0)
    assert upload(world, [*corners[:2], at(90, 0, 20), again]) == "409 outside_envelope"


@pytest.mark.parametrize(
    "command", ["DO_AUX_FUNCTION", "DO_PARACHUTE", "DO_ENGINE_CONTROL", "DO_SEND_SCRIPT_MESSAGE"]
)
def test_what_nobody_can_predict_is_refused_by_its_number(make_world: MakeWorld, command: str) -> None:
    world = make_world()
    put(world, FIELD)
    refused = world.ask("POST", "/mission/waypoints", {"items": [at(5, 0, 10), {"command": command}]})
    assert refused.outcome == "409 outside_envelope" and refused.body["outside"]["item"] == 2


def test_the_level_leg_to_a_landing_place_is_kept_from_other_vehicles(pair: Fleet) -> None:  # noqa: F811
    assert pair.ask(2, "movement/go_to_gps_wait", to(200, 60)).outcome == "200"
    items = {"items": [at(0, 0, 10), at(300, 0, 10, "NAV_LAND")]}
    assert pair.world.ask("POST", "/vehicles/1/mission/waypoints", items).outcome == "200"
    assert pair.ask(1, "mission/start").outcome == "200"
    pair.world.until(lambda: pair.at(pair.world.simulators[0])[0] > 40, step=0.1)
    assert pair.ask(2, "movement/go_to_gps", to(200, 0)).outcome == "409 too_near"


def test_nobody_comes_onto_a_loop_after_its_first_round(pair: Fleet) -> None:  # noqa: F811
    assert pair.ask(2, "movement/go_to_gps_wait", to(60, 60)).outcome == "200"
    loop = [at(0, 0, 10), at(60, 0, 10), at(60, -40, 10), {"command": "DO_JUMP", "param1": 1, "param2": -1}]
    assert pair.world.ask("POST", "/vehicles/1/mission/waypoints", {"items": loop}).outcome == "200"
    assert pair.ask(1, "mission/start").outcome == "200"
    pair.loop.pass_time(60.0)
    assert pair.ask(2, "movement/go_to_gps", to(30, 0)).outcome == "409 too_near"
    assert pair.ask(2, "movement/go_to_gps", to(30, 40)).outcome == "200"


def test_a_mission_is_as_fast_as_its_own_speeds_whatever_guided_was_given(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(300))], "limits": {"speed": 5}})
    assert world.ask("GET", "/command/set_ground_speed?new_v=5").outcome == "200"
    legs = [at(0, 0, 8), at(200, 0, 8)]
    assert upload(world, legs) == "200"
    assert world.ask("POST", "/mission/start").outcome == "409 outside_envelope"
    slow = {"command": "DO_CHANGE_SPEED", "param1": 1, "param2": 4}
    assert upload(world, [slow, *legs]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.pass_time(20.0)
    assert world.at[0] > 40 and math.hypot(*world.copter.body.velocity[:2]) <= 4.5


@pytest.mark.parametrize("later", [0.0, 0.3, 0.9])
def test_no_upload_comes_between_a_start_and_its_effect(make_world: MakeWorld, later: float) -> None:
    world = make_world(World.flying)
    assert upload(world, [at(20, 0, 10), at(60, 0, 10)]) == "200"
    start, asked_at = world.begin("POST", "/mission/start"), world.now
    world.hears = lambda m: not (m.get_type() == "HEARTBEAT" and world.now < asked_at + 1.5)
    world.pass_time(later + 0.001)
    items = [at(-20.0 - n, 100, 30) for n in range(40)]
    other = world.begin("POST", "/mission/waypoints", {"items": items})
    outcomes = world.answer(start).outcome, world.answer(other).outcome
    assert outcomes.count("200") == 1
    assert len(world.copter.mission.items) - 1 == (2 if outcomes[0] == "200" else 40)


def test_a_number_that_is_none_keeps_nobody_from_breaking_the_envelope(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, FIELD)
    vehicle = world.host.registry.find(1)
    towards = {"vx": 5.0, "vy": 0.0, "vz": 0.0}
    for value in (math.nan, math.inf):
        vehicle.state.parameters["GUID_TIMEOUT"] = value
        assert world.ask("POST", "/movement/travel_at_ned", towards).outcome == "409 outside_envelope"


def test_an_item_on_the_other_side_of_the_earth_is_refused_in_any_case(make_world: MakeWorld) -> None:
    world = make_world()
    far = {**at(20, 0, 10), "long": 29.165}
    refused = world.ask("POST", "/mission/waypoints", {"items": [at(20, 0, 10), far]})
    assert refused.outcome == "409 outside_envelope" and "item 2" in refused.body["detail"]
    assert upload(world, [at(20, 0, 10), {**far, "command": "DO_SET_ROI_LOCATION"}]) == "200"
    world.copter.mission.items[1] = world.copter.mission.items[1]._replace(y=291650000)
    assert world.ask("POST", "/mission/start").outcome == "409 outside_envelope"


def test_nobody_is_sent_home_on_a_way_that_is_not_known(pair: Fleet) -> None:  # noqa: F811
    smart = pair.world.ask("GET", "/vehicles/1/command/set_mode?mode=SMART_RTL")
    assert smart.outcome == "409 outside_envelope" and "RTL" in smart.body["detail"]


@pytest.mark.parametrize("by", ["command", "parameter", "parameter after no number"])
def test_speed_that_others_change_in_flight_is_held_against_the_limit(make_world: MakeWorld, by: str) -> None:
    world = make_world()
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(900))], "limits": {"speed": 5}})
    slow = {"command": "DO_CHANGE_SPEED", "param1": 1, "param2": 4}
    assert upload(world, [slow, at(0, 0, 8), at(800, 0, 8)]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.pass_time(15.0)
    assert world.copter.mode.name == "AUTO"
    if by == "command":
        world.pilot_command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 12, -1)
    else:
        if by == "parameter after no number":
            world.host.bridge.feed(message_of("PARAM_VALUE", param_id="WP_SPD", param_value=math.nan))
        world.arriving.append(mavlink.MAVLink_param_set_message(1, 1, b"WP_SPD", 12.0, 9))
    fastest = 0.0
    for _ in range(80):
        world.pass_time(0.1)
        fastest = max(fastest, math.hypot(*world.copter.body.velocity[:2]))
    assert world.copter.mode.name == "BRAKE"
    assert fastest < 7.1, "8.1 as long as nobody knew that it had been changed"
    assert math.hypot(*world.copter.body.velocity[:2]) < 0.5


def test_a_waypoint_that_another_puts_in_place_of_a_landing_is_watched(make_world: MakeWorld) -> None:
    """The landing had no place: whatever the vehicle flies at that number passed for its vertical end."""
    world = make_world()
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(60))]})
    assert upload(world, [at(0, 0, 10), at(40, 0, 10), {"command": "NAV_LAND"}]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.until(lambda: world.copter.mission.current == 2, step=0.1)
    world.copter.mission.items[3] = item_at(*place(40, 200))
    world.pass_time(30.0)
    assert world.copter.mode.name == "BRAKE" and world.at[1] < 60


def test_unread_mission_is_watched_once_there_is_an_envelope(make_world: MakeWorld) -> None:
    world = make_world()
    assert upload(world, [at(0, 0, 10), at(300, 0, 10), {"command": "NAV_LAND"}]) == "200"
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "200"
    world.pass_time(3.0)
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(100))]})
    world.pass_time(30.0)
    assert world.copter.mode.name == "BRAKE" and world.at[0] < 101


@pytest.mark.long
def test_low_waypoint_that_others_put_for_a_planes_landing_is_watched(make_world: MakeWorld) -> None:
    """Below 10 m nobody stops a plane that lands: it flew on at 8 m, 800 m outside."""
    world = make_world(stages.on_mission, vehicle="plane")
    world.in_mode("GUIDED")
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(700))]})
    world.pass_time(1.5)
    assert upload(world, [at(300, 0, 50), at(300, -200, 20), at(300, -400, 5, "NAV_LAND")]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.until(lambda: world.vehicle.mission.current == 2, step=0.1)
    world.vehicle.mission.items[3] = item_at(*place(300, -1500))._replace(z=8.0)
    world.until(lambda: world.vehicle.mode.name == "LOITER", 90.0, step=0.5)
    assert world.at[1] > -800


def test_a_plane_that_glides_to_its_landing_is_watched(make_world: MakeWorld) -> None:
    world = make_world(stages.on_mission, vehicle="plane")
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(3000))]})
    world.in_mode("GUIDED")
    world.pass_time(1.5)
    items = [at(600, 0, 50), at(2000, 0, 0, "NAV_LAND")]
    assert upload(world, items) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.until(lambda: world.vehicle.mission.current == 2, step=0.1)
    world.pass_time(5.0)
    assert world.vehicle.mode.name == "AUTO"
    wall = {**feature("wall", square(40, 1500), "exclusion")}
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(3000)), wall]})
    world.pass_time(60.0)
    assert world.vehicle.mode.name == "LOITER"


def test_a_vehicle_that_returns_elsewhere_than_home_is_kept_from_others(pair: Fleet) -> None:  # noqa: F811
    """As to a rally point: where it returns to, only its reported target tells."""
    world, first = pair.world, pair.world.simulators[0]
    assert pair.ask(1, "movement/go_to_gps_wait", to(-60, 0)).outcome == "200"
    assert pair.ask(2, "movement/go_to_gps_wait", to(60, 60)).outcome == "200"
    world.hears = lambda message: message.get_type() != "HOME_POSITION"
    there = place(120, 0)
    first.vehicle.set_home(Location(*there, first.vehicle.home_altitude), lock=True)
    assert pair.ask(1, "command/set_mode?mode=RTL").outcome == "200"
    pair.loop.pass_time(12.0)
    assert pair.at(first)[0] < 60
    assert pair.ask(2, "movement/go_to_gps", {**to(80, 0), "alt": 15}).outcome == "409 too_near"


def test_a_mission_under_way_leaves_no_legs_for_the_garbage_collector(make_world: MakeWorld) -> None:
    def legs() -> int:
        gc.collect()
        return sum(type(one) is Leg for one in gc.get_objects())

    world, before = make_world(World.flying), legs()
    put(world)
    fly(world, [at(30 * (n % 2), 40 + n, 10) for n in range(20)], 5.0)
    assert legs() == before and world.vehicle.mode.name == "AUTO"


def test_heights_above_the_terrain_are_no_heights_for_the_separation(pair: Fleet) -> None:  # noqa: F811
    """They were taken for 0 m: a mission 10 m above the terrain was allowed through a vehicle that hovers there."""
    assert pair.ask(2, "movement/go_to_gps_wait", to(60, 0)).outcome == "200"
    through = {"items": [at(0, 0, 10, frame="terrain"), at(120, 0, 10, frame="terrain")]}
    assert pair.world.ask("POST", "/vehicles/1/mission/waypoints", through).outcome == "200"
    refused = pair.ask(1, "mission/start")
    assert refused.outcome == "409 outside_envelope" and "terrain" in refused.body["detail"]


def give_rally(world: World, system: int, north: float, east: float, alt: float = 30.0) -> None:
    point = dict(zip(("lat", "long", "alt"), (*place(north, east), alt), strict=True))
    answer = world.ask("POST", f"/vehicles/{system}/mission/rally", {"points": [point]})
    assert answer.outcome == "200"


def test_mission_to_a_rally_point_is_refused_although_its_number_is_lost(make_world: MakeWorld) -> None:
    """With the parameter's answer lost it counted as none, and the mission returned outside."""
    world = make_world()
    give_rally(world, 1, 150, 0)
    put(world, FIELD)
    world.hears = lambda message: getattr(message, "param_id", "") != "RALLY_TOTAL"
    items = [at(0, 30, 10), {"command": "NAV_RETURN_TO_LAUNCH"}]
    assert upload(world, items) == "200"
    refused = world.ask("POST", "/mission/start")
    assert refused.outcome == "409 outside_envelope" and "rally" in refused.body["detail"]


def test_no_rally_point_is_changed_under_a_mission_that_may_return_there(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, FIELD)
    assert upload(world, [at(0, 0, 10), at(0, 60, 10), {"command": "NAV_RETURN_TO_LAUNCH"}]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    point = {"points": [dict(zip(("lat", "long", "alt"), (*place(90, 0), 10), strict=True))]}
    assert world.ask("POST", "/mission/rally", point).outcome == "409 outside_envelope"
    assert world.copter.mode.name == "AUTO"


def test_vehicle_that_climbs_first_may_return_to_a_rally_point(pair: Fleet) -> None:  # noqa: F811
    """Its target is above itself then: another one was allowed to hover above the rally point."""
    world = pair.world
    give_rally(world, 1, 120, 0)
    world.simulators[0].parameters.set("RTL_ALT_M", 30.0)
    assert pair.ask(1, "movement/go_to_gps_wait", to(60, 0)).outcome == "200"
    assert pair.ask(2, "movement/go_to_gps_wait", to(120, 60, 30)).outcome == "200"
    pair.loop.pass_time(35.0)  # rally points are asked for now and then
    begun = pair.begin(1, "command/rtl")
    pair.loop.pass_time(2.0)
    assert mode(pair, 1) == "RTL" and pair.at(world.simulators[0])[2] < 25
    assert pair.ask(2, "movement/go_to_gps", to(120, 0, 30)).outcome == "409 too_near"
    assert pair.ask(2, "movement/go_to_gps", to(30, 0, 30)).outcome == "409 too_near", "or home"
    assert pair.ask(2, "movement/go_to_gps", to(120, 120, 30)).outcome == "200"
    begun.hang_up()


def test_a_return_that_no_heartbeat_has_shown_counts(pair: Fleet) -> None:  # noqa: F811
    world = pair.world
    assert pair.ask(1, "movement/go_to_gps_wait", to(-120, 0)).outcome == "200"
    assert pair.ask(2, "movement/go_to_gps_wait", to(-40, 40, 15)).outcome == "200"
    asked_at = world.now
    world.hears = lambda message: message.get_type() != "HEARTBEAT" or world.now > asked_at + 1.2
    begun = pair.begin(1, "command/rtl")
    pair.loop.pass_time(0.3)
    assert world.host.registry.find(1).mode == "GUIDED"
    assert pair.ask(2, "movement/go_to_gps", to(-40, 0, 15)).outcome == "409 too_near"
    begun.hang_up()


@pytest.mark.parametrize("begun", ["mission/start", "command/set_mode?mode=AUTO"])
def test_mission_under_way_when_the_separation_comes_counts_for_others(
    make: Callable[..., Fleet],  # noqa: F811
    begun: str,
) -> None:
    """It was forecast by its velocity, for 5 s: another one was allowed to hover on its way."""
    fleet = make(2)
    assert fleet.ask(2, "movement/go_to_gps_wait", to(200, 60)).outcome == "200"
    items = {"items": [at(0, 0, 10), at(300, 0, 10)]}
    assert fleet.world.ask("POST", "/vehicles/1/mission/waypoints", items).outcome == "200"
    assert fleet.ask(1, begun).outcome == "200"
    fleet.loop.pass_time(4.0)
    fleet.world.host.registry.traffic.separation = SEPARATION
    fleet.loop.pass_time(2.0)
    assert mode(fleet, 1) == "AUTO" and fleet.at(fleet.world.simulators[0])[0] < 80
    assert fleet.ask(2, "movement/go_to_gps", to(200, 0)).outcome == "409 too_near"


def of_another_station(world: World, items: list[Any]) -> None:
    """Another station's upload, item by item."""
    world.arriving.append(mavlink.MAVLink_mission_count_message(1, 1, len(items), 0))
    world.pass_time(0.2)
    for seq, one in enumerate(items):
        four = one.param1, one.param2, one.param3, one.param4
        place_and_height = one.x, one.y, one.z
        message = mavlink.MAVLink_mission_item_int_message(
            1, 1, seq, one.frame, one.command, 0, 1, *four, *place_and_height, 0
        )
        world.arriving.append(message)
        world.pass_time(0.2)


def test_a_mission_that_another_station_changes_in_flight_is_followed(pair: Fleet) -> None:  # noqa: F811
    world = pair.world
    assert pair.ask(2, "movement/go_to_gps_wait", to(60, 100)).outcome == "200"
    items = {"items": [at(0, 0, 10), at(-30, 0, 10), at(-30, -300, 10)]}
    assert world.ask("POST", "/vehicles/1/mission/waypoints", items).outcome == "200"
    assert pair.ask(1, "mission/start").outcome == "200"
    world.until(lambda: world.copter.mission.current == 2, step=0.1)
    of_another_station(world, [item_at(*place(*spot)) for spot in ((0, 0), (0, 0), (-30, 0), (60, 40), (60, 300))])
    pair.loop.pass_time(3.0)
    assert mode(pair, 1) == "AUTO" and pair.at(world.simulators[0])[0] < 30
    assert pair.ask(2, "movement/go_to_gps", to(60, 60)).outcome == "409 too_near"
    assert pair.ask(2, "movement/go_to_gps", to(120, 100)).outcome == "200"


def test_mission_that_others_change_before_its_start_is_not_started(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, FIELD)
    assert upload(world, [at(0, 0, 10), at(0, 40, 10)]) == "200"
    others = iter([mavlink.MAVLink_mission_count_message(1, 1, 2, 0)])

    def hears(message: Any) -> bool:
        if message.get_type() == "MISSION_ITEM_INT" and message.seq == 2:  # the last one that is read
            world.arriving.extend(others)
        return True

    world.hears = hears
    refused = world.ask("POST", "/mission/start").outcome  # by us, or by the vehicle, which is asked for more then
    assert refused in ("409 superseded", "500 rejected") and world.copter.mode.name == "GUIDED"


def test_a_raw_message_that_is_refused_ends_no_watch(make_world: MakeWorld) -> None:
    """A rover that is armed in AUTO drove 10 m deep through the exclusion, because nobody commanded it any more.

    What would arm it, so that it begins a mission that nobody has checked, is refused, too.
    """
    world = make_world(World.boot, vehicle="rover", allow_raw=True)
    put(world, {"type": "FeatureCollection", "features": [feature("pond", square(10, 50), "exclusion")]})
    world.pass_time(3.0)
    assert upload(world, [at(5, 0, 0), at(10, 0, 0)]) == "200"
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "200"
    assert upload(world, [at(95, 0, 0), at(96, 0, 0)]) == "200"
    outcomes = []
    for command, first in ((mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1), (mavlink.MAV_CMD_MISSION_START, 0)):
        fields = {"command": command, "confirmation": 0, "param1": first, **{f"param{n}": 0 for n in range(2, 8)}}
        outcomes.append(world.ask("POST", "/message", {"name": "COMMAND_LONG", "fields": fields}).outcome)
    assert outcomes == ["409 outside_envelope"] * 2 and not world.vehicle.armed
    world.pilot_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    world.pass_time(30.0)
    assert world.at[0] < 40.0 and world.vehicle.mode.name == "HOLD"


def test_a_mode_that_is_asked_for_again_and_refused_ends_no_watch(make_world: MakeWorld) -> None:
    """Nobody had chosen the mode any more in which its mission flew on: it went through the exclusion."""
    world = make_world()
    put(world, field(100, 100))
    assert upload(world, [at(0, 30, 8), at(0, 60, 8), at(0, 90, 8)]) == "200"
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "200"
    world.pass_time(2.0)
    world.fault("refuse", command=mavlink.MAV_CMD_DO_SET_MODE)
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "500 rejected"
    world.control.ask("clear")
    world.copter.mission.items[2] = item_at(*place(0, 400))
    world.until(lambda: world.copter.mode.name == "BRAKE", 60.0, step=0.1)
    world.pass_time(5.0)
    assert world.at[1] < 112.0  # it braked where its known way ended, at 90


def test_mission_read_under_an_envelope_is_read_again_once_it_is_unknown(make_world: MakeWorld) -> None:
    """Nobody knew any more where it lands, so nobody stopped it."""
    world = make_world()
    put(world, field(100, 100))
    assert upload(world, [at(0, 30, 8), at(0, 60, 8), at(0, 90, 8)]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    assert world.ask("DELETE", "/envelope").outcome == "200"
    world.fault("refuse", command=mavlink.MAV_CMD_DO_SET_MODE)
    assert world.ask("GET", "/command/set_mode?mode=AUTO").outcome == "500 rejected"
    world.control.ask("clear")
    put(world, field(100, 100))
    world.copter.mission.items[2] = item_at(*place(0, 400))
    world.until(lambda: world.copter.mode.name == "BRAKE", 60.0, step=0.1)
    world.pass_time(5.0)
    assert world.at[1] < 104.0


def test_a_landing_that_never_reaches_a_plane_ends_no_watch(make_world: MakeWorld) -> None:
    """Its mission counted as a landing, which nobody stops, and flew on to what another station had put into it."""
    world = make_world(stages.on_mission, vehicle="plane")
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(3000))]})
    world.in_mode("GUIDED")
    world.pass_time(1.5)
    assert upload(world, [at(1200, 0, 50), {"command": "DO_LAND_START"}, at(600, 0, 0, "NAV_LAND")]) == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.fault("drop", message="COMMAND_LONG", command=mavlink.MAV_CMD_DO_LAND_START)
    assert world.ask("GET", "/command/land").outcome == "504 timeout"
    put(world, {"type": "FeatureCollection", "features": [feature("wall", square(40, 700), "exclusion")]})
    world.vehicle.mission.items[1] = item_at(*place(0, 1500))
    world.until(lambda: world.vehicle.mode.name == "LOITER", 90.0, step=0.5)
    assert world.at[1] < 640.0


def test_mission_that_others_change_while_it_is_read_is_not_started(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, FIELD)
    assert upload(world, [at(0, 0, 10), at(0, 40, 10)]) == "200"
    request = message_of("MISSION_REQUEST_INT", target_system=255, target_component=190, seq=1)

    def hears(message: Any) -> bool:
        if message.get_type() == "MISSION_ITEM_INT" and message.seq == 1:  # by a link of its own, which is quicker
            world.copter.mission.items[1] = item_at(*place(95, 0))
            world.host.bridge.feed(request)
        return True

    world.hears = hears
    assert world.ask("POST", "/mission/start").outcome == "409 superseded"
    assert world.copter.mode.name == "GUIDED"


@pytest.mark.parametrize(("answer", "outcome"), [("UNSUPPORTED", "200"), ("DENIED", "500 rejected")])
def test_firmware_without_rally_points_has_none_until_it_is_given_some(
    make_world: MakeWorld, answer: str, outcome: str
) -> None:
    world = make_world()
    put(world, FIELD)
    assert upload(world, [at(0, 30, 10), {"command": "NAV_RETURN_TO_LAUNCH"}]) == "200"
    rally, number = mavlink.MAV_MISSION_TYPE_RALLY, getattr(mavlink, f"MAV_MISSION_{answer}")

    def hears(message: Any) -> bool:
        if message.get_type() != "MISSION_COUNT" or message.mission_type != rally:
            return True
        world.host.bridge.feed(message_of("MISSION_ACK", mission_type=rally, type=number))
        return False

    world.hears = hears
    assert world.ask("POST", "/mission/start").outcome == outcome


@pytest.mark.parametrize("waits", [True, False])
def test_vehicle_that_waits_or_pauses_in_its_mission_counts_as_standing(
    pair: Fleet,  # noqa: F811
    waits: bool,
) -> None:
    """It was forecast as if it flew on at once: a way through its place, 17 s later, was allowed."""
    assert pair.ask(2, "movement/go_to_gps_wait", to(80, 200)).outcome == "200"
    there = {"param1": 300} if waits else {}
    items = {"items": [at(0, 0, 10), at(80, 0, 10, **there), at(160, 0, 10), at(160, -60, 10)]}
    assert pair.world.ask("POST", "/vehicles/1/mission/waypoints", items).outcome == "200"
    assert pair.ask(1, "mission/start").outcome == "200"
    pair.world.until(lambda: pair.at(pair.world.simulators[0])[0] > (78 if waits else 50), step=0.1)
    if not waits:
        assert pair.ask(1, "movement/stop").outcome == "200"
    pair.loop.pass_time(8.0)
    north = pair.at(pair.world.simulators[0])[0]
    assert mode(pair, 1) == "AUTO"
    assert pair.ask(2, "movement/go_to_gps", to(north, -100)).outcome == "409 too_near"
    assert pair.ask(2, "movement/go_to_gps", to(north - 40, -100)).outcome == "200"
