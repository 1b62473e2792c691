from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import (
    Aborted,
    Busy,
    Invalid,
    LinkLost,
    ModeChanged,
    NotArmed,
    Paused,
    Rejected,
    Stale,
    Superseded,
    TimedOut,
)
from mavproxy_uavapi.core.vehicle.messages import GlobalTarget, NedTarget, VelocityTarget

mavlink = mavutil.mavlink
TAKEOFF, MODE = mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_DO_SET_MODE
PAUSE, YAW = mavlink.MAV_CMD_DO_PAUSE_CONTINUE, mavlink.MAV_CMD_CONDITION_YAW
FAR = NedTarget(200.0, 0.0, -20.0)
STILL = (0.0, 0.0, 0.0)


@pytest.fixture
def armed(loop: Any, drone: Any) -> Any:
    """The drone on the ground, armed in GUIDED."""
    drone.mode, drone.armed = "GUIDED", True
    loop.pass_time(0.3)
    return drone


def numbers(drone: Any) -> list[int]:
    return [message.command for message in drone.commands() if message in drone.orders()]


def nothing_more(loop: Any, drone: Any) -> None:
    """Nothing but questions is sent for a long while."""
    before = len(drone.orders())
    loop.pass_time(30.0)
    assert drone.orders()[before:] == []


def place(drone: Any, north: float, east: float) -> tuple[float, float]:
    lat, lon = drone.place((north, east))
    return lat / 1e7, lon / 1e7


# -- takeoff ----------------------------------------------------------------------------------------------


def test_takeoff_is_done_at_its_altitude(loop: Any, armed: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.takeoff, 12.5)
    assert [(m.command, m.param7) for m in armed.orders()] == [(TAKEOFF, 12.5)]
    assert copter.height == pytest.approx(12.5, abs=0.65)


@pytest.mark.parametrize(("alt", "short"), [(2.0, 0.35), (10.0, 0.6), (100.0, 1.1)])
def test_takeoff_that_stays_below_is_a_timeout(
    armed: Any, loop: Any, copter: Any, pilotage: Any, alt: float, short: float
) -> None:
    armed.answers[TAKEOFF] = [mavlink.MAV_RESULT_ACCEPTED]
    armed.target, armed.lifting = [0.0, 0.0, -(alt - short)], True
    with pytest.raises(TimedOut, match=f"did not reach {alt:g} m"):
        pilotage.do(copter.takeoff, alt)


@pytest.mark.parametrize(("alt", "short"), [(2.0, 0.25), (10.0, 0.45), (100.0, 0.95)])
def test_takeoff_tolerance_is_a_share_of_the_altitude(
    armed: Any, copter: Any, pilotage: Any, alt: float, short: float
) -> None:
    armed.answers[TAKEOFF] = [mavlink.MAV_RESULT_ACCEPTED]
    armed.target, armed.lifting = [0.0, 0.0, -(alt - short)], True
    pilotage.do(copter.takeoff, alt)


def test_takeoff_is_not_done_while_it_shoots_past(loop: Any, armed: Any, copter: Any, pilotage: Any) -> None:
    armed.answers[TAKEOFF] = [mavlink.MAV_RESULT_ACCEPTED]
    armed.target, armed.lifting = [0.0, 0.0, -60.0], True
    job = pilotage.start(copter.takeoff, 10.0)
    loop.pass_time(20.0)
    assert copter.height > 40
    assert job.running


def test_takeoff_of_a_disarmed_vehicle_sends_nothing(loop: Any, drone: Any, copter: Any, pilotage: Any) -> None:
    drone.pilot("GUIDED")
    loop.settle()
    with pytest.raises(NotArmed):
        pilotage.do(copter.takeoff, 10.0)
    nothing_more(loop, drone)


def test_takeoff_in_another_mode_sends_nothing(loop: Any, armed: Any, copter: Any, pilotage: Any) -> None:
    armed.pilot("STABILIZE")
    loop.settle()
    with pytest.raises(ModeChanged, match="`guided`"):
        pilotage.do(copter.takeoff, 10.0)
    nothing_more(loop, armed)


def test_takeoff_in_flight_is_busy_and_supersedes_nothing(flying: Any, loop: Any, copter: Any, pilotage: Any) -> None:
    going = pilotage.start(copter.go_to, FAR, wait=True)
    with pytest.raises(Busy, match="flying already"):
        pilotage.do(copter.takeoff, 10.0)
    assert going.running
    assert flying.commands(TAKEOFF) == []


def test_takeoff_whose_ack_is_lost_is_known_by_its_lifting_off(armed: Any, copter: Any, pilotage: Any) -> None:
    armed.deaf.add(TAKEOFF)
    pilotage.do(copter.takeoff, 30.0)
    assert len(armed.commands(TAKEOFF)) == 1
    assert copter.height == pytest.approx(30.0, abs=1.0)


def test_takeoff_without_ack_and_lift_off_is_a_timeout(loop: Any, armed: Any, copter: Any, pilotage: Any) -> None:
    armed.answers[TAKEOFF] = [None]
    started = loop.time()
    with pytest.raises(TimedOut, match="acknowledge the takeoff, and did not leave the ground"):
        pilotage.do(copter.takeoff, 30.0)
    assert loop.time() - started < 10.0
    assert len(armed.commands(TAKEOFF)) == 1


def test_refused_takeoff_is_rejected_with_the_reason(armed: Any, copter: Any, pilotage: Any) -> None:
    armed.answers[TAKEOFF] = [mavlink.MAV_RESULT_FAILED]
    armed.says[TAKEOFF] = ["Takeoff: no"]
    with pytest.raises(Rejected) as caught:
        pilotage.do(copter.takeoff, 10.0)
    assert caught.value.statustext == ["Takeoff: no"]


@pytest.mark.parametrize("verb", ["takeoff", "land", "rtl", "go_to", "travel"])
def test_command_goes_out_before_any_parameter_is_asked_for(
    loop: Any, armed: Any, copter: Any, pilotage: Any, verb: str
) -> None:
    armed.parameters.clear()
    arguments: dict[str, Any] = {
        "takeoff": {"alt": 10.0}, "go_to": {"target": FAR, "wait": True},
        "travel": {"velocity": VelocityTarget(1.0, 0.0, 0.0), "duration": 5.0},
    }  # fmt: skip
    if verb != "takeoff":
        armed.fly()
        loop.settle()
    began = loop.time()
    pilotage.start(getattr(copter, verb), **arguments.get(verb, {}))
    first = armed.got[0]
    assert first.get_type().startswith(("COMMAND_LONG", "SET_POSITION_TARGET"))
    assert loop.time() == began


def test_takeoff_takes_as_long_as_its_height_needs(loop: Any, armed: Any, copter: Any, pilotage: Any) -> None:
    started = loop.time()
    pilotage.do(copter.takeoff, 300.0)
    assert loop.time() - started > 110.0


# -- land and return --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("verb", "mode"), [("land", "LAND"), ("rtl", "RTL")])
def test_land_and_rtl_are_done_when_it_has_disarmed(
    flying: Any, copter: Any, pilotage: Any, verb: str, mode: str
) -> None:
    flying.at = [50.0, 20.0, -20.0]
    pilotage.do(getattr(copter, verb))
    assert [(m.command, int(m.param2)) for m in flying.orders()] == [(MODE, {"LAND": 9, "RTL": 6}[mode])]
    assert not flying.armed
    assert copter.state.armed is False
    assert math.hypot(*flying.at[:2]) == pytest.approx(0.0 if mode == "RTL" else math.hypot(50, 20), abs=0.1)


@pytest.mark.parametrize("verb", ["land", "rtl"])
def test_land_and_rtl_on_the_ground_send_nothing(
    loop: Any, drone: Any, copter: Any, pilotage: Any, verb: str
) -> None:
    loop.run(copter.home())
    started = loop.time()
    pilotage.do(getattr(copter, verb))
    assert loop.time() == started
    nothing_more(loop, drone)


def test_rtl_on_the_ground_away_from_home_is_not_armed(loop: Any, drone: Any, copter: Any, pilotage: Any) -> None:
    drone.at = [50.0, 0.0, 0.0]
    loop.run(copter.home())
    loop.pass_time(0.5)
    with pytest.raises(NotArmed, match="disarmed, 50 m from home"):
        pilotage.do(copter.rtl)
    nothing_more(loop, drone)


def test_rtl_of_a_vehicle_that_is_armed_while_its_home_is_asked_for_is_not_done(
    loop: Any, drone: Any, copter: Any, pilotage: Any
) -> None:
    drone.answers[mavlink.MAV_CMD_REQUEST_MESSAGE] = [None]
    job = pilotage.start(copter.rtl)
    drone.fly("STABILIZE")
    loop.settle()
    drone.answers.clear()
    loop.pass_time(10.0)
    assert isinstance(job.error, ModeChanged) and drone.mode == "STABILIZE"


def test_rtl_on_the_ground_away_from_a_home_that_was_not_told_yet_is_not_done(
    loop: Any, drone: Any, copter: Any, pilotage: Any
) -> None:
    drone.at = [50.0, 0.0, 0.0]
    loop.pass_time(0.5)
    with pytest.raises(NotArmed):
        pilotage.do(copter.rtl)


@pytest.mark.parametrize("verb", ["land", "rtl"])
def test_landing_that_never_ends_is_a_timeout(flying: Any, copter: Any, pilotage: Any, verb: str) -> None:
    flying.stuck = True
    with pytest.raises(TimedOut, match=f"did not land and disarm in {verb.upper()}"):
        pilotage.do(getattr(copter, verb))


def test_reboot_while_landing_is_not_a_landing(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    flying.stuck = True
    job = pilotage.start(copter.land)
    loop.pass_time(2.0)
    flying.power_off()
    flying.send("attitude", time_boot_ms=300)
    flying.send("global_position_int", relative_alt=20_000)
    with pytest.raises(NotArmed, match="rebooted"):
        pilotage.result(job)


def test_landing_tells_its_height(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    loop.run(copter.home())
    job = pilotage.start(copter.land)
    loop.pass_time(4.0)
    assert 10 < job.progress["altitude"] < 18
    assert job.progress["distance_to_go"] == pytest.approx(0.0, abs=0.1)


# -- go to ------------------------------------------------------------------------------------------------


def test_go_to_ned_sends_one_setpoint_and_answers_at_once(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    started = loop.time()
    pilotage.do(copter.go_to, NedTarget(30.0, 40.0, -10.0))
    assert loop.time() == started
    assert [(m.x, m.y, m.z, m.type_mask) for m in flying.setpoints()] == [(30.0, 40.0, -10.0, 0b1101_1111_1000)]
    nothing_more(loop, flying)


def test_go_to_ned_with_wait_is_done_on_arrival(flying: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.go_to, NedTarget(30.0, 40.0, -10.0), wait=True)
    assert flying.at == pytest.approx([30.0, 40.0, -10.0], abs=1.0)
    assert flying.velocity == pytest.approx(STILL, abs=0.5)
    assert len(flying.setpoints()) == 1


def test_go_to_gps_is_in_degrees_above_home(flying: Any, copter: Any, pilotage: Any) -> None:
    lat, lon = place(flying, 30.0, 40.0)
    pilotage.do(copter.go_to, GlobalTarget(lat, lon, 25.0), wait=True)
    setpoint = flying.setpoints()[0]
    assert (setpoint.lat_int, setpoint.lon_int, setpoint.alt) == (round(lat * 1e7), round(lon * 1e7), 25.0)
    assert flying.at == pytest.approx([30.0, 40.0, -25.0], abs=1.0)


@pytest.mark.parametrize("off", [(2.9, 0.0, 0.0), (0.0, 2.9, 0.0), (0.0, 0.0, 2.9), (0.0, 0.0, -2.9), (0.8, 0.8, 0)])
@pytest.mark.parametrize("frame", ["ned", "gps"])
def test_off_on_one_axis_is_not_arrival(
    flying: Any, loop: Any, copter: Any, pilotage: Any, off: tuple[float, float, float], frame: str
) -> None:
    flying.stuck = True
    flying.at = [10.0 + off[0], 10.0 + off[1], -20.0 + off[2]]
    loop.pass_time(1.0)
    target = NedTarget(10.0, 10.0, -20.0) if frame == "ned" else GlobalTarget(*place(flying, 10.0, 10.0), 20.0)
    with pytest.raises(TimedOut, match="did not arrive"):
        pilotage.do(copter.go_to, target, wait=True)


@pytest.mark.parametrize("frame", ["ned", "gps"])
def test_passing_through_the_target_is_not_arrival(
    flying: Any, loop: Any, copter: Any, pilotage: Any, frame: str
) -> None:
    flying.mute |= {"LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"}
    target = NedTarget(0.0, 0.0, -20.0) if frame == "ned" else GlobalTarget(*place(flying, 0.0, 0.0), 20.0)
    job = pilotage.start(copter.go_to, target, wait=True)
    lat, lon = flying.place(STILL[:2])

    def tell(speed: float) -> None:
        flying.send("local_position_ned", z=-20.0, vy=speed)
        flying.send("global_position_int", lat=lat, lon=lon, relative_alt=20_000, vy=round(speed * 100))
        loop.pass_time(0.25)

    tell(3.0)
    tell(0.6)
    assert job.running
    tell(0.4)
    assert pilotage.result(job) == "done"


def test_tolerance_can_be_wider(flying: Any, loop: Any, copter: Any, pilotage: Any) -> None:
    flying.stuck = True
    flying.at = [3.0, 0.0, -23.0]
    loop.pass_time(1.0)
    pilotage.do(copter.go_to, NedTarget(0.0, 0.0, -20.0), wait=True, tolerance=4.0)


@pytest.mark.parametrize("frame", ["ned", "gps"])
def test_target_below_home_is_invalid_and_nothing_is_sent(
    flying: Any, loop: Any, copter: Any, pilotage: Any, frame: str
) -> None:
    going = pilotage.start(copter.go_to, FAR, wait=True)
    before = len(flying.orders())
    target = NedTarget(0.0, 0.0, 5.0) if frame == "ned" else GlobalTarget(*place(flying, 0.0, 0.0), -5.0)
    with pytest.raises(Invalid, match=r"below home"):
        pilotage.do(copter.go_to, target)
    assert len(flying.orders()) == before
    assert going.running


@pytest.mark.parametrize(
    ("name", "target"),
    [("LOCAL_POSITION_NED", NedTarget(10, 0, -20)), ("GLOBAL_POSITION_INT", GlobalTarget(-35.0, 149.0, 20.0))],
)
def test_nothing_is_sent_by_a_stale_position(
    flying: Any, loop: Any, copter: Any, pilotage: Any, name: str, target: Any
) -> None:
    flying.mute.add(name)
    loop.pass_time(4.0)
    with pytest.raises(Stale):
        pilotage.do(copter.go_to, target, wait=True)
    nothing_more(loop, flying)


def test_gap_in_the_telemetry_does_not_end_a_flight(flying: Any, loop: Any, copter: Any, pilotage: Any) -> None:
    job = pilotage.start(copter.go_to, FAR, wait=True)
    loop.pass_time(2.0)
    flying.mute.add("LOCAL_POSITION_NED")
    loop.pass_time(10.0)
    assert job.running
    flying.mute.clear()
    assert pilotage.result(job) == "done"


@pytest.mark.parametrize(
    ("setup", "error"),
    [
        (lambda drone: drone.pilot("LOITER"), ModeChanged),
        (lambda drone: setattr(drone, "armed", False), NotArmed),
        (lambda drone: setattr(drone, "landed", mavlink.MAV_LANDED_STATE_ON_GROUND), Busy),
    ],
    ids=["in LOITER", "disarmed", "on the ground"],
)
@pytest.mark.parametrize("verb", ["go_to", "travel", "set_yaw_rate"])
def test_movement_that_the_state_forbids_sends_nothing(
    flying: Any, loop: Any, copter: Any, pilotage: Any, setup: Callable[[Any], None], error: type, verb: str
) -> None:
    setup(flying)
    loop.pass_time(0.5)
    with pytest.raises(error):
        if verb == "set_yaw_rate":
            pilotage.do(copter.set_yaw_rate, 10.0)
        else:
            pilotage.do(getattr(copter, verb), FAR if verb == "go_to" else VelocityTarget(1, 0, 0))
    nothing_more(loop, flying)


def test_look_at_target_points_along_the_way(flying: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.go_to, NedTarget(0.0, 30.0, -20.0), look_at_target=True)
    setpoint = flying.setpoints()[0]
    assert setpoint.yaw == pytest.approx(math.pi / 2)
    assert not setpoint.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE


def test_progress_is_height_and_way_to_go(flying: Any, loop: Any, copter: Any, pilotage: Any) -> None:
    job = pilotage.start(copter.go_to, FAR, wait=True)
    loop.pass_time(5.0)
    assert job.progress == {"altitude": 20.0, "distance_to_go": pytest.approx(150.0, abs=6.0)}


def test_own_timeout_ends_a_flight(flying: Any, loop: Any, copter: Any, pilotage: Any) -> None:
    started = loop.time()
    with pytest.raises(TimedOut):
        pilotage.do(copter.go_to, FAR, wait=True, timeout=3.0)
    assert loop.time() - started == pytest.approx(3.0, abs=0.3)


def test_offset_from_here(flying: Any, loop: Any, copter: Any) -> None:
    flying.at, flying.yaw = [10.0, 20.0, -30.0], math.radians(90)
    loop.pass_time(0.5)
    assert copter.ned_from_here(1.0, 2.0, -3.0) == NedTarget(11.0, 22.0, -33.0)
    body = copter.body_from_here(5.0, 2.0, 1.0)
    assert (body.x, body.y, body.z) == pytest.approx((8.0, 25.0, -29.0))


def test_speed_that_is_set_while_another_is_repeated_disturbs_no_movement(
    loop: Any, flying: Any, copter: Any, pilotage: Any
) -> None:
    for kind in ("ground", "descent"):
        pilotage.do(copter.set_speed, kind, 1.0)
    job = pilotage.start(copter.go_to, FAR)  # repeats the speeds, for the kind of setpoint has changed
    climb = pilotage.start(copter.set_speed, "climb", 1.0)
    assert pilotage.result(job) == "done"
    assert pilotage.result(climb) == "done"
    assert copter.speeds.in_force == dict.fromkeys(("ground", "descent", "climb"), 1.0)


# -- travel -----------------------------------------------------------------------------------------------


def test_travel_sends_one_velocity(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.travel, VelocityTarget(1.0, 2.0, -0.5))
    assert [(m.vx, m.vy, m.vz, m.type_mask) for m in flying.setpoints()] == [(1.0, 2.0, -0.5, 0b1101_1100_0111)]
    nothing_more(loop, flying)


def test_travel_with_duration_repeats_the_velocity_then_stops(
    loop: Any, flying: Any, copter: Any, pilotage: Any
) -> None:
    started, times = loop.time(), []
    copter.link.on_send = lambda message, system: (
        times.append(loop.time() - started),
        flying.on_send(message, system),
    )
    loop.run(copter.limits())
    times.clear()
    pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=10.0)
    assert loop.time() - started == pytest.approx(10.0, abs=0.3)
    velocities = [(m.vx, m.vy, m.vz) for m in flying.setpoints()]
    assert velocities == [(1.0, 0.0, 0.0)] * 10 + [STILL]
    gaps = [after - before for before, after in zip(times, times[1:], strict=False)]
    assert max(gaps) <= 1.1  # ArduCopter drops a velocity after GUID_TIMEOUT, 3 s
    nothing_more(loop, flying)


def test_travel_follows_the_vehicles_own_timeout(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    flying.parameters["GUID_TIMEOUT"] = 0.6
    pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=2.0)
    assert len(flying.setpoints()) == 11


def test_travel_counts_the_vehicles_seconds(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    copter.state.time_ratio.ratio = 5.0
    copter.state.time_ratio.update = lambda *args: False
    started = loop.time()
    pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=10.0)
    assert loop.time() - started == pytest.approx(2.0, abs=0.2)


# -- yaw --------------------------------------------------------------------------------------------------


def test_heading_is_turned_to_the_shorter_way(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.set_heading, 359.0)
    assert [(m.command, m.param1, m.param3, m.param4) for m in flying.orders()] == [(YAW, 359.0, 0, 0)]


@pytest.mark.parametrize("verb", ["set_heading", "stop", "resume"])
def test_guided_only_verbs_leave_the_pilot_alone(
    loop: Any, flying: Any, copter: Any, verb: str, pilotage: Any
) -> None:
    flying.pilot("LOITER")
    loop.settle()
    with pytest.raises(ModeChanged):
        pilotage.do(getattr(copter, verb), *([90.0] if verb == "set_heading" else []))
    nothing_more(loop, flying)


def test_yaw_rate_repeats_the_position_that_is_flown_to(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    job = pilotage.start(copter.go_to, FAR, wait=True)
    loop.pass_time(1.0)
    pilotage.do(copter.set_yaw_rate, 90.0)
    _, second = flying.setpoints()
    assert (second.lat_int, second.lon_int) == flying.place((200.0, 0.0))
    assert second.alt == pytest.approx(20.0, abs=0.01)
    assert second.yaw_rate == pytest.approx(math.pi / 2)
    assert second.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    assert not second.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    assert job.running


def test_yaw_rate_without_a_movement_holds_the_place(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.set_yaw_rate, -45.0)
    setpoint = flying.setpoints()[0]
    assert (setpoint.x, setpoint.y, setpoint.z) == (0.0, 0.0, -20.0)
    assert setpoint.yaw_rate == pytest.approx(-math.pi / 4)


def test_yaw_rate_repeats_the_velocity_that_the_autopilot_tells(
    loop: Any, flying: Any, copter: Any, pilotage: Any
) -> None:
    flying.moving = [1.0, 0.0, 0.0]  # another station's
    pilotage.do(copter.set_yaw_rate, 10.0)
    assert flying.setpoints()[-1].vx == 1.0


def test_yaw_rate_does_not_fly_back_to_a_target_of_ours_that_another_station_has_replaced(
    loop: Any, flying: Any, copter: Any, pilotage: Any
) -> None:
    pilotage.do(copter.go_to, NedTarget(50.0, 0.0, -20.0), wait=True)
    flying.target, flying.at = [0.0, 0.0, -20.0], [0.0, 0.0, -20.0]
    pilotage.do(copter.set_yaw_rate, 10.0)
    last = flying.setpoints()[-1]
    assert place(flying, 0.0, 0.0) == pytest.approx((last.lat_int / 1e7, last.lon_int / 1e7), abs=1e-6)
    assert last.alt == pytest.approx(20.0, abs=0.1)


def test_yaw_rate_holds_the_place_where_the_autopilot_does_not_tell_its_target(
    loop: Any, flying: Any, copter: Any, pilotage: Any
) -> None:
    pilotage.do(copter.go_to, FAR)
    loop.pass_time(0.3)
    flying.target = None  # as after a take-off: POSITION_TARGET_LOCAL_NED tells an old place
    pilotage.do(copter.set_yaw_rate, 10.0)
    last = flying.setpoints()[-1]
    assert (last.x, last.z) == pytest.approx((flying.at[0], flying.at[2]), abs=3.0)


def test_yaw_rate_in_a_takeoff_is_busy(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    flying.landed = mavlink.MAV_LANDED_STATE_TAKEOFF
    loop.pass_time(0.3)
    with pytest.raises(Busy, match="taking off"):
        pilotage.do(copter.set_yaw_rate, 10.0)
    assert flying.setpoints() == []


def test_yaw_rate_is_not_sent_when_the_pilot_switches_while_the_target_is_asked_for(
    loop: Any, flying: Any, copter: Any, pilotage: Any
) -> None:
    flying.mute_requests = True
    job = pilotage.start(copter.set_yaw_rate, 10.0)
    loop.pass_time(0.5)
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged):
        pilotage.result(job)
    assert flying.setpoints() == []


def test_heading_is_done_when_the_attitude_shows_it(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    flying.answers[YAW] = [mavlink.MAV_RESULT_ACCEPTED]
    job = pilotage.start(copter.set_heading, 350.0)
    loop.pass_time(5.0)
    assert job.running
    flying.yaw = math.radians(-9.0)
    assert pilotage.result(job) == "done"


def test_movement_ends_the_turn_that_it_undoes(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    flying.answers[YAW] = [mavlink.MAV_RESULT_ACCEPTED]
    turn = pilotage.start(copter.set_heading, 350.0)
    pilotage.do(copter.go_to, FAR)
    with pytest.raises(Superseded):
        pilotage.result(turn)


# -- stop and resume --------------------------------------------------------------------------------------


def test_stop_and_resume_leave_the_waiting_flight_waiting(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    job = pilotage.start(copter.go_to, NedTarget(100.0, 0.0, -20.0), wait=True)
    loop.pass_time(3.0)
    pilotage.do(copter.stop)
    loop.pass_time(5.0)
    stopped_at = list(flying.at)
    assert 20 < stopped_at[0] < 50
    assert job.running
    pilotage.do(copter.resume)
    assert pilotage.result(job) == "done"
    assert [m.param1 for m in flying.commands(PAUSE)] == [0, 1]


@pytest.mark.parametrize("verb", ["go_to", "travel", "set_heading", "set_yaw_rate"])
def test_movements_are_refused_while_the_vehicle_is_stopped(
    loop: Any, flying: Any, copter: Any, pilotage: Any, verb: str
) -> None:
    pilotage.do(copter.stop)
    flying.got.clear()
    arguments = {"go_to": FAR, "travel": VelocityTarget(1.0, 0.0, 0.0), "set_heading": 90.0, "set_yaw_rate": 10.0}
    with pytest.raises(Paused, match="`resume`"):
        pilotage.do(getattr(copter, verb), arguments[verb])
    nothing_more(loop, flying)


def test_movement_that_streams_ends_when_the_vehicle_is_stopped(
    loop: Any, flying: Any, copter: Any, pilotage: Any
) -> None:
    job = pilotage.start(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=60.0)
    loop.pass_time(3.0)
    pilotage.do(copter.stop)
    with pytest.raises(Paused):
        pilotage.result(job)
    nothing_more(loop, flying)


def test_stop_is_done_when_it_stands_still(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.go_to, FAR)
    loop.pass_time(2.0)
    flying.answers[PAUSE] = [mavlink.MAV_RESULT_ACCEPTED]  # and flies on
    job = pilotage.start(copter.stop)
    loop.pass_time(5.0)
    assert job.running
    flying.paused = True
    assert pilotage.result(job) == "done"


def test_refused_stop_stops_nothing(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    flying.answers[PAUSE] = [mavlink.MAV_RESULT_DENIED]
    with pytest.raises(Rejected):
        pilotage.do(copter.stop)
    pilotage.do(copter.go_to, FAR)


def test_guided_ends_a_stop_where_it_is(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    job = pilotage.start(copter.go_to, FAR, wait=True)
    pilotage.do(copter.stop)
    flying.got.clear()
    pilotage.do(copter.set_mode, "GUIDED")
    with pytest.raises(Superseded):
        pilotage.result(job)
    kinds = [m.get_type() for m in flying.orders()]
    assert kinds == ["COMMAND_LONG", "SET_POSITION_TARGET_LOCAL_NED", "COMMAND_LONG"]
    assert [m.param1 for m in flying.commands(PAUSE)] == [1]
    pilotage.do(copter.go_to, FAR)


def test_takeoff_ends_a_stop(loop: Any, armed: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.stop)
    pilotage.do(copter.takeoff, 5.0)
    assert numbers(armed) == [PAUSE, TAKEOFF, PAUSE]
    pilotage.do(copter.go_to, FAR)


def test_pilots_mode_change_ends_our_stop(loop: Any, flying: Any, copter: Any, pilotage: Any) -> None:
    pilotage.do(copter.stop)
    flying.pilot("LOITER")
    loop.pass_time(1.0)
    flying.pilot("GUIDED")
    loop.pass_time(1.0)
    flying.got.clear()
    pilotage.do(copter.go_to, FAR)
    assert flying.commands(PAUSE) == []


def test_mission_that_cannot_be_paused_is_left_for_brake(loop: Any, drone: Any, copter: Any, pilotage: Any) -> None:
    drone.fly("AUTO")
    loop.settle()
    drone.answers[PAUSE] = [mavlink.MAV_RESULT_FAILED]
    pilotage.do(copter.stop)
    assert drone.mode == "BRAKE"


def test_stop_in_a_pilots_mode_sends_nothing(loop: Any, drone: Any, copter: Any, pilotage: Any) -> None:
    drone.fly("LOITER")
    loop.settle()
    with pytest.raises(ModeChanged, match="`brake`"):
        pilotage.do(copter.stop)
    nothing_more(loop, drone)


# -- who has the command ----------------------------------------------------------------------------------


def waiting_verbs() -> dict[str, Callable[[Any, Any], Any]]:
    """Each verb that waits, begun by `verb(copter, pilotage)`, from the air unless it is the takeoff."""
    return {
        "go_to_ned": lambda copter, pilotage: pilotage.start(copter.go_to, FAR, wait=True),
        "go_to_gps": lambda copter, pilotage: pilotage.start(
            copter.go_to, GlobalTarget(-35.002, 149.0, 20.0), wait=True
        ),
        "travel": lambda copter, pilotage: pilotage.start(copter.travel, VelocityTarget(1, 0, 0), duration=60.0),
        "land": lambda copter, pilotage: pilotage.start(copter.land),
        "rtl": lambda copter, pilotage: pilotage.start(copter.rtl),
        "takeoff": lambda copter, pilotage: pilotage.start(copter.takeoff, 100.0),
    }


@pytest.fixture(params=waiting_verbs())
def waiting(request: Any, loop: Any, drone: Any, copter: Any, pilotage: Any) -> Any:
    """A verb that waits, three seconds after it began."""
    if request.param == "takeoff":
        drone.mode, drone.armed = "GUIDED", True
    else:
        drone.fly()
    loop.pass_time(0.3)
    job = waiting_verbs()[request.param](copter, pilotage)
    loop.pass_time(3.0)
    assert job.running
    return job


@pytest.mark.parametrize("mode", ["LOITER", "STABILIZE", "BRAKE"])
def test_pilot_mode_change_ends_every_wait_and_sends_nothing_more(
    waiting: Any, loop: Any, drone: Any, pilotage: Any, mode: str
) -> None:
    drone.pilot(mode)
    started = loop.time()
    with pytest.raises(ModeChanged, match=mode):
        pilotage.result(waiting)
    assert loop.time() - started < 0.05
    nothing_more(loop, drone)
    assert drone.mode == mode


def test_newer_verb_supersedes_every_wait_at_once(
    waiting: Any, loop: Any, drone: Any, copter: Any, pilotage: Any
) -> None:
    client = loop.create_task(waiting.outcome())
    loop.settle()
    started = loop.time()
    pilotage.start(copter.set_mode, "BRAKE")
    with pytest.raises(Superseded, match="was superseded by set_mode"):
        loop.run(client)
    assert loop.time() == started
    loop.pass_time(1.0)
    assert drone.mode == "BRAKE"
    nothing_more(loop, drone)


def test_client_that_hangs_up_ends_the_verb_and_nothing_more_is_sent(waiting: Any, loop: Any, drone: Any) -> None:
    client = loop.create_task(waiting.outcome())
    loop.settle()
    client.cancel()
    loop.settle()
    assert isinstance(waiting.error, Aborted)
    nothing_more(loop, drone)


def test_link_loss_ends_every_wait(waiting: Any, loop: Any, host: Any, drone: Any, pilotage: Any) -> None:
    drone.power_off()
    started = loop.time()
    with pytest.raises(LinkLost):
        pilotage.result(waiting)
    assert loop.time() - started <= host.link_watch.timeout + 0.1
    assert len(host.pending) == 0
    nothing_more(loop, drone)


def test_disarming_ends_every_flight(waiting: Any, loop: Any, drone: Any, pilotage: Any) -> None:
    drone.armed = False
    drone.tell("HEARTBEAT")
    if waiting.verb.startswith(("land", "rtl")):
        assert pilotage.result(waiting) == "done"
    else:
        with pytest.raises(NotArmed):
            pilotage.result(waiting)
    nothing_more(loop, drone)


def test_newer_target_takes_over_while_the_older_client_is_told(
    loop: Any, flying: Any, copter: Any, pilotage: Any
) -> None:
    older = pilotage.start(copter.go_to, FAR, wait=True)
    newer = pilotage.start(copter.go_to, NedTarget(0.0, 30.0, -20.0), wait=True)
    with pytest.raises(Superseded):
        pilotage.result(older)
    assert pilotage.result(newer) == "done"
    assert flying.at == pytest.approx([0.0, 30.0, -20.0], abs=1.0)


def test_two_vehicles_are_flown_by_themselves(loop: Any, make_drone: Any, registry: Any) -> None:
    from mavproxy_uavapi.core.vehicle.jobs import JobBook

    drones = [make_drone(1), make_drone(2)]
    for drone in drones:
        drone.fly()
    loop.settle()
    book = JobBook()

    async def both() -> None:
        jobs = []
        for system, target in ((1, NedTarget(30.0, 0.0, -20.0)), (2, NedTarget(0.0, 30.0, -20.0))):
            copter = registry.find(system)

            async def body(job: Any, copter: Any = copter, target: Any = target) -> str:
                await copter.go_to(job, target, wait=True)
                return "done"

            jobs.append(book.begin(copter, "/go", {"to": system}, body))
        for job in jobs:
            assert await job.outcome() == "done"

    loop.run(both())
    assert drones[0].at == pytest.approx([30.0, 0.0, -20.0], abs=1.0)
    assert drones[1].at == pytest.approx([0.0, 30.0, -20.0], abs=1.0)
    assert len(drones[0].setpoints()) == len(drones[1].setpoints()) == 1
