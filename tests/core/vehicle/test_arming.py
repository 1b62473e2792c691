from __future__ import annotations

import asyncio
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Busy, LinkLost, ModeChanged, Rejected, TimedOut
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
MODE = mavlink.MAV_CMD_DO_SET_MODE
PREARM = mavlink.MAV_CMD_RUN_PREARM_CHECKS
FAILED = mavlink.MAV_RESULT_FAILED


def numbers(drone: Drone) -> list[int]:
    return [message.command for message in drone.orders()]


# -- arm --------------------------------------------------------------------------------------------------


def test_arm_switches_to_guided_then_arms(drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.arm)
    assert numbers(drone) == [MODE, ARM]
    assert (drone.mode, drone.armed) == ("GUIDED", True)
    assert copter.state.armed is True


def test_arm_in_guided_only_arms(loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    drone.pilot("GUIDED")
    loop.settle()
    pilotage.do(copter.arm)
    assert numbers(drone) == [ARM]


def test_arm_waits_until_the_vehicle_is_ready(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.ready = False
    loop.pass_time(1.0)
    job = pilotage.start(copter.arm)
    loop.pass_time(10.0)
    assert drone.orders() == []
    drone.ready = True
    pilotage.result(job)
    assert numbers(drone) == [MODE, ARM]


def test_arm_of_what_does_not_get_ready_is_rejected_with_its_reasons(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.ready = False
    drone.says[PREARM] = ["PreArm: compass not healthy"]
    loop.pass_time(1.0)
    started = loop.time()
    job = pilotage.start(copter.arm, timeout=10.0)
    loop.call_later(8.3, drone.say, "PreArm: GPS: no fix")
    loop.call_later(8.5, drone.say, "PreArm: battery low")
    with pytest.raises(
        Rejected, match=r"not ready to arm after 8 s: PreArm: compass not healthy; PreArm: GPS: n"
    ) as e:
        pilotage.result(job)
    assert e.value.statustext == ["PreArm: compass not healthy", "PreArm: GPS: no fix", "PreArm: battery low"]
    assert loop.time() - started < 13.0
    assert numbers(drone) == [PREARM]


def test_arm_reports_the_autopilots_texts_when_it_refuses(drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    drone.answers[ARM] = [FAILED]
    drone.says[ARM] = ["Arm: throttle too high"]
    with pytest.raises(Rejected) as caught:
        pilotage.do(copter.arm)
    assert (caught.value.ack, caught.value.statustext) == ("MAV_RESULT_FAILED", ["Arm: throttle too high"])


def test_arm_without_guided_is_rejected_and_does_not_arm(drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    drone.answers[MODE] = [FAILED]
    with pytest.raises(Rejected, match="refused DO_SET_MODE"):
        pilotage.do(copter.arm)
    assert numbers(drone) == [MODE]


def test_arm_of_an_armed_vehicle_in_guided_sends_nothing(flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.arm)
    assert flying.orders() == []


def test_arm_of_a_vehicle_that_its_pilot_flies_sends_nothing(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.fly("LOITER")
    loop.settle()
    with pytest.raises(ModeChanged, match="flying in LOITER"):
        pilotage.do(copter.arm)
    loop.pass_time(10.0)
    assert drone.orders() == []


def test_arm_without_an_ack_is_done_when_a_heartbeat_shows_it(
    drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.answers[ARM] = [mavlink.MAV_RESULT_ACCEPTED]  # says yes, does not do it
    with pytest.raises(TimedOut, match="did not show that it is armed"):
        pilotage.do(copter.arm)


def test_pilot_mode_change_ends_the_wait_for_readiness_and_sends_nothing(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.ready = False
    loop.pass_time(1.0)
    job = pilotage.start(copter.arm)
    loop.pass_time(3.0)
    drone.pilot("LOITER")
    started = loop.time()
    with pytest.raises(ModeChanged):
        pilotage.result(job)
    assert job.ended_at - started < 0.1
    drone.ready = True
    loop.pass_time(20.0)
    assert drone.orders() == []


def test_pilot_who_leaves_guided_is_not_armed_under_his_hands(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.answers[ARM] = [None]
    job = pilotage.start(copter.arm)
    loop.pass_time(0.5)
    assert numbers(drone) == [MODE, ARM]
    drone.pilot("STABILIZE")
    with pytest.raises(ModeChanged):
        pilotage.result(job)
    loop.pass_time(10.0)
    assert numbers(drone) == [MODE, ARM]


@pytest.mark.parametrize("armed", [True, False])
def test_vehicle_switched_by_its_pilot_is_not_armed_by_a_longer_job(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage, armed: bool
) -> None:
    async def body(job: Any) -> None:
        await asyncio.sleep(1.0)
        await copter.arm(job)

    drone.pilot("GUIDED")
    drone.armed = armed
    loop.pass_time(0.6)
    job = pilotage.start(body)
    loop.pass_time(0.5)
    drone.pilot("STABILIZE")
    with pytest.raises(ModeChanged):
        pilotage.result(job)
    assert drone.orders() == []


def test_link_loss_ends_arming(loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    drone.answers[ARM] = [None]
    job = pilotage.start(copter.arm)
    loop.pass_time(0.2)
    drone.power_off()
    with pytest.raises(LinkLost):
        pilotage.result(job)


# -- disarm -----------------------------------------------------------------------------------------------


def test_disarm_on_the_ground(loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    drone.armed = True
    loop.pass_time(0.5)
    pilotage.do(copter.disarm)
    assert [(message.command, message.param1, message.param2) for message in drone.orders()] == [(ARM, 0, 0)]
    assert copter.state.armed is False


def test_disarm_is_sent_to_a_disarmed_vehicle_too(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.armed = True  # by its pilot, since its last heartbeat
    pilotage.do(copter.disarm)
    assert not drone.armed


def test_disarm_in_the_air_is_refused_and_sends_nothing(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    with pytest.raises(Busy, match="flying; land it first"):
        pilotage.do(copter.disarm)
    loop.pass_time(5.0)
    assert flying.orders() == []


def test_forced_disarm_in_the_air_carries_the_magic_number(
    flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.do(copter.disarm, force=True)
    assert [(message.param1, message.param2) for message in flying.orders()] == [(0, 21196)]
