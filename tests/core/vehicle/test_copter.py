from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Busy, ModeChanged, NotArmed, Paused, Rejected, Superseded, TimedOut
from mavproxy_uavapi.core.link.messages import NedTarget, VelocityTarget
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.piloting import FAR, nothing_more
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
TAKEOFF, MODE = mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_DO_SET_MODE
PAUSE = mavlink.MAV_CMD_DO_PAUSE_CONTINUE


def numbers(drone: Drone) -> list[int]:
    return [message.command for message in drone.commands() if message in drone.orders()]


# -- takeoff ----------------------------------------------------------------------------------------------


def test_takeoff_is_done_at_its_altitude(loop: FastLoop, armed: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.takeoff, 12.5)
    assert [(m.command, m.param7) for m in armed.orders()] == [(TAKEOFF, 12.5)]
    assert copter.height == pytest.approx(12.5, abs=0.65)


@pytest.mark.parametrize(("alt", "short"), [(2.0, 0.35), (10.0, 0.6), (100.0, 1.1)])
def test_takeoff_that_stays_below_is_a_timeout(
    armed: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage, alt: float, short: float
) -> None:
    armed.answers[TAKEOFF] = [mavlink.MAV_RESULT_ACCEPTED]
    armed.target, armed.lifting = [0.0, 0.0, -(alt - short)], True
    with pytest.raises(TimedOut, match=f"did not reach {alt:g} m"):
        pilotage.do(copter.takeoff, alt)


@pytest.mark.parametrize(("alt", "short"), [(2.0, 0.25), (10.0, 0.45), (100.0, 0.95)])
def test_takeoff_tolerance_is_a_share_of_the_altitude(
    armed: Drone, copter: Vehicle, pilotage: Pilotage, alt: float, short: float
) -> None:
    armed.answers[TAKEOFF] = [mavlink.MAV_RESULT_ACCEPTED]
    armed.target, armed.lifting = [0.0, 0.0, -(alt - short)], True
    pilotage.do(copter.takeoff, alt)


def test_takeoff_is_not_done_while_it_shoots_past(
    loop: FastLoop, armed: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    armed.answers[TAKEOFF] = [mavlink.MAV_RESULT_ACCEPTED]
    armed.target, armed.lifting = [0.0, 0.0, -60.0], True
    job = pilotage.start(copter.takeoff, 10.0)
    loop.pass_time(20.0)
    assert copter.height > 40
    assert job.running


def test_takeoff_of_a_disarmed_vehicle_sends_nothing(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.pilot("GUIDED")
    loop.settle()
    with pytest.raises(NotArmed):
        pilotage.do(copter.takeoff, 10.0)
    nothing_more(loop, drone)


def test_takeoff_in_another_mode_sends_nothing(
    loop: FastLoop, armed: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    armed.pilot("STABILIZE")
    loop.settle()
    with pytest.raises(ModeChanged, match="`guided`"):
        pilotage.do(copter.takeoff, 10.0)
    nothing_more(loop, armed)


def test_takeoff_in_flight_is_busy_and_supersedes_nothing(
    flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage
) -> None:
    going = pilotage.start(copter.go_to, FAR, wait=True)
    with pytest.raises(Busy, match="flying already"):
        pilotage.do(copter.takeoff, 10.0)
    assert going.running
    assert flying.commands(TAKEOFF) == []


def test_takeoff_whose_ack_is_lost_is_known_by_its_lifting_off(
    armed: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    armed.deaf.add(TAKEOFF)
    pilotage.do(copter.takeoff, 30.0)
    assert len(armed.commands(TAKEOFF)) == 1
    assert copter.height == pytest.approx(30.0, abs=1.0)


def test_takeoff_without_ack_and_lift_off_is_a_timeout(
    loop: FastLoop, armed: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    armed.answers[TAKEOFF] = [None]
    started = loop.time()
    with pytest.raises(TimedOut, match="acknowledge the takeoff, and did not leave the ground"):
        pilotage.do(copter.takeoff, 30.0)
    assert loop.time() - started < 10.0
    assert len(armed.commands(TAKEOFF)) == 1


def test_refused_takeoff_is_rejected_with_the_reason(armed: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    armed.answers[TAKEOFF] = [mavlink.MAV_RESULT_FAILED]
    armed.says[TAKEOFF] = ["Takeoff: no"]
    with pytest.raises(Rejected) as caught:
        pilotage.do(copter.takeoff, 10.0)
    assert caught.value.statustext == ["Takeoff: no"]


@pytest.mark.parametrize("verb", ["takeoff", "land", "rtl", "go_to", "travel"])
def test_command_goes_out_before_any_parameter_is_requested(
    loop: FastLoop, armed: Drone, copter: Vehicle, pilotage: Pilotage, verb: str
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
    first = armed.received[0]
    assert first.get_type().startswith(("COMMAND_LONG", "SET_POSITION_TARGET"))
    assert loop.time() == began


def test_takeoff_that_is_reported_for_ever_ends_and_movements_begin(
    loop: FastLoop, armed: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    job = pilotage.start(copter.takeoff, 10.0)
    loop.pass_time(3.0)
    armed.lifting, armed.landed = False, mavlink.MAV_LANDED_STATE_TAKEOFF
    assert pilotage.result(job) == "done"
    assert copter.is_taking_off
    pilotage.do(copter.go_to, FAR)
    armed.landed = mavlink.MAV_LANDED_STATE_TAKEOFF
    pilotage.do(copter.travel, VelocityTarget(1.0, 0.0, 0.0))


def test_takeoff_takes_as_long_as_its_height_needs(
    loop: FastLoop, armed: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    started = loop.time()
    pilotage.do(copter.takeoff, 300.0)
    assert loop.time() - started > 110.0


# -- land and return --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("verb", "mode"), [("land", "LAND"), ("rtl", "RTL")])
def test_land_and_rtl_are_done_when_it_has_disarmed(
    flying: Drone, copter: Vehicle, pilotage: Pilotage, verb: str, mode: str
) -> None:
    flying.at = [50.0, 20.0, -20.0]
    pilotage.do(getattr(copter, verb))
    assert [(m.command, int(m.param2)) for m in flying.orders()] == [(MODE, {"LAND": 9, "RTL": 6}[mode])]
    assert not flying.armed
    assert copter.state.armed is False
    assert math.hypot(*flying.at[:2]) == pytest.approx(0.0 if mode == "RTL" else math.hypot(50, 20), abs=0.1)


@pytest.mark.parametrize("verb", ["land", "rtl"])
def test_land_and_rtl_on_the_ground_send_nothing(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage, verb: str
) -> None:
    loop.run(copter.home())
    pilotage.do(getattr(copter, verb))
    nothing_more(loop, drone)


@pytest.mark.parametrize("verb", ["land", "rtl"])
def test_vehicle_armed_since_its_heartbeat_is_neither_landed_nor_commanded(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage, verb: str
) -> None:
    loop.run(copter.home())
    drone.armed = True
    with pytest.raises(ModeChanged, match="has armed the vehicle"):
        pilotage.do(getattr(copter, verb))
    nothing_more(loop, drone)


def test_rtl_on_the_ground_away_from_home_is_not_armed(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.at = [50.0, 0.0, 0.0]
    loop.run(copter.home())
    loop.pass_time(0.5)
    with pytest.raises(NotArmed, match="disarmed, 50 m from home"):
        pilotage.do(copter.rtl)
    nothing_more(loop, drone)


def test_rtl_is_not_done_if_it_is_armed_while_home_is_requested(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.answers[mavlink.MAV_CMD_REQUEST_MESSAGE] = [None]
    job = pilotage.start(copter.rtl)
    drone.fly("STABILIZE")
    loop.settle()
    drone.answers.clear()
    loop.pass_time(10.0)
    assert isinstance(job.error, ModeChanged) and drone.mode == "STABILIZE"


def test_rtl_on_the_ground_away_from_an_unreported_home_is_not_done(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.at = [50.0, 0.0, 0.0]
    loop.pass_time(0.5)
    with pytest.raises(NotArmed):
        pilotage.do(copter.rtl)


@pytest.mark.parametrize("verb", ["land", "rtl"])
def test_landing_that_never_ends_is_a_timeout(flying: Drone, copter: Vehicle, pilotage: Pilotage, verb: str) -> None:
    flying.stuck = True
    with pytest.raises(TimedOut, match=f"did not land and disarm in {verb.upper()}"):
        pilotage.do(getattr(copter, verb))


def test_reboot_while_landing_is_not_a_landing(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.stuck = True
    job = pilotage.start(copter.land)
    loop.pass_time(2.0)
    flying.power_off()
    flying.send("attitude", time_boot_ms=300)
    flying.send("global_position_int", relative_alt=20_000)
    with pytest.raises(NotArmed, match="rebooted"):
        pilotage.result(job)


def test_landing_reports_its_height(loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    loop.run(copter.home())
    job = pilotage.start(copter.land)
    loop.pass_time(4.0)
    assert 10 < job.progress["altitude"] < 18
    assert job.progress["distance_to_go"] == pytest.approx(0.0, abs=0.1)


# -- stop and resume --------------------------------------------------------------------------------------


@pytest.mark.parametrize("verb", ["set_heading", "stop", "resume"])
def test_guided_only_verbs_leave_the_pilot_alone(
    loop: FastLoop, flying: Drone, copter: Vehicle, verb: str, pilotage: Pilotage
) -> None:
    flying.pilot("LOITER")
    loop.settle()
    with pytest.raises(ModeChanged):
        pilotage.do(getattr(copter, verb), *([90.0] if verb == "set_heading" else []))
    nothing_more(loop, flying)


def test_stop_and_resume_leave_the_waiting_flight_waiting(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
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
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage, verb: str
) -> None:
    pilotage.do(copter.stop)
    flying.received.clear()
    arguments = {"go_to": FAR, "travel": VelocityTarget(1.0, 0.0, 0.0), "set_heading": 90.0, "set_yaw_rate": 10.0}
    with pytest.raises(Paused, match="`resume`"):
        pilotage.do(getattr(copter, verb), arguments[verb])
    nothing_more(loop, flying)


def test_movement_that_streams_ends_when_the_vehicle_is_stopped(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    job = pilotage.start(copter.travel, VelocityTarget(1.0, 0.0, 0.0), duration=60.0)
    loop.pass_time(3.0)
    pilotage.do(copter.stop)
    with pytest.raises(Paused):
        pilotage.result(job)
    nothing_more(loop, flying)


def test_stop_is_done_when_it_stands_still(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.go_to, FAR)
    loop.pass_time(2.0)
    flying.answers[PAUSE] = [mavlink.MAV_RESULT_ACCEPTED]  # and flies on
    job = pilotage.start(copter.stop)
    loop.pass_time(5.0)
    assert job.running
    flying.paused = True
    assert pilotage.result(job) == "done"


def test_refused_stop_stops_nothing(loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    flying.answers[PAUSE] = [mavlink.MAV_RESULT_DENIED]
    with pytest.raises(Rejected):
        pilotage.do(copter.stop)
    pilotage.do(copter.go_to, FAR)


def test_guided_ends_a_stop_where_it_is(loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    job = pilotage.start(copter.go_to, FAR, wait=True)
    pilotage.do(copter.stop)
    flying.received.clear()
    pilotage.do(copter.set_mode, "GUIDED")
    with pytest.raises(Superseded):
        pilotage.result(job)
    kinds = [m.get_type() for m in flying.orders()]
    assert kinds == ["COMMAND_LONG", "SET_POSITION_TARGET_LOCAL_NED", "COMMAND_LONG"]
    assert [m.param1 for m in flying.commands(PAUSE)] == [1]
    pilotage.do(copter.go_to, FAR)


def test_takeoff_ends_a_stop(loop: FastLoop, armed: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.stop)
    pilotage.do(copter.takeoff, 5.0)
    assert numbers(armed) == [PAUSE, TAKEOFF, PAUSE]
    pilotage.do(copter.go_to, FAR)


def test_pilots_mode_change_ends_our_stop(loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.stop)
    flying.pilot("LOITER")
    loop.pass_time(1.0)
    flying.pilot("GUIDED")
    loop.pass_time(1.0)
    flying.received.clear()
    pilotage.do(copter.go_to, FAR)
    assert flying.commands(PAUSE) == []


def test_mission_that_cannot_be_paused_is_left_for_brake(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.fly("AUTO")
    loop.settle()
    drone.answers[PAUSE] = [mavlink.MAV_RESULT_FAILED]
    pilotage.do(copter.stop)
    assert drone.mode == "BRAKE"


def test_stop_in_a_pilots_mode_sends_nothing(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.fly("LOITER")
    loop.settle()
    with pytest.raises(ModeChanged, match="`brake`"):
        pilotage.do(copter.stop)
    nothing_more(loop, drone)
