from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.errors import (
    Invalid,
    ModeChanged,
    NotArmed,
    NotFound,
    NotSupported,
    Rejected,
    Stale,
    TimedOut,
)
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
MODE = mavlink.MAV_CMD_DO_SET_MODE
SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
DENIED, FAILED = mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_FAILED

# -- modes and speeds -------------------------------------------------------------------------------------


def test_set_mode_is_done_when_a_heartbeat_shows_it(drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.set_mode, "loiter")
    assert drone.mode == "LOITER"
    assert copter.mode == "LOITER"


def test_set_mode_that_no_heartbeat_shows_is_a_timeout(drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    drone.answers[MODE] = [mavlink.MAV_RESULT_ACCEPTED]
    with pytest.raises(TimedOut, match="did not show mode LOITER"):
        pilotage.do(copter.set_mode, "LOITER")


def test_unknown_mode_is_invalid_and_takes_no_command(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    busy = pilotage.start(copter.land)
    loop.pass_time(1.0)
    with pytest.raises(Invalid):
        pilotage.do(copter.set_mode, "HOVERING")
    assert busy.running
    assert len(flying.commands(MODE)) == 1


def test_mode_request_is_not_repeated_once_the_pilot_has_switched(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.answers[MODE] = [None]
    job = pilotage.start(copter.set_mode, "BRAKE")
    loop.pass_time(0.5)
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged):
        pilotage.result(job)
    loop.pass_time(10.0)
    assert len(flying.commands(MODE)) == 1
    assert flying.mode == "LOITER"


def test_mode_request_without_an_ack_is_done_when_a_heartbeat_shows_it(
    flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.deaf.add(MODE)
    pilotage.do(copter.set_mode, "BRAKE")
    assert copter.mode == "BRAKE"


def test_mode_that_somebody_elses_switch_came_before_is_not_on_its_way(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.set_mode, "GUIDED")
    flying.answers[MODE] = [None]
    pilotage.start(copter.land)
    assert copter.next_mode == "LAND"
    for mode in ("LOITER", "GUIDED"):
        loop.pass_time(0.3)
        flying.pilot(mode)
    loop.settle()
    assert copter.next_mode == "GUIDED"


def test_mode_that_was_accepted_and_does_not_show_is_not_sent_again(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.answers[MODE] = [(0,), (0,), None]  # as if the pilot had switched back before a heartbeat
    job = pilotage.start(copter.land)
    loop.pass_time(30.0)
    assert len(flying.commands(MODE)) == 1 and isinstance(job.error, TimedOut)


def test_mode_whose_ack_may_be_an_earlier_ones_is_sent_again(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.answers[MODE] = [None, (0,), (0,)]  # that of `rtl` comes when `land` has been sent, and was lost
    pilotage.start(copter.rtl)
    loop.pass_time(0.5)
    job = pilotage.start(copter.land)
    loop.pass_time(4.0)
    assert len(flying.commands(MODE)) > 2 and job.running
    del flying.answers[MODE]
    loop.pass_time(5.0)
    assert flying.mode == "LAND"


@pytest.mark.parametrize(("kind", "number"), [("air", 0), ("ground", 1), ("climb", 2), ("descent", 3)])
def test_speed_is_set_by_its_type(flying: Drone, copter: Vehicle, kind: str, number: int, pilotage: Pilotage) -> None:
    pilotage.do(copter.set_speed, kind, 3.5)
    command = flying.commands(SPEED)[0]
    assert (command.param1, command.param2, command.param3) == (number, 3.5, -1)
    assert copter.speeds.in_force == {kind: 3.5}


def test_speed_that_is_requested_before_guided_is_sent_once_it_flies(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.set_speed, "ground", 3.5)
    assert drone.commands(SPEED) == [] and copter.speeds.in_force == {}
    drone.fly()
    loop.settle()
    pilotage.do(copter.go_to, NedTarget(10.0, 0.0, -20.0))
    assert [(m.param1, m.param2) for m in drone.commands(SPEED)] == [(1, 3.5)]
    pilotage.do(copter.go_to, NedTarget(20.0, 0.0, -20.0))
    assert len(drone.commands(SPEED)) == 1
    assert copter.speeds.in_force == {"ground": 3.5}


def test_speed_that_a_pilots_mode_refuses_is_remembered(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    flying.answers[SPEED] = [None]
    job = pilotage.start(copter.set_speed, "ground", 3.5)
    loop.pass_time(0.5)
    flying.pilot("LOITER")
    assert pilotage.result(job) == "done"
    assert len(flying.commands(SPEED)) == 1


def test_remembered_speed_is_forgotten_by_a_reboot(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.set_speed, "ground", 3.5)
    copter.state.reboots += 1
    assert copter.speeds.to_send(new_kind=True) == {}


def test_refused_speed_is_not_remembered(flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    flying.answers[SPEED] = [DENIED]
    with pytest.raises(Rejected):
        pilotage.do(copter.set_speed, "ground", 3.5)
    assert copter.speeds.to_send(new_kind=True) == {}


# -- home, servo, parameters ------------------------------------------------------------------------------


def test_set_home_is_retried_until_the_estimator_settles_then_read_back(
    drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.answers[mavlink.MAV_CMD_DO_SET_HOME] = [FAILED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED, 0]
    pilotage.do(copter.set_home)
    assert [command.param1 for command in drone.commands(mavlink.MAV_CMD_DO_SET_HOME)] == [1, 1, 1]
    assert copter.state.messages["HOME_POSITION"].message.altitude == 584000


def test_home_is_requested(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    assert loop.run(copter.home()).lat == -35.0


def test_home_that_is_not_set_is_not_found(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.answers[mavlink.MAV_CMD_REQUEST_MESSAGE] = [FAILED]
    with pytest.raises(NotFound, match="no home position yet"):
        loop.run(copter.home())


def test_home_that_does_not_come_is_a_timeout(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.answers[mavlink.MAV_CMD_REQUEST_MESSAGE] = [mavlink.MAV_RESULT_ACCEPTED]
    with pytest.raises(TimedOut, match="did not report HOME_POSITION"):
        loop.run(copter.home())


def test_servo(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    loop.run(copter.set_servo(9, 1700))
    assert [(c.command, c.param1, c.param2) for c in drone.commands()] == [(mavlink.MAV_CMD_DO_SET_SERVO, 9, 1700)]


def test_sim_speedup_is_set_and_read_back(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    loop.run(copter.set_sim_speedup(5))
    assert drone.parameters["SIM_SPEEDUP"] == 5
    assert copter.state.parameters["SIM_SPEEDUP"] == 5


def test_sim_speedup_that_is_not_taken_is_a_timeout(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    loop.run(copter.parameters.read([("SIM_SPEEDUP",)]))
    del drone.parameters["SIM_SPEEDUP"]
    with pytest.raises(TimedOut, match="did not take SIM_SPEEDUP = 5"):
        loop.run(copter.set_sim_speedup(5))


def test_sim_speedup_of_a_real_vehicle_is_not_supported(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    del drone.parameters["SIM_SPEEDUP"]
    with pytest.raises(NotSupported, match="not a simulation"):
        loop.run(copter.set_sim_speedup(5))
    assert [message.get_type() for message in drone.received] == ["PARAM_REQUEST_READ"]


def test_parameters_are_requested_once_and_missing_ones_left_out(
    loop: FastLoop, drone: Drone, copter: Vehicle
) -> None:
    assert loop.run(copter.parameters.read([("RTL_ALT",), ("NO_SUCH",)])) == {"RTL_ALT": 1500.0}
    drone.received.clear()
    assert loop.run(copter.parameters.read([("RTL_ALT",)])) == {"RTL_ALT": 1500.0}
    assert drone.received == []


def test_one_of_a_quantitys_names_is_enough(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    started = loop.time()
    assert loop.run(copter.parameters.read([("RTL_ALT", "RTL_ALT_M")])) == {"RTL_ALT": 1500.0}
    assert loop.time() - started < 0.1


def test_limits_are_the_vehicles_own(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.parameters["WPNAV_SPEED"] = 300.0
    assert loop.run(copter.limits()).horizontal == 3.0


def test_deadline_is_the_clients_or_what_the_flight_needs(copter: Vehicle) -> None:
    assert copter.allowed(100.0, 7.0) == 7.0
    assert copter.allowed(100.0, None) == 230.0


# -- what it is -------------------------------------------------------------------------------------------


def test_position_is_good_when_the_estimator_says_so(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    assert copter.has_position
    drone.mute.add("EKF_STATUS_REPORT")
    good = mavlink.EKF_POS_HORIZ_ABS
    for flags, expected in ((good | mavlink.EKF_CONST_POS_MODE, False), (0, False), (good, True)):
        drone.send("ekf_status_report", flags=flags)
        loop.settle()
        assert copter.has_position is expected


def test_without_an_estimator_report_the_prearm_bit_counts(copter: Vehicle) -> None:
    del copter.state.messages["EKF_STATUS_REPORT"]
    assert copter.has_position
    copter.state.messages["SYS_STATUS"].message.onboard_control_sensors_health = 0
    assert not copter.has_position


def test_autopilot_that_does_not_report_prearm_checks_may_try(copter: Vehicle) -> None:
    reported = copter.state.messages["SYS_STATUS"].message
    reported.onboard_control_sensors_present = reported.onboard_control_sensors_health = 0
    assert copter.is_ready_to_arm
    del copter.state.messages["SYS_STATUS"]
    assert not copter.is_ready_to_arm


def test_distance_home_needs_both_places(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.at = [30.0, 40.0, 0.0]
    loop.pass_time(0.5)
    assert copter.distance_home() is None
    loop.run(copter.home())
    assert copter.distance_home() == pytest.approx(50.0, abs=0.1)


def test_old_position_is_not_flown_by(loop: FastLoop, drone: Drone, copter: Vehicle) -> None:
    drone.mute.add("LOCAL_POSITION_NED")
    loop.pass_time(3.5)
    with pytest.raises(Stale, match=r"LOCAL_POSITION_NED: 3\.5 s old"):
        copter.fresh("LOCAL_POSITION_NED")
    with pytest.raises(Stale, match="never received"):
        copter.fresh("HOME_POSITION")


def test_guard_distinguishes_pilot_disarming_and_reboot(copter: Vehicle) -> None:
    state = copter.state
    state.armed = True
    copter.held_by("STABILIZE")
    with pytest.raises(ModeChanged, match="left GUIDED: the pilot or a failsafe switched it to STABILIZE"):
        copter.held_by("GUIDED")
    state.armed = False
    with pytest.raises(NotArmed, match="was disarmed"):
        copter.held_by("STABILIZE")
    state.armed = state.mode = None
    with pytest.raises(NotArmed, match="rebooted"):
        copter.held_by("STABILIZE")


def test_mode_that_was_shown_and_left_at_once_is_somebody_elses_switch(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.fly()
    drone.answers[mavlink.MAV_CMD_DO_SET_MODE] = [None]
    loop.settle()
    job = pilotage.start(copter.set_mode, "LOITER")
    drone.pilot("LOITER")
    drone.pilot("GUIDED")  # in the same batch of messages
    loop.settle()
    assert isinstance(job.error, ModeChanged)


@pytest.mark.parametrize(
    ("verb", "args", "rank"),
    [
        ("set_mode", ("BRAKE",), Rank.STOP),
        ("set_mode", ("LAND",), Rank.STOP),
        ("set_mode", ("AUTO",), Rank.ARM),
        ("disarm", (True,), Rank.FORCE),
    ],
)
def test_verb_commands_by_its_rank(
    flying: Drone, copter: Vehicle, pilotage: Pilotage, verb: str, args: Any, rank: Rank
) -> None:
    pilotage.start(getattr(copter, verb), *args)
    assert copter.authority.rank is rank


def test_arming_comes_before_a_movement(drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.start(copter.arm)
    assert copter.authority.rank is Rank.ARM
