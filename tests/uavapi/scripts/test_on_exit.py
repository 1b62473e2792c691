from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.messages import NedTarget, VelocityTarget
from mavproxy_uavapi.core.oversight.endings import Policy
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.scripts.on_exit import GOES_ON, after_death
from mavproxy_uavapi.scripts.runs import Run
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.virtual_time import FastLoop


def run_of(session: str = "UAV_API_1_a") -> Run:
    return Run(Path("r"), "a.py", [], session, 1, 8000, 0.0, Path("o"), Path("e"), 1.0)


def after(loop: FastLoop, host: Host, action: str, sysid: int = 1, others: tuple[str, ...] = ()) -> str:
    host.endings.on_script_exit = Policy(action)
    return str(loop.run(after_death(host, sysid, run_of(), list(others))))


@pytest.fixture
def flown(flying: Drone, pilotage: Pilotage, copter: Vehicle) -> Drone:
    """The drone on its way to a place that a client gave it."""
    pilotage.do(copter.go_to, NedTarget(90.0, 0.0, -20.0))
    return flying


def test_hold_stops_the_vehicle_and_leaves_it_in_guided(loop: FastLoop, host: Host, flown: Drone) -> None:
    assert after(loop, host, "hold") == "hold is done"
    setpoint = flown.setpoints()[-1]
    assert (setpoint.vx, setpoint.vy, setpoint.vz) == (0, 0, 0)
    assert flown.mode == "GUIDED"


def test_a_vehicle_that_another_station_flies_is_left_alone(loop: FastLoop, host: Host, flying: Drone) -> None:
    assert after(loop, host, "hold") == "left alone: another ground station flies the vehicle"
    assert flying.orders() == []


@pytest.mark.parametrize(("action", "mode"), [("land", "LAND"), ("rtl", "RTL")])
def test_land_and_rtl_bring_it_down(loop: FastLoop, host: Host, flown: Drone, action: str, mode: str) -> None:
    assert after(loop, host, action) == f"{action} is done"
    assert (flown.mode, flown.armed) == (mode, False)


@pytest.mark.parametrize("action", ["hold", "land", "rtl"])
@pytest.mark.parametrize("mode", ["LOITER", "LAND", "AUTO"])
def test_a_pilots_mode_is_never_touched(loop: FastLoop, host: Host, flying: Drone, action: str, mode: str) -> None:
    flying.pilot(mode)
    loop.settle()
    assert mode in after(loop, host, action)
    assert flying.orders() == []


@pytest.mark.parametrize("action", ["hold", "land", "rtl"])
def test_a_vehicle_that_is_not_armed_is_left_alone(loop: FastLoop, host: Host, drone: Drone, action: str) -> None:
    drone.pilot("GUIDED")
    loop.settle()
    assert "not armed" in after(loop, host, action)
    assert drone.orders() == []


def test_nothing_is_nothing(loop: FastLoop, host: Host, flying: Drone) -> None:
    after(loop, host, "nothing")
    assert flying.orders() == []


def test_somebody_elses_verb_is_not_superseded(
    loop: FastLoop, host: Host, flying: Drone, pilotage: Pilotage, copter: Vehicle
) -> None:
    job = pilotage.start(copter.land)
    orders = len(flying.orders())
    assert "flies the vehicle" in after(loop, host, "hold") or flying.mode == "LAND"
    assert len(flying.orders()) == orders
    assert job.running


def test_no_vehicle_is_reported(loop: FastLoop, host: Host) -> None:
    assert "nothing can be done" in after(loop, host, "land", sysid=9)


@pytest.mark.parametrize("seconds", [0.1, 2.0])
def test_pilot_who_takes_the_vehicle_meanwhile_keeps_it(
    loop: FastLoop, host: Host, flown: Drone, seconds: float
) -> None:
    host.endings.on_script_exit = Policy.LAND
    task = loop.create_task(after_death(host, 1, run_of(), []))
    loop.pass_time(seconds)
    flown.pilot("LOITER")
    assert "LOITER" in loop.run(task)
    assert flown.mode == "LOITER"


def test_another_script_that_runs_on_keeps_the_vehicle(loop: FastLoop, host: Host, flying: Drone) -> None:
    assert "b.py still runs" in after(loop, host, "hold", others=("b.py",))
    assert flying.orders() == []


@pytest.mark.parametrize("others", [(), ("b.py",)])
def test_a_dead_scripts_own_job_ends_with_it(
    loop: FastLoop, host: Host, flying: Drone, pilotage: Pilotage, copter: Vehicle, others: tuple[str, ...]
) -> None:
    job = pilotage.start(copter.travel, VelocityTarget(8.0, 0.0, 0.0), duration=600.0)
    job.script = run_of().session
    loop.pass_time(3.0)
    assert after(loop, host, "hold", others=others) == "hold is done"
    assert (job.running, job.ending.value) == (False, "script gone")
    assert flying.setpoints()[-1].vx == 0.0


def test_a_dead_scripts_mission_is_uploaded_to_its_end(
    loop: FastLoop, host: Host, flown: Drone, pilotage: Pilotage
) -> None:
    async def upload(_job: Any) -> None:
        await asyncio.sleep(60.0)

    job = pilotage.start(upload)
    job.verb, job.script = "/mission/waypoints", run_of().session
    assert after(loop, host, "hold") == "hold is done"
    assert job.running


def test_somebody_elses_job_does_not_end_with_a_script(
    loop: FastLoop, host: Host, flying: Drone, pilotage: Pilotage, copter: Vehicle
) -> None:
    job = pilotage.start(copter.travel, VelocityTarget(8.0, 0.0, 0.0), duration=600.0)
    job.script = "UAV_API_1_b"
    assert "flies the vehicle" in after(loop, host, "hold")
    assert job.running


@pytest.mark.parametrize(
    "verb", ["/command/land", "/fleet/land", "/fleet/rtl", "/command/land_at", "/fleet/waypoints"]
)
def test_what_brings_it_down_or_changes_its_mission_goes_on(verb: str) -> None:
    assert verb in GOES_ON
    assert "/vision/land" not in GOES_ON
