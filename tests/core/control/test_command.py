from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mavproxy_uavapi.core.control.authority import Rank
from mavproxy_uavapi.core.control.command import CommandState
from mavproxy_uavapi.core.control.jobs import Ending, Job
from mavproxy_uavapi.core.errors import Aborted, Busy, ModeChanged, NotArmed, Paused, Superseded
from mavproxy_uavapi.core.mainloop.permit import ORDER_LASTS, STOP_LASTS
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.piloting import FAR
from tests.support.virtual_time import FastLoop


@pytest.fixture
def going(loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage) -> Job:
    """A movement under way."""
    job = pilotage.start(copter.go_to, FAR, wait=True)
    loop.pass_time(1.0)
    return job


def test_command_has_the_states_of_its_jobs_life(
    loop: FastLoop, flying: Drone, copter: Vehicle, pilotage: Pilotage
) -> None:
    async def body(job: Any) -> None:
        command = copter.command(job)
        assert command.state is CommandState.WAITING
        await command.take(Rank.ARM)
        assert command.state is CommandState.ON_ITS_WAY
        command.confirm()
        assert command.state is CommandState.CONFIRMED

    job = pilotage.start(body)
    loop.pass_time(0.1)
    assert job.error is None and copter.command(job).state is CommandState.ENDED


def test_command_that_stop_interrupts_goes_on_after_resume(
    loop: FastLoop, copter: Vehicle, going: Job, pilotage: Pilotage
) -> None:
    pilotage.do(copter.stop)
    assert copter.command(going).state is CommandState.INTERRUPTED
    with pytest.raises(Paused):
        copter.command(going).require()
    pilotage.do(copter.resume)
    assert copter.command(going).state is CommandState.ON_ITS_WAY


@pytest.mark.parametrize("rank", Rank)
def test_interrupted_command_takes_the_vehicle_with_no_rank_until_resume(
    loop: FastLoop, copter: Vehicle, going: Job, pilotage: Pilotage, rank: Rank
) -> None:
    pilotage.do(copter.stop)
    with pytest.raises(Paused):
        copter.authority.take(going, rank)
    taking = loop.create_task(copter.command(going).take(rank))
    loop.pass_time(60.0)
    assert not taking.done()
    pilotage.do(copter.resume)
    loop.pass_time(2.0)
    assert taking.done() and taking.exception() is None


def test_basis_of_a_permit_changes_when_a_second_autopilot_is_heard(
    loop: FastLoop, copter: Vehicle, going: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    permit = copter.command(going).permit()
    before = permit.basis()
    monkeypatch.setattr(copter.state.time_ratio, "has_two_clocks", lambda now: True)
    assert permit.basis() != before
    with pytest.raises(Busy):
        permit.check()


def test_vehicle_switched_by_its_pilot_is_not_taken_by_a_longer_job(
    loop: FastLoop, drone: Drone, copter: Vehicle, flying: Drone, pilotage: Pilotage
) -> None:
    async def body(job: Any) -> None:
        await asyncio.sleep(0.6)
        await copter.command(job).take(Rank.ARM)

    job = pilotage.start(body)
    loop.pass_time(0.3)
    drone.pilot("LOITER")
    with pytest.raises(ModeChanged):
        pilotage.result(job)


def test_message_of_a_job_that_was_aborted_this_moment_is_not_written(
    loop: FastLoop, copter: Vehicle, going: Job
) -> None:
    async def abort() -> None:
        permit = copter.command(going).permit()
        before = permit.basis()
        going.abort(Aborted("it is stopped"), Ending.SUPERSEDED)
        assert permit.basis() != before, "the main loop must ask again"
        with pytest.raises(Aborted):
            permit.check()

    loop.run_until_complete(abort())


@pytest.mark.parametrize(("deed", "error"), [("pilot", ModeChanged), ("disarm", NotArmed)])
def test_interrupted_command_ends_when_the_pilot_takes_the_stopped_vehicle(
    loop: FastLoop, drone: Drone, copter: Vehicle, going: Job, pilotage: Pilotage, deed: str, error: type[Exception]
) -> None:
    pilotage.do(copter.stop)
    taking = loop.create_task(copter.command(going).take(Rank.STOP))
    loop.pass_time(1.0)
    if deed == "pilot":
        drone.pilot("LOITER")
    else:
        drone.armed = False
    loop.pass_time(3.0)
    assert isinstance(taking.exception(), error)


def test_superseded_command_is_not_in_force(loop: FastLoop, copter: Vehicle, going: Job, pilotage: Pilotage) -> None:
    pilotage.start(copter.land)
    with pytest.raises(Superseded):
        copter.command(going).require()


def test_nothing_is_in_force_while_two_autopilots_have_the_id(
    copter: Vehicle, going: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(copter.state.time_ratio, "has_two_clocks", lambda now: True)
    with pytest.raises(Busy, match="two autopilots"):
        copter.command(going).require()


def test_permit_of_what_stops_the_vehicle_lasts_longer_and_goes_first(
    loop: FastLoop, copter: Vehicle, going: Job, pilotage: Pilotage
) -> None:
    movement = copter.command(going).permit()
    stop = copter.command(pilotage.start(copter.land)).permit()
    assert (movement.lasts, movement.stops) == (ORDER_LASTS, False)
    assert (stop.lasts, stop.stops) == (STOP_LASTS, True)


def test_basis_of_a_permit_changes_when_stop_interrupts_its_job(
    loop: FastLoop, copter: Vehicle, going: Job, pilotage: Pilotage
) -> None:
    permit = copter.command(going).permit()
    before = permit.basis()
    pilotage.start(copter.stop)
    loop.pass_time(0.1)
    assert going.running and copter.command(going).state is CommandState.INTERRUPTED
    assert permit.basis() != before


def test_basis_of_a_permit_changes_when_another_job_commands(
    loop: FastLoop, copter: Vehicle, going: Job, pilotage: Pilotage
) -> None:
    permit = copter.command(going).permit()
    before = permit.basis()
    pilotage.start(copter.land)
    assert permit.basis() != before
    with pytest.raises(Superseded):
        permit.check()
