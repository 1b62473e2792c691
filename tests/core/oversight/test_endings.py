from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.airspace.ordered import Ordered
from mavproxy_uavapi.core.control.jobs import Ending
from mavproxy_uavapi.core.errors import (
    Aborted,
    Busy,
    LinkLost,
    ModeChanged,
    NotArmed,
    Paused,
    Rejected,
    Superseded,
    TimedOut,
    UavApiError,
)
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.core.oversight.endings import WHAT_FOLLOWS, Policy, Situation, situation
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink
ON_GROUND = mavlink.MAV_LANDED_STATE_ON_GROUND
TAKING_OFF = mavlink.MAV_LANDED_STATE_TAKEOFF


def on_ground(drone: Drone, mode: str, armed: bool = True) -> None:
    drone.mode, drone.armed, drone.landed, drone.at = mode, armed, ON_GROUND, [0.0, 0.0, 0.0]
    drone.tell_all()


def climbs(drone: Drone) -> None:
    on_ground(drone, "GUIDED")
    drone.landed, drone.at[2] = TAKING_OFF, -0.1
    drone.tell_all()


# How telemetry comes to show it.
SHOWN: dict[str, tuple[Situation, Callable[[Any], None]]] = {
    "rebooted": (Situation.UNKNOWN, lambda drone: (drone.fly(), drone.reboot(), drone.tell("ATTITUDE"))),
    "disarmed": (Situation.DISARMED, lambda drone: on_ground(drone, "GUIDED", armed=False)),
    "landed in LAND": (Situation.IDLE, lambda drone: on_ground(drone, "LAND")),
    "landed in RTL": (Situation.IDLE, lambda drone: on_ground(drone, "RTL")),
    "landed in SMART_RTL": (Situation.IDLE, lambda drone: on_ground(drone, "SMART_RTL")),
    "flies in GUIDED": (Situation.GUIDED, lambda drone: drone.fly()),
    "stands armed in GUIDED": (Situation.GUIDED, lambda drone: on_ground(drone, "GUIDED")),
    "climbs": (Situation.GUIDED, climbs),
    "AUTO": (Situation.MISSION, lambda drone: drone.fly("AUTO")),
    "AUTO_RTL": (Situation.MISSION, lambda drone: drone.fly("AUTO_RTL")),
    "LAND": (Situation.LAND, lambda drone: drone.fly("LAND")),
    "RTL": (Situation.RTL, lambda drone: drone.fly("RTL")),
    "SMART_RTL": (Situation.RTL, lambda drone: drone.fly("SMART_RTL")),
    "LOITER": (Situation.PILOTED, lambda drone: drone.fly("LOITER")),
    "STABILIZE": (Situation.PILOTED, lambda drone: drone.fly("STABILIZE")),
    "BRAKE": (Situation.PILOTED, lambda drone: drone.fly("BRAKE")),
    "armed by a pilot": (Situation.PILOTED, lambda drone: on_ground(drone, "STABILIZE")),
}

NONE = (None, None, None, None, None)
# In the order of Policy: nothing, hold, safe, land, rtl.
EXPECTED = {
    Situation.UNKNOWN: NONE,
    Situation.DISARMED: NONE,
    Situation.ARMING: (None, "disarm", "disarm", "disarm", "disarm"),
    Situation.IDLE: NONE,
    Situation.GUIDED: (None, "hold", "hold", "land", "rtl"),
    Situation.PAUSED: (None, "hold", "hold", "land", "rtl"),
    Situation.STOPPED: (None, None, None, "land", "rtl"),
    Situation.MISSION: (None, "hold", None, "land", "rtl"),
    Situation.TAKEOFF: (None, "hold", None, "land", "rtl"),
    Situation.LAND: (None, "hold", None, None, None),
    Situation.RTL: (None, "hold", None, "land", None),
    Situation.PILOTED: NONE,
}
MODES = {"land": "LAND", "rtl": "RTL"}
ITS_OWN = ("AUTO", "AUTO_RTL", "LAND", "RTL", "SMART_RTL")  # modes that the job which ended had switched to


def test_table_has_every_situation_and_policy() -> None:
    assert set(WHAT_FOLLOWS) == set(EXPECTED) == set(Situation)
    assert all(list(row) == list(Policy) for row in WHAT_FOLLOWS.values())


@pytest.mark.parametrize("how", SHOWN)
def test_situation_is_what_telemetry_shows(loop: FastLoop, drone: Drone, copter: Vehicle, how: str) -> None:
    expected, show = SHOWN[how]
    show(drone)
    loop.settle()
    assert situation(copter, ITS_OWN) is expected


@pytest.mark.parametrize("mode", ITS_OWN)
def test_landing_return_or_mission_of_somebody_else_is_left_alone(
    loop: FastLoop, host: Host, drone: Drone, copter: Vehicle, mode: str
) -> None:
    drone.fly(mode)
    loop.settle()
    assert situation(copter, {"GUIDED"}) is Situation.PILOTED
    assert not any(host.endings.what_follows(copter, policy, {"GUIDED"}) for policy in Policy)


@pytest.mark.parametrize("how", SHOWN)
@pytest.mark.parametrize("policy", Policy)
def test_every_situation_and_policy(
    loop: FastLoop, host: Host, drone: Drone, copter: Vehicle, policy: Policy, how: str
) -> None:
    now, show = SHOWN[how]
    show(drone)
    loop.settle()
    copter.guard.ordered = Ordered(at=loop.time())  # it is in its mode for us
    action = EXPECTED[now][list(Policy).index(policy)]
    before, requested = len(drone.orders()), loop.now

    async def apply_policy() -> Any:
        return host.endings.apply_policy(copter, policy, "in a test", "10.0.0.7", ITS_OWN)

    closing = loop.run(apply_policy())
    assert (closing is not None) == (action is not None)
    loop.pass_time(4.0)
    sent = drone.orders()[before:]
    if action is None:
        assert sent == []
    elif action in MODES:
        assert copter.mode == MODES[action] or drone.mode == MODES[action]
    elif now is Situation.GUIDED:
        setpoints = [m for m in sent if m.get_type() != "COMMAND_LONG"]  # on the ground they stand in a pause
        assert {(m.vx, m.vy, m.vz) for m in setpoints} == {(0, 0, 0)} and drone.mode == "GUIDED"
        assert not drone.paused
    else:
        assert drone.mode == "BRAKE"
    assert loop.now > requested


@pytest.mark.parametrize("policy", Policy)
def test_vehicle_that_another_station_flies_in_guided_is_left_alone(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, policy: Policy
) -> None:
    async def apply_policy() -> Any:
        return host.endings.apply_policy(copter, policy, "in a test", "10.0.0.7")

    assert loop.run(apply_policy()) is None
    loop.pass_time(3.0)
    assert flying.orders() == []


@pytest.mark.parametrize(("policy", "mode"), [(Policy.HOLD, "AUTO"), (Policy.LAND, "GUIDED"), (Policy.RTL, "AUTO")])
def test_vehicle_taken_by_its_pilot_since_the_heartbeat_is_left_alone(
    loop: FastLoop, host: Host, drone: Drone, copter: Vehicle, policy: Policy, mode: str
) -> None:
    drone.fly(mode)
    loop.settle()
    copter.guard.ordered = Ordered(at=loop.time())

    async def apply_policy() -> Any:
        return host.endings.apply_policy(copter, policy, "in a test", "10.0.0.7", ITS_OWN)

    drone.mode = "LOITER"  # no heartbeat has told so yet
    closing = loop.run(apply_policy())
    loop.pass_time(3.0)
    assert isinstance(closing.error, ModeChanged) and drone.orders() == [] and drone.mode == "LOITER"


@pytest.mark.parametrize("policy", Policy)
def test_vehicle_that_stop_holds_stays_unless_it_is_to_come_down(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage, policy: Policy
) -> None:
    pilotage.do(copter.stop)
    assert situation(copter) is Situation.PAUSED
    assert host.endings.what_follows(copter, policy) == EXPECTED[Situation.PAUSED][list(Policy).index(policy)]


def end(loop: FastLoop, job: Any, ending: Ending = Ending.ABORTED) -> None:
    """End a job from outside."""

    async def abort() -> None:
        job.abort(Aborted("it ended"), ending)

    loop.run(abort())


@pytest.fixture
def ended(loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage) -> Callable[..., Any]:
    """A flight that has ended so."""

    def end(ending: Ending, error: UavApiError | None = None, steers: bool = False) -> Any:
        job = pilotage.start(copter.go_to, NedTarget(200.0, 0.0, -20.0), wait=True)
        loop.pass_time(1.0)
        job.steers = steers

        async def abort() -> None:
            job.abort(error or Aborted("it ended"), ending)

        loop.run(abort())
        return job

    return end


POLICIES = {
    Ending.DONE: Policy.NOTHING,
    Ending.FAILED: Policy.NOTHING,
    Ending.SUPERSEDED: Policy.NOTHING,
    Ending.ABORTED: Policy.HOLD,
    Ending.CLIENT_GONE: Policy.LAND,  # as it is set here
    Ending.SCRIPT_GONE: Policy.RTL,
    Ending.LEASE_OVER: Policy.HOLD,
    Ending.UNLOADED: Policy.SAFE,
    Ending.DEFECT: Policy.SAFE,
}


@pytest.mark.parametrize("ending", Ending)
def test_policy_of_every_ending(host: Host, ended: Callable[..., Any], ending: Ending) -> None:
    host.endings.on_disconnect, host.endings.on_script_exit = Policy.LAND, Policy.RTL
    job = ended(ending)
    assert host.endings.policy(job) is POLICIES[ending]
    assert (host.endings.closing(job) is None) == (POLICIES[ending] is Policy.NOTHING)


def test_nothing_follows_what_followed_though_it_fails_by_a_defect(
    loop: FastLoop, host: Host, ended: Callable[..., Any], copter: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def defective(_job: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(copter, "hold", defective)
    closing = host.endings.closing(ended(Ending.ABORTED))
    loop.settle()
    assert closing.ending is Ending.DEFECT and host.endings.closing(closing) is None
    assert len(host.jobs.all()) == 2 and isinstance(closing._task.exception(), ZeroDivisionError)


@pytest.mark.parametrize("error", [TimedOut("late"), Rejected("refused")])
def test_vehicle_that_is_flown_by_what_is_sent_does_not_go_on_without_it(
    host: Host, ended: Callable[..., Any], error: Any
) -> None:
    assert host.endings.policy(ended(Ending.FAILED, error, steers=True)) is Policy.SAFE


@pytest.mark.parametrize("error", [ModeChanged("his"), NotArmed("off"), Paused("still"), LinkLost("silent")])
def test_vehicle_that_has_another_master_is_left_to_him(host: Host, ended: Callable[..., Any], error: Any) -> None:
    job = ended(Ending.FAILED, error, steers=True)
    assert host.endings.policy(job) is Policy.NOTHING and host.endings.closing(job) is None


def test_superseded_flight_sends_nothing_for_its_vehicle(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    first = pilotage.start(copter.go_to, NedTarget(200.0, 0.0, -20.0), wait=True)
    pilotage.start(copter.go_to, NedTarget(0.0, 200.0, -20.0), wait=True)
    assert isinstance(first.error, Superseded) and host.endings.closing(first) is None
    loop.pass_time(2.0)
    assert [(m.x, m.y) for m in flying.setpoints()] == [(200.0, 0.0), (0.0, 200.0)]


def test_companion_that_ends_leaves_the_movement_alone(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    moving = pilotage.start(copter.go_to, NedTarget(200.0, 0.0, -20.0), wait=True)
    flying.mute = {"ATTITUDE"}
    turning = pilotage.start(copter.set_heading, 180.0)

    async def abort() -> None:
        turning.abort(Aborted("it ended"))

    loop.run(abort())
    loop.pass_time(2.0)
    assert host.endings.closing(turning) is None and moving.running and len(flying.setpoints()) == 1


def test_hold_ends_when_somebody_else_flies(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    job = pilotage.start(copter.go_to, NedTarget(200.0, 0.0, -20.0), wait=True)

    async def abort() -> None:
        job.abort(Aborted("it ended"))

    loop.run(abort())
    loop.settle()
    closing = host.endings.closing(job)
    too_early = pilotage.start(copter.go_to, NedTarget(0.0, 50.0, -20.0), wait=True)
    assert closing.running and isinstance(too_early.error, Busy)  # it has not come to rest yet
    newer = pilotage.start(copter.land)
    assert not closing.running and newer.running
    loop.pass_time(2.0)
    assert flying.mode == "LAND"


def test_closing_messages_are_those_that_an_ending_has_not_sent_yet(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, ended: Callable[..., Any]
) -> None:
    assert host.endings.closing_messages() == []
    ended(Ending.ABORTED)
    ((message, system),) = host.endings.closing_messages()
    assert (message.get_type(), system) == ("SET_POSITION_TARGET_LOCAL_NED", 1)
    assert (message.vx, message.vy, message.vz) == (0, 0, 0)


def test_closing_message_for_a_mission_is_brake(
    loop: FastLoop, host: Host, drone: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    drone.fly("GUIDED")
    loop.settle()
    job = pilotage.start(copter.set_mode, "AUTO")
    drone.answers[mavlink.MAV_CMD_DO_SET_MODE] = [None]
    end(loop, job)
    ((message, _),) = host.endings.closing_messages()
    assert (message.command, message.param2) == (mavlink.MAV_CMD_DO_SET_MODE, 17)


@pytest.mark.parametrize("mode", ["LAND", "RTL", "AUTO"])
def test_deleted_switch_that_was_on_its_way_is_followed_by_brake(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage, mode: str
) -> None:
    job = pilotage.start(copter.set_mode, mode)
    assert flying.mode == "GUIDED" and len(flying.commands(mavlink.MAV_CMD_DO_SET_MODE)) == 1
    end(loop, job)
    loop.pass_time(5.0)
    assert flying.mode == "BRAKE" and host.endings.closing(job).error is None


def test_deleted_brake_that_is_lost_on_its_way_is_followed_by_brake(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.start(copter.go_to, NedTarget(200.0, 0.0, -20.0), wait=True)
    loop.pass_time(1.0)
    flying.answers[mavlink.MAV_CMD_DO_SET_MODE] = [None]
    braking = pilotage.start(copter.brake)
    loop.pass_time(0.1)
    flying.answers.clear()
    end(loop, braking)
    loop.pass_time(5.0)
    assert flying.mode == "BRAKE"


def test_pilot_who_switches_while_a_deleted_flight_stops_has_it(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    job = pilotage.start(copter.go_to, NedTarget(200.0, 0.0, -20.0), wait=True)
    end(loop, job)
    flying.pilot("RTL")
    loop.pass_time(5.0)
    assert flying.mode == "RTL" and isinstance(host.endings.closing(job).error, ModeChanged)


def test_landing_on_its_way_goes_on_when_the_module_is_unloaded(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    end(loop, pilotage.start(copter.set_mode, "LAND"), Ending.UNLOADED)
    loop.pass_time(5.0)
    assert flying.mode == "LAND"


def test_deleted_switch_is_followed_by_brake_behind_an_older_one(
    loop: FastLoop, host: Host, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    pilotage.start(copter.land)
    loop.pass_time(0.005)
    job = pilotage.start(copter.set_mode, "RTL")
    loop.pass_time(0.005)
    end(loop, job)
    loop.pass_time(5.0)
    assert flying.mode == "BRAKE"
