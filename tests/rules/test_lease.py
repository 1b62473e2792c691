"""A client that commands and then falls silent: its vehicle is seen to, unless somebody else has it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from mavproxy_uavapi.core.oversight.endings import Policy
from tests.support import stages
from tests.support.make_world import MakeWorld
from tests.support.world import World

FAR = {"x": 300, "y": 0, "z": -8}
QUIET = "/movement/go_to_ned?lease=5&client=mission"


@pytest.fixture
def world(make_world: MakeWorld) -> Any:
    return make_world()


def speed(world: World) -> float:
    return math.hypot(*world.copter.body.velocity)


def shown(world: World) -> Any:
    return world.ask("GET", "/vehicles/1?client=watcher").body["lease"]


@pytest.mark.parametrize("wait", ["", "&wait=false"])
def test_vehicle_holds_when_the_lease_of_a_silent_client_runs_out(world: World, wait: str) -> None:
    path = QUIET.replace("go_to_ned", "go_to_ned_wait") if wait else QUIET
    assert world.ask("POST", path + wait, FAR).status in (200, 202)
    world.pass_time(4.5)
    assert speed(world) > 4.0 and shown(world)["client"] == "mission@127.0.0.1"
    world.pass_time(10.0)
    assert speed(world) < 0.3 and shown(world) is None
    assert "the lease of mission@127.0.0.1 ran out" in world.screen()
    if wait:
        jobs = world.ask("GET", "/jobs?client=watcher").body["jobs"]
        flight = next(job for job in jobs if job["verb"] == "/movement/go_to_ned_wait")
        assert flight["error"]["code"] == "aborted" and "lease" in flight["error"]["detail"]


def test_any_call_of_the_client_renews_it_and_calls_of_others_do_not(world: World) -> None:
    world.ask("POST", QUIET, FAR)
    for _ in range(4):
        world.pass_time(4.0)
        world.ask("GET", "/telemetry/gps?client=mission")
    assert speed(world) > 4.0
    for _ in range(4):
        world.pass_time(3.0)
        world.ask("GET", "/telemetry/gps?client=watcher")
    assert speed(world) < 0.3


@pytest.mark.parametrize(("policy", "mode"), [(Policy.LAND, "LAND"), (Policy.RTL, "RTL")])
def test_setting_says_what_the_vehicle_does(world: World, policy: Policy, mode: str) -> None:
    world.host.endings.on_lease_end = policy
    world.ask("POST", QUIET, FAR)
    world.pass_time(8.0)
    assert world.copter.mode.name == mode


def test_vehicle_that_somebody_else_commands_by_then_is_left_alone(world: World) -> None:
    world.ask("POST", QUIET, FAR)
    world.pass_time(2.0)
    world.ask("POST", "/movement/go_to_ned?client=other", {"x": -300, "y": 0, "z": -8})
    since = world.now
    world.pass_time(10.0)
    assert world.orders(since=since) == []
    assert world.copter.body.velocity[0] < -4.0


def test_pilot_and_landing_are_left_alone(world: World) -> None:
    world.ask("POST", QUIET, FAR)
    world.fault("pilot_mode", mode="LOITER")
    since = world.now
    world.pass_time(10.0)
    assert world.orders(since=since) == []


def test_landing_that_the_client_began_goes_on(world: World) -> None:
    world.ask("GET", "/command/land?wait=false&lease=2&client=mission")
    world.pass_time(25.0)
    assert not world.copter.armed and world.at[2] > -0.1


def test_landing_of_a_plane_by_its_mission_goes_on(make_world: MakeWorld) -> None:
    world = make_world(stages.cruising, vehicle="plane")
    assert world.ask("GET", "/command/land?wait=false&lease=3&client=mission").status == 202
    world.pass_time(12.0)
    assert shown(world) is None and world.vehicle.mode.name == "AUTO"


@pytest.mark.parametrize(("kind", "own"), [("copter", "LOITER"), ("plane", "FBWA")])
def test_guided_of_a_pilot_who_has_had_the_vehicle_back_is_his(make_world: MakeWorld, kind: str, own: str) -> None:
    """He goes back to it soon after our request for it, which his first switch has answered."""
    world = make_world({"copter": World.flying}.get(kind, stages.cruising), vehicle=kind)
    world.in_mode(own)
    world.pass_time(2.0)
    world.host.endings.on_lease_end = Policy.RTL
    assert world.ask("GET", "/command/guided?lease=8&client=mission").status == 200
    world.fault("pilot_mode", mode=own)
    world.pass_time(2.0)
    world.fault("pilot_mode", mode="GUIDED")
    world.pass_time(15.0)
    assert world.vehicle.mode.name == "GUIDED"


@pytest.mark.parametrize(
    ("kind", "policy", "mode", "heard"),
    [
        ("copter", Policy.LAND, "LAND", True),
        ("copter", Policy.LAND, "LAND", False),
        ("copter", Policy.RTL, "RTL", True),
        ("copter", Policy.RTL, "RTL", False),
        ("plane", Policy.LAND, "AUTO", True),  # that no message asks for: it has no mode to land
        ("plane", Policy.RTL, "RTL", False),
    ],
)
def test_end_of_mavproxy_leaves_what_lands_or_returns_for_a_lease(
    make_world: MakeWorld, kind: str, policy: Policy, mode: str, heard: bool
) -> None:
    """Nobody would be there to bring it down."""
    world = make_world({"copter": World.flying}.get(kind, stages.cruising), vehicle=kind)
    world.host.endings.on_lease_end = policy
    far = {**FAR, "x": 900, "z": -60} if kind == "plane" else FAR
    path = QUIET.replace("go_to_ned", "go_to_ned_wait") + "&wait=false"
    assert world.ask("POST", path, far).status == 202
    world.until(lambda: world.vehicle.mode.name == mode)
    if heard:
        world.pass_time(3.0)

    async def end() -> list[Any]:
        return [message for messages in world.host.closing_messages for message, _ in messages()]

    for message in world.run(end()):
        world.arriving.append(message)
    world.hears = lambda _message: False
    world.pass_time(3.0)
    assert world.vehicle.mode.name == mode


@pytest.mark.parametrize(("station", "mode"), [(None, "RTL"), (-600, "GUIDED"), (20, "GUIDED")])
@pytest.mark.parametrize("kind", ["copter", "plane", "rover"])
def test_place_where_guided_began_is_no_target_of_another_station(
    make_world: MakeWorld, kind: str, station: float | None, mode: str
) -> None:
    """A plane circles there and reports it; a rover and a copter stop, and report none."""
    world = make_world({"copter": World.on_mission}.get(kind, stages.on_mission), vehicle=kind)
    world.host.endings.on_lease_end = Policy.RTL
    world.pass_time(3.0)
    assert world.ask("GET", "/command/guided?lease=8&client=mission").status == 200
    began = world.at
    world.pass_time(2.0)
    if station is not None:
        world.fault("other_station", position=(began[0] + station, *began[1:]))
    world.pass_time(12.0)
    assert world.vehicle.mode.name == mode


@pytest.mark.parametrize("ends", ["lease", "client"])
def test_battery_failsafe_that_lands_a_plane_by_its_mission_has_it(make_world: MakeWorld, ends: str) -> None:
    """It stays in AUTO, and jumps to the landing sequence."""
    world = make_world(stages.cruising, vehicle="plane")
    options = {"lease": "lease=15", "client": "until_complete=true&on_disconnect=hold"}
    start = world.begin("POST", f"/mission/start?{options[ends]}&client=mission")
    world.pass_time(8.0)
    for name, value in {"BATT_FS_LOW_ACT": 2, "BATT_LOW_TIMER": 1, "BATT_LOW_VOLT": 10.5}.items():
        world.simulator.parameters.set(name, value)
    world.fault("low_battery")
    world.pass_time(5.0)
    assert (world.vehicle.mode.name, world.vehicle.mission.current) == ("AUTO", 3)
    if ends == "client":
        start.hang_up()
    world.pass_time(10.0)
    assert world.vehicle.mode.name == "AUTO" and shown(world) is None


def test_lease_is_given_back(world: World) -> None:
    world.ask("POST", QUIET, FAR)
    world.ask("POST", "/movement/go_to_ned?lease=0&client=mission", FAR)
    assert shown(world) is None
    world.pass_time(10.0)
    assert speed(world) > 4.0


@pytest.mark.parametrize("lease", [0, 20])
def test_refused_call_of_another_leaves_it(world: World, lease: int) -> None:
    world.ask("POST", QUIET, FAR)
    assert world.ask("GET", f"/command/takeoff?alt=5&lease={lease}&client=other").outcome == "409 busy"
    assert shown(world)["client"] == "mission@127.0.0.1"
    world.pass_time(12.0)
    assert speed(world) < 0.3


@pytest.mark.parametrize("lease", [0, 20])
def test_client_without_the_flight_neither_ends_nor_takes_it(world: World, lease: int) -> None:
    world.ask("POST", QUIET, FAR)
    assert world.ask("GET", f"/command/set_ground_speed?new_v=6&lease={lease}&client=other").outcome == "200"
    assert shown(world)["client"] == "mission@127.0.0.1"


def test_call_that_begins_no_flight_takes_one_when_it_is_done(world: World) -> None:
    world.ask("POST", "/movement/go_to_ned?client=mission", FAR)
    assert world.ask("DELETE", "/mission/waypoints?lease=5&client=mission").outcome == "200"
    world.pass_time(12.0)
    assert speed(world) < 0.3


@pytest.mark.parametrize("policy", [Policy.LAND, Policy.RTL])
@pytest.mark.parametrize("hold", [False, True])
def test_vehicle_that_the_end_of_the_api_stopped_stays(world: World, policy: Policy, hold: bool) -> None:
    """Nobody can renew a lease by then."""
    world.host.endings.on_lease_end = policy
    if hold:
        assert world.ask("POST", "/authority/take", {"lease": 5}).outcome == "200"
    world.ask("POST", f"/movement/go_to_ned_wait?wait=false{'' if hold else '&lease=5'}", FAR)
    world.pass_time(2.0)
    world.loop.call_soon(world.host.jobs.abort_remote, "the API is stopping")
    world.pass_time(15.0)
    assert world.copter.mode.name == "GUIDED" and speed(world) < 0.3


def test_lease_that_runs_out_on_a_silent_link_counts_when_it_is_back(world: World) -> None:
    world.ask("POST", QUIET, FAR)
    world.pass_time(1.0)
    world.cut(world.now + 9.0)
    world.pass_time(9.0)
    assert speed(world) > 4.0
    world.pass_time(6.0)
    assert speed(world) < 0.3


@pytest.mark.parametrize("query", ["lease=-1", "lease=x", "lease=nan", "lease=1e9", "client=", "client=a%20b"])
def test_lease_that_makes_no_sense_is_refused(world: World, query: str) -> None:
    assert world.ask("POST", f"/movement/go_to_ned?{query}", FAR).outcome == "422 invalid"


def test_refused_call_begins_no_lease_and_changes_none(make_world: MakeWorld) -> None:
    world = make_world(lambda world: world.flying("LOITER"))
    vehicle = world.host.registry.find(1)
    refused = world.ask("POST", "/movement/go_to_ned?lease=3&client=a", {"x": 5, "y": 0, "z": -8})
    assert refused.outcome == "409 mode_changed" and world.host.leases.of(vehicle) is None
    assert world.ask("GET", "/command/guided?lease=60&client=a").outcome == "200"
    world.fault("pilot_mode", mode="LOITER")
    world.pass_time(1.5)
    assert world.ask("POST", "/movement/go_to_ned?lease=3&client=a", {"x": 5, "y": 0, "z": -8}).status == 409
    assert world.host.leases.of(vehicle).seconds == 60


def test_resume_flies_nothing_whose_lease_ran_out_while_it_was_stopped(world: World) -> None:
    flight = world.begin("POST", QUIET.replace("go_to_ned", "go_to_ned_wait"), FAR)
    world.pass_time(3.0)
    assert world.ask("GET", "/movement/stop?client=watcher").outcome == "200"
    assert world.answer(flight).outcome == "409 superseded"
    assert world.ask("GET", "/movement/resume?client=watcher").outcome == "200"
    world.pass_time(4.0)
    assert speed(world) < 0.3
