from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Busy, Invalid, ModeChanged, NotArmed, Stale, Superseded, TimedOut
from mavproxy_uavapi.core.link.messages import GlobalTarget, NedTarget, VelocityTarget
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.piloting import FAR, STILL, nothing_more, place
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink


def test_go_to_ned_sends_one_setpoint_and_answers_at_once(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    started = loop.time()
    pilotage.do(copter.go_to, NedTarget(30.0, 40.0, -10.0))
    assert loop.time() == started
    assert [(m.x, m.y, m.z, m.type_mask) for m in flying.setpoints()] == [(30.0, 40.0, -10.0, 0b1101_1111_1000)]
    nothing_more(loop, flying)


def test_go_to_ned_with_wait_is_done_on_arrival(flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.go_to, NedTarget(30.0, 40.0, -10.0), wait=True)
    assert flying.at == pytest.approx([30.0, 40.0, -10.0], abs=1.0)
    assert flying.velocity == pytest.approx(STILL, abs=0.5)
    assert len(flying.setpoints()) == 1


def test_go_to_gps_is_in_degrees_above_home(flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    lat, lon = place(flying, 30.0, 40.0)
    pilotage.do(copter.go_to, GlobalTarget(lat, lon, 25.0), wait=True)
    setpoint = flying.setpoints()[0]
    assert (setpoint.lat_int, setpoint.lon_int, setpoint.alt) == (round(lat * 1e7), round(lon * 1e7), 25.0)
    assert flying.at == pytest.approx([30.0, 40.0, -25.0], abs=1.0)


@pytest.mark.parametrize("off", [(2.9, 0.0, 0.0), (0.0, 2.9, 0.0), (0.0, 0.0, 2.9), (0.0, 0.0, -2.9), (0.8, 0.8, 0)])
@pytest.mark.parametrize("frame", ["ned", "gps"])
def test_off_on_one_axis_is_not_arrival(
    flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage, off: tuple[float, float, float], frame: str
) -> None:
    flying.stuck = True
    flying.at = [10.0 + off[0], 10.0 + off[1], -20.0 + off[2]]
    loop.pass_time(1.0)
    target = NedTarget(10.0, 10.0, -20.0) if frame == "ned" else GlobalTarget(*place(flying, 10.0, 10.0), 20.0)
    with pytest.raises(TimedOut, match="did not arrive"):
        pilotage.do(copter.go_to, target, wait=True)


@pytest.mark.parametrize("frame", ["ned", "gps"])
def test_passing_through_the_target_is_not_arrival(
    flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage, frame: str
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


def test_tolerance_can_be_wider(flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage) -> None:
    flying.stuck = True
    flying.at = [3.0, 0.0, -23.0]
    loop.pass_time(1.0)
    pilotage.do(copter.go_to, NedTarget(0.0, 0.0, -20.0), wait=True, tolerance=4.0)


def test_ned_target_below_home_is_invalid_and_nothing_is_sent(
    flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage
) -> None:
    going = pilotage.start(copter.go_to, FAR, wait=True)
    before = len(flying.orders())
    with pytest.raises(
        Invalid, match=r"5.0 m below home: down counts positive; /movement/go_to_gps flies below home"
    ):
        pilotage.do(copter.go_to, NedTarget(0.0, 0.0, 5.0))
    assert len(flying.orders()) == before
    assert going.running


def test_target_by_gps_may_lie_below_home(flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage) -> None:
    """It took off on a hill."""
    pilotage.do(copter.go_to, GlobalTarget(*place(flying, 5.0, 0.0), -5.0))
    assert flying.setpoints()[-1].alt == -5.0


@pytest.mark.parametrize(
    ("name", "target"),
    [("LOCAL_POSITION_NED", NedTarget(10, 0, -20)), ("GLOBAL_POSITION_INT", GlobalTarget(-35.0, 149.0, 20.0))],
)
def test_nothing_is_sent_by_a_stale_position(
    flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage, name: str, target: Any
) -> None:
    flying.mute.add(name)
    loop.pass_time(4.0)
    with pytest.raises(Stale):
        pilotage.do(copter.go_to, target, wait=True)
    nothing_more(loop, flying)


def test_gap_in_the_telemetry_does_not_end_a_flight(
    flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage
) -> None:
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
    flying: Drone,
    loop: FastLoop,
    copter: Vehicle,
    pilotage: Pilotage,
    setup: Callable[[Any], None],
    error: type,
    verb: str,
) -> None:
    setup(flying)
    loop.pass_time(0.5)
    with pytest.raises(error):
        if verb == "set_yaw_rate":
            pilotage.do(copter.set_yaw_rate, 10.0)
        else:
            pilotage.do(getattr(copter, verb), FAR if verb == "go_to" else VelocityTarget(1, 0, 0))
    nothing_more(loop, flying)


def test_look_at_target_points_along_the_way(flying: Drone, copter: Vehicle, pilotage: Pilotage) -> None:
    pilotage.do(copter.go_to, NedTarget(0.0, 30.0, -20.0), look_at_target=True)
    setpoint = flying.setpoints()[0]
    assert setpoint.yaw == pytest.approx(math.pi / 2)
    assert not setpoint.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE


def test_progress_is_height_and_way_to_go(flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage) -> None:
    job = pilotage.start(copter.go_to, FAR, wait=True)
    loop.pass_time(5.0)
    assert job.progress == {"altitude": 20.0, "distance_to_go": pytest.approx(150.0, abs=6.0)}


def test_own_timeout_ends_a_flight(flying: Drone, loop: FastLoop, copter: Vehicle, pilotage: Pilotage) -> None:
    started = loop.time()
    with pytest.raises(TimedOut):
        pilotage.do(copter.go_to, FAR, wait=True, timeout=3.0)
    assert loop.time() - started == pytest.approx(3.0, abs=0.3)


def test_offset_from_here(flying: Drone, loop: FastLoop, copter: Vehicle) -> None:
    flying.at, flying.yaw = [10.0, 20.0, -30.0], math.radians(90)
    loop.pass_time(0.5)
    assert copter.ned_from_here(1.0, 2.0, -3.0) == NedTarget(11.0, 22.0, -33.0)
    body = copter.body_from_here(5.0, 2.0, 1.0)
    assert (body.x, body.y, body.z) == pytest.approx((8.0, 25.0, -29.0))


def test_speed_that_is_set_while_another_is_repeated_disturbs_no_movement(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    for kind in ("ground", "descent"):
        pilotage.do(copter.set_speed, kind, 1.0)
    job = pilotage.start(copter.go_to, FAR)  # repeats the speeds, for the kind of setpoint has changed
    climb = pilotage.start(copter.set_speed, "climb", 1.0)
    assert pilotage.result(job) == "done"
    assert pilotage.result(climb) == "done"
    assert copter.speeds.in_force == dict.fromkeys(("ground", "descent", "climb"), 1.0)


def test_newer_target_takes_over_while_the_older_client_is_notified(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    older = pilotage.start(copter.go_to, FAR, wait=True)
    newer = pilotage.start(copter.go_to, NedTarget(0.0, 30.0, -20.0), wait=True)
    with pytest.raises(Superseded):
        pilotage.result(older)
    assert pilotage.result(newer) == "done"
    assert flying.at == pytest.approx([0.0, 30.0, -20.0], abs=1.0)


def test_two_vehicles_are_flown_by_themselves(
    loop: FastLoop, make_drone: Callable[..., Drone], registry: VehicleRegistry
) -> None:
    from mavproxy_uavapi.core.control.jobs import JobBook

    drones = [make_drone(1), make_drone(2)]
    for drone in drones:
        drone.fly()
    loop.settle()
    book = JobBook()

    async def both() -> None:
        jobs = []
        for system, target in ((1, NedTarget(30.0, 0.0, -20.0)), (2, NedTarget(0.0, 30.0, -20.0))):
            copter = registry.find(system)

            async def body(job: Any, copter: Vehicle = copter, target: Any = target) -> str:
                await copter.go_to(job, target, wait=True)
                return "done"

            jobs.append(book.begin(copter, "/go", {"to": system}, body))
        for job in jobs:
            assert await job.outcome() == "done"

    loop.run(both())
    assert drones[0].at == pytest.approx([30.0, 0.0, -20.0], abs=1.0)
    assert drones[1].at == pytest.approx([0.0, 30.0, -20.0], abs=1.0)
    assert len(drones[0].setpoints()) == len(drones[1].setpoints()) == 1
