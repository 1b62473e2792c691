"""No command that leads out of the envelope reaches the vehicle, by whatever way it comes."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.rules.fault_scenes import track
from tests.support import stages
from tests.support.envelopes import FIELD, feature, field, place, square
from tests.support.make_world import MakeWorld
from tests.support.world import World, item_at

OUT = 409, "outside_envelope"


def put(world: World, body: dict[str, Any] = FIELD, path: str = "/envelope") -> None:
    reply = world.ask("PUT", path, body)
    assert reply.outcome == "200", reply.body


def refused(world: World, method: str, path: str, body: Any = None, kind: str = "application/json") -> dict[str, Any]:
    """The body of an answer that must be a refusal for which nothing was sent."""
    since = world.now
    reply = world.ask(method, path, body, kind)
    assert (reply.status, reply.body["code"]) == OUT, reply.body
    moved = [m.get_type() for m in world.orders(since=since - 1e-9) if not asks(m)]
    assert moved == []
    return reply.body


def asks(message: Any) -> bool:
    return message.get_type() in (
        "PARAM_REQUEST_READ",
        "MISSION_REQUEST_LIST",
        "MISSION_REQUEST_INT",
        "MISSION_ACK",
    ) or (getattr(message, "command", None) in (512, 511, 401))


WPL = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t{0}\t{1}\t584\t1\n1\t0\t3\t16\t0\t0\t0\t0\t{2}\t{3}\t10\t1\n"
FAR = place(200, 0)
OUTWARDS: dict[str, tuple[str, str, Any]] = {
    "go_to_gps": ("POST", "/movement/go_to_gps", {"lat": FAR[0], "long": FAR[1], "alt": 10}),
    "go_to_gps_wait": ("POST", "/movement/go_to_gps_wait", {"lat": FAR[0], "long": FAR[1], "alt": 10}),
    "too high": ("POST", "/movement/go_to_gps", {"lat": place(5, 0)[0], "long": place(5, 0)[1], "alt": 61}),
    "go_to_ned": ("POST", "/movement/go_to_ned", {"x": 0, "y": 120, "z": -10}),
    "drive": ("POST", "/movement/drive", {"x": 0, "y": -120, "z": 0}),
    "drive_body": ("POST", "/movement/drive_body_wait", {"front": 300, "right": 0}),
    "travel": ("POST", "/movement/travel_at_ned", {"vx": 10, "vy": 10, "vz": 0}),
    "travel, up": ("POST", "/movement/travel_at_ned", {"vx": 0, "vy": 0, "vz": -20}),
    "travel_at_body": ("POST", "/movement/travel_at_body", {"front": 40, "right": 0, "duration": 60}),
    "through the mast": ("POST", "/movement/go_to_ned", {"x": 90, "y": 0, "z": -10}),
    "speed": ("GET", "/command/set_ground_speed?new_v=13", None),
    "climb speed": ("GET", "/command/set_climb_speed?new_v=5", None),
    "mission": ("POST", "/mission/waypoints", WPL.format(*place(0, 0), *FAR).encode()),
    "track": ("POST", "/mission/fly-track", {"track": track(3e-3), "ground": 584}),
    "set_home": ("GET", "/command/set_home", None),
    "a pilot's mode": ("GET", "/command/set_mode?mode=ALT_HOLD", None),
    "AUTO": ("GET", "/command/set_mode?mode=AUTO", None),
    "a parameter": ("PUT", "/parameters/RTL_ALT_M", {"value": 200}),
    "its timeout": ("PUT", "/parameters/GUID_TIMEOUT", {"value": 100}),
    "by vehicle": ("POST", "/vehicles/1/movement/go_to_ned", {"x": 0, "y": 120, "z": -10}),
}


@pytest.mark.parametrize("name", OUTWARDS)
def test_what_leads_out_is_refused_and_nothing_is_sent(make_world: MakeWorld, name: str) -> None:
    world = make_world()
    mission(world, 200)
    put(world)
    method, path, body = OUTWARDS[name]
    kind = "text/plain" if isinstance(body, bytes) else "application/json"
    answer = refused(world, method, path, body, kind)
    assert answer["detail"]
    if name in ("go_to_ned", "by vehicle"):
        assert answer["outside"]["what"] == "field" and answer["outside"]["by"] == pytest.approx(20.0, abs=0.5)
        assert answer["outside"]["at"]["alt"] == pytest.approx(10.0, abs=0.3)
    if name == "through the mast":
        assert answer["outside"]["what"] == "mast"


def test_check_answers_what_the_movement_would_and_sends_nothing(make_world: MakeWorld) -> None:
    world = make_world()
    put(world)
    near, (_, _, far) = place(10, 0), OUTWARDS["go_to_gps"]
    reply = world.ask("GET", f"/envelope/check?lat={near[0]}&long={near[1]}&alt=10")
    assert (reply.outcome, reply.body["result"]) == ("200", "Allowed")
    answer = refused(world, "GET", f"/envelope/check?lat={far['lat']}&long={far['long']}&alt=10")
    assert all(map(asks, world.orders())) and world.ask("GET", "/jobs").body["jobs"] == []
    assert answer["detail"] == world.ask("POST", "/movement/go_to_gps", far).body["detail"]


def mission(world: World, north: float) -> None:
    """The vehicle holds a mission that somebody else gave it."""
    lat, lon = place(north, 0)
    world.copter.mission.items[:] = [item_at(*place(0, 0)), item_at(lat, lon)]


def test_fleet_answers_for_each(make_world: MakeWorld) -> None:
    world = make_world()
    put(world)
    reply = world.ask("POST", "/fleet/go_to_ned", {"vehicles": [1], "x": 0, "y": 120, "z": -10})
    assert reply.body["vehicles"]["1"]["code"] == "outside_envelope"


def test_refused_command_ends_no_other(make_world: MakeWorld) -> None:
    world = make_world()
    put(world)
    wire = world.begin("POST", "/movement/go_to_ned_wait", {"x": -60, "y": 0, "z": -10})
    world.pass_time(1.0)
    refused(world, "POST", "/movement/go_to_ned", {"x": 0, "y": 120, "z": -10})
    assert world.answer(wire).outcome == "200"


@pytest.mark.parametrize(
    "path", ["/command/land", "/command/rtl", "/command/brake", "/movement/stop", "/command/guided"]
)
def test_what_stops_or_lands_is_refused_nowhere(make_world: MakeWorld, path: str) -> None:
    world = make_world()
    put(world, field(400, 400))
    assert world.ask("GET", path).outcome == "200"


def test_way_inside_is_flown(make_world: MakeWorld) -> None:
    world = make_world()
    put(world)
    assert world.ask("POST", "/movement/go_to_ned_wait", {"x": -95, "y": 95, "z": -50}).outcome == "200"
    assert world.ask("POST", "/movement/travel_at_ned", {"vx": 3, "vy": -3, "vz": 0, "duration": 4}).outcome == "200"
    assert math.dist(world.at, (-95 + 12, 95 - 12, -50)) < 6


def test_velocity_with_a_duration_ends_before_the_border(make_world: MakeWorld) -> None:
    world = make_world()
    put(world)
    reply = world.ask("POST", "/movement/travel_at_ned", {"vx": -4, "vy": 0, "vz": 0, "duration": 120})
    assert reply.outcome == "409 outside_envelope"
    world.pass_time(10.0)
    assert -100 < world.at[0] < -60 and math.hypot(*world.copter.body.velocity) < 0.3


def test_vehicle_that_momentum_carries_out_is_stopped_once_and_says_so(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, field(60, 400))
    wire = world.begin("POST", "/movement/go_to_ned_wait", {"x": 0, "y": 58, "z": -8})
    while world.at[1] < 35:
        world.pass_time(0.1)
    speed = world.copter.body.velocity[1]
    turn = world.begin("POST", "/movement/go_to_ned_wait", {"x": 50, "y": world.at[1], "z": -8})
    world.pass_time(20.0)
    assert speed > 5.0
    assert world.answer(wire).outcome == "409 superseded"
    reply = world.answer(turn)
    assert reply.outcome == "409 outside_envelope", reply.body
    assert world.copter.mode.name == "BRAKE"
    assert world.at[1] < 60.0
    stops = [m for m in world.orders() if getattr(m, "command", None) == mavlink.MAV_CMD_DO_SET_MODE]
    assert len(stops) == 1
    said = world.screen()
    assert said.count("was about to break field") == 1
    assert world.service.host.audit.entries[-1].client == "envelope"


def test_pilot_flies_out_and_is_left_alone_and_may_be_brought_back(make_world: MakeWorld) -> None:
    world = make_world()
    assert world.ask("POST", "/movement/go_to_ned", {"x": 300, "y": 0, "z": -8}).outcome == "200"
    world.pass_time(3.0)
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(0.3)
    put(world, field(20, 400))
    assert world.at[0] > 5.0 and world.copter.body.velocity[0] > 3.0  # it rolls out of the field
    switched = world.now
    world.pass_time(10.0)
    assert world.at[0] > 20.5
    assert [m for m in world.orders(since=switched) if not asks(m)] == []
    assert world.copter.mode.name == "LOITER"
    assert world.ask("GET", "/command/guided").outcome == "200"
    refused(world, "POST", "/movement/drive", {"x": 5, "y": 0, "z": 0})
    refused(world, "POST", "/movement/travel_at_ned", {"vx": 1, "vy": 0, "vz": 0})
    assert world.ask("POST", "/movement/go_to_ned_wait", {"x": 0, "y": 5, "z": -8}).outcome == "200"


def test_envelope_of_one_vehicle_and_of_all_hold_together(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, field(300, 300))
    put(world, field(50, 50), "/vehicles/1/envelope")
    refused(world, "POST", "/movement/go_to_ned", {"x": 0, "y": 60, "z": -10})
    shown = world.ask("GET", "/vehicles/1/envelope").body["envelopes"]
    assert [one["vehicle"] for one in shown] == [None, 1]
    assert world.ask("DELETE", "/vehicles/1/envelope").outcome == "200"
    assert world.ask("DELETE", "/vehicles/1/envelope").outcome == "404 not_found"
    assert world.ask("POST", "/movement/go_to_ned", {"x": 0, "y": 60, "z": -10}).outcome == "200"


def test_envelope_that_makes_no_sense_leaves_the_one_before_in_force(make_world: MakeWorld) -> None:
    world = make_world()
    put(world)
    bad = {"type": "FeatureCollection", "features": [feature("bow", [(0, 0), (9, 9), (0, 9), (9, 0)])]}
    for body, outcome in (
        (bad, "422 invalid"),
        (b"{", "400 bad_request"),
        (b"<kml", "400 bad_request"),
        (b"<kml>" + b"<a>" * 5000, "400 bad_request"),
        (b'<?xml version="1.0" encoding="klingon"?><kml/>', "400 bad_request"),
        (b'{"type": "FeatureCollection", "features": [], "limits": {"height": ' + b"9" * 401 + b"}}", "422 invalid"),
        (b'{"type": "\\ud800"}', "400 bad_request"),
        ({}, "400 bad_request"),
    ):
        assert world.ask("PUT", "/envelope", body).outcome == outcome
    refused(world, "POST", "/movement/go_to_ned", {"x": 0, "y": 120, "z": -10})
    shown = world.ask("GET", "/envelope").body["envelopes"][0]
    assert json.loads(json.dumps(shown["envelope"]))["features"][0]["properties"]["name"] == "field"
    put(world, shown["envelope"])


def test_a_preview_counts_and_draws_what_it_puts_nowhere(make_world: MakeWorld) -> None:
    world = make_world()
    answer = world.ask("PUT", "/envelope?preview=true", field(100, 50, speed=12)).body
    assert answer["result"] == "Envelope read, not in force: 1 inclusion, 1 exclusion, speed 12"
    assert (answer["inclusions"], answer["exclusions"]) == (1, 1)
    assert world.ask("GET", "/envelope").body["envelopes"] == []
    put(world, answer["envelope"])
    answer = world.ask("PUT", "/envelope", field(100, 50)).body
    assert answer["result"] == "Envelope in force: 1 inclusion, 1 exclusion" and "envelope" not in answer


def test_plainly_wrong_target_is_refused_without_any_envelope(make_world: MakeWorld) -> None:
    world = make_world()
    of_the_other_hemisphere = {"lat": -place(0, 0)[0], "long": place(0, 0)[1], "alt": 10}
    answer = refused(world, "POST", "/movement/go_to_gps", of_the_other_hemisphere)
    assert "km away" in answer["detail"]


def test_distance_and_reserve_count(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, {"type": "FeatureCollection", "features": [], "limits": {"distance": 50}})
    world.pass_time(2.0)
    assert refused(world, "POST", "/movement/go_to_ned", {"x": 60, "y": 0, "z": -10})["outside"][
        "by"
    ] == pytest.approx(10, abs=1)
    put(world, {"type": "FeatureCollection", "features": [], "limits": {"reserve": 50, "endurance": 10}})
    refused(world, "POST", "/movement/go_to_ned", {"x": 60, "y": 0, "z": -10})
    put(world, {"type": "FeatureCollection", "features": [], "limits": {"reserve": 20, "endurance": 1000}})
    assert world.ask("POST", "/movement/go_to_ned", {"x": 60, "y": 0, "z": -10}).outcome == "200"


def test_take_off_above_the_ceiling_is_refused(make_world: MakeWorld) -> None:
    world = make_world(lambda w: w.armed())
    put(world)
    refused(world, "GET", "/command/takeoff?alt=61")
    assert world.ask("GET", "/command/takeoff?alt=20").outcome == "200"


def test_mission_inside_is_uploaded_and_flown(make_world: MakeWorld) -> None:
    world = make_world()
    put(world)
    inside = WPL.format(*place(0, 0), *place(-40, 0)).encode()
    assert world.ask("POST", "/mission/waypoints", inside, "text/plain").outcome == "200"
    assert world.ask("POST", "/mission/start").outcome == "200"
    world.pass_time(20.0)
    assert world.at[0] < -35


ATTITUDE = {"time_boot_ms": 0, "type_mask": 7, "q": [1, 0, 0, 0], "body_roll_rate": 0, "body_pitch_rate": 0}
COMMAND = {"confirmation": 0, **{f"param{number}": 0 for number in range(1, 8)}}
GUIDED_ITEM = {"seq": 0, "frame": 3, "command": 16, "current": 2, "autocontinue": 0, "x": 0, "y": 0, "z": 10}
RAW: dict[str, dict[str, Any]] = {
    "SET_ATTITUDE_TARGET": {**ATTITUDE, "body_yaw_rate": 0, "thrust": 1},
    "RC_CHANNELS_OVERRIDE": {f"chan{number}_raw": 2000 for number in range(1, 9)},
    "MANUAL_CONTROL": {"target": 1, "x": 1000, "y": 0, "z": 1000, "r": 0, "buttons": 0},
    "SET_MODE": {"base_mode": 1, "custom_mode": 0},
    "MISSION_ITEM_INT": {**GUIDED_ITEM, **{f"param{number}": 0 for number in range(1, 5)}},
    "MISSION_CLEAR_ALL": {"mission_type": "MAV_MISSION_TYPE_FENCE"},
    "PARAM_SET": {"param_id": "rtl_alt", "param_value": 30000, "param_type": 9},
    "COMMAND_LONG": {**COMMAND, "command": "MAV_CMD_NAV_TAKEOFF", "param7": 200},
    "COMMAND_INT": {"frame": 3, "command": "MAV_CMD_DO_REPOSITION", "current": 0, "autocontinue": 0, "param1": -1,
                    "param2": 0, "param3": 0, "param4": 0, "x": -353700000, "y": 1491652300, "z": 10},
    "SET_HOME_POSITION": {"latitude": 0, "longitude": 0, "altitude": 0, "x": 0, "y": 0, "z": 0, "q": [1, 0, 0, 0],
                          "approach_x": 0, "approach_y": 0, "approach_z": 0},
}  # fmt: skip


@pytest.mark.parametrize("name", RAW)
def test_raw_message_that_leads_out_or_nobody_knows_where_is_refused(make_world: MakeWorld, name: str) -> None:
    world = make_world(allow_raw=True)
    put(world)
    refused(world, "POST", "/message", {"name": name, "fields": RAW[name]})


def test_mission_that_was_changed_after_it_was_looked_at_is_not_flown(make_world: MakeWorld) -> None:
    world = make_world(allow_raw=True)
    mission(world, -40)
    put(world)
    assert world.ask("POST", "/mission/start").outcome == "200"
    assert world.ask("GET", "/command/guided").outcome == "200"
    count = {"count": 3, "mission_type": 0}
    assert world.ask("POST", "/message", {"name": "MISSION_COUNT", "fields": count}).outcome == "200"
    world.pass_time(0.1)
    refused(world, "POST", "/message", {"name": "COMMAND_LONG", "fields": {**COMMAND, "command": 300}})


@pytest.mark.parametrize(("seconds", "outcome"), [(5.0, "200"), (31.0, "409 outside_envelope")])
def test_checked_mission_is_started_by_a_raw_message_for_half_a_minute(
    make_world: MakeWorld, seconds: float, outcome: str
) -> None:
    world = make_world(allow_raw=True)
    mission(world, -40)
    put(world)
    assert world.ask("POST", "/mission/start").outcome == "200"
    assert world.ask("GET", "/command/guided").outcome == "200"
    world.pass_time(seconds)
    start = {"name": "COMMAND_LONG", "fields": {**COMMAND, "command": 300}}
    assert world.ask("POST", "/message", start).outcome == outcome


@pytest.mark.parametrize("kind", ["copter", "plane", "rover"])
def test_own_mission_is_watched(make_world: MakeWorld, kind: str) -> None:
    """The autopilot reports the mission's target then, and no other station's."""
    world = make_world(World.on_mission if kind == "copter" else stages.on_mission, vehicle=kind)
    world.in_mode("GUIDED")
    world.pass_time(1.5)
    put(world, field(3000, 3000))
    assert world.ask("POST", "/mission/start", {}).outcome == "200"
    vehicle = world.host.registry.find(1)
    for _ in range(5):
        world.pass_time(1.0)
        assert (vehicle.mode, vehicle.flies_for_us) == ("AUTO", True)


@pytest.mark.parametrize(
    "paths", [("/movement/stop", "/movement/resume"), ("/command/set_mode?mode=FLIP",)], ids=["stop", "refused"]
)
def test_own_mission_is_watched_after_a_stop_that_is_over(make_world: MakeWorld, paths: tuple[str, ...]) -> None:
    world = make_world(World.on_mission)
    world.in_mode("GUIDED")
    world.pass_time(1.5)
    assert world.ask("POST", "/mission/start", {}).outcome == "200"
    for path in paths:
        world.ask("GET", path)
        world.pass_time(2.0)
    vehicle = world.host.registry.find(1)
    assert (vehicle.mode, vehicle.flies_for_us) == ("AUTO", True)


def test_refused_order_does_not_make_the_pilots_mission_ours(make_world: MakeWorld) -> None:
    world = make_world(World.on_mission)
    put(world, field(60, 400))
    world.fault("refuse", command=mavlink.MAV_CMD_DO_SET_MODE, result=mavlink.MAV_RESULT_FAILED, count=1)
    assert world.ask("GET", "/command/rtl").outcome == "500 rejected"
    since = world.now
    world.pass_time(20.0)
    assert not world.host.registry.find(1).flies_for_us
    assert [message for message in world.orders(since) if not asks(message)] == []
    assert world.vehicle.mode.name == "AUTO"


@pytest.mark.parametrize("command", [mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH])
def test_mission_that_lands_is_not_stopped_at_the_floor(make_world: MakeWorld, command: int) -> None:
    def mission_that_lands(world: World) -> None:
        world.flying()
        last = item_at(*place(30, 10))
        items = [item_at(*place(0, 0)), item_at(*place(30, 0)), last._replace(command=command, z=0.0)]
        world.copter.mission.items[:] = items

    world = make_world(mission_that_lands)
    put(world, {"type": "FeatureCollection", "features": [feature("field", square(100), floor=3, ceiling=60)]})
    assert world.ask("POST", "/mission/start", {}).outcome == "200"
    world.pass_time(4.0)
    assert world.host.registry.find(1).flies_for_us
    world.until(lambda: not world.copter.armed)
    assert "stopped" not in world.screen() and world.copter.mode.name == "AUTO"


@pytest.mark.parametrize(("link_is_full", "value"), [(False, 1.1), (True, 2.0)])
@pytest.mark.parametrize("name", ["WP_ACC", "CIRCLE_RADIUS_M"])
def test_parameter_that_was_read_is_asked_again_though_it_is_known(
    make_world: MakeWorld, name: str, link_is_full: bool, value: float
) -> None:
    world = make_world()
    world.simulator.parameters.set(name, 2.0)
    put(world)
    world.pass_time(3.0)
    vehicle = world.host.registry.find(1)
    world.loop.run_until_complete(vehicle.parameters.read([(name,)]))
    world.host.registry.link_is_full = link_is_full
    world.simulator.parameters.set(name, 1.1)  # another station has, and the report of it is lost
    world.pass_time(35.0)
    assert vehicle.state.parameters[name] == pytest.approx(value)


@pytest.mark.parametrize(("each_way", "beyond"), [(0.0, 0.0), (0.9, 7.0)])  # it gains speed until a late stop arrives
def test_way_that_a_newer_envelope_forbids_is_not_flown_to_its_border(
    make_world: MakeWorld, each_way: float, beyond: float
) -> None:
    world = make_world()
    put(world, field(300.0, 400))
    world.delay(each_way)
    world.pass_time(6.0)
    world.begin("POST", "/movement/go_to_ned_wait", {"x": 0, "y": 200, "z": -8})
    world.until(lambda: world.at[1] > 20, step=0.05)
    put(world, field(60.0, 400))
    world.until(lambda: world.vehicle.mode.name == "BRAKE", step=0.05)
    world.pass_time(8.0)
    assert world.at[1] < 60.0 + beyond


def test_way_that_a_newer_envelope_allows_is_flown_to_its_end(make_world: MakeWorld) -> None:
    world = make_world()
    put(world, field(300.0, 400))
    world.pass_time(3.0)
    going = world.begin("POST", "/movement/go_to_ned_wait", {"x": 0, "y": 58, "z": -8})  # it swings by 1 m
    world.until(lambda: world.at[1] > 20, step=0.05)
    put(world, field(60.0, 400))
    assert world.answer(going).outcome == "200"
