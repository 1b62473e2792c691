from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from mavproxy_uavapi.core.control.authority import YAW, CommandAuthority, Rank
from mavproxy_uavapi.core.control.jobs import Job, JobBook
from mavproxy_uavapi.core.errors import Aborted, Busy, LinkLost, ModeChanged, NotArmed, Paused, Superseded
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.messages import GlobalTarget, VelocityTarget
from mavproxy_uavapi.core.mainloop.permit import no_check
from mavproxy_uavapi.core.oversight.history import REASON_WITHIN
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.piloting import FAR, nothing_more
from tests.support.virtual_time import FastLoop

RANKS = list(Rank)


class Tower:
    """An authority, and jobs that last until somebody ends them; `moving` and `stopping` are of `stopped`."""

    moving: Job
    stopping: Job

    def __init__(self, loop: FastLoop) -> None:
        self._loop, self._book = loop, JobBook()
        self.state = VehicleState(1, 1, 2, heartbeat_at=10.0, armed=True, mode=4, mode_since=5.0)
        self.authority = CommandAuthority(self.state)

    def job(self, verb: str) -> Job:
        async def body(job: Job) -> str:
            await asyncio.Event().wait()
            return ""

        async def begin() -> Job:
            return self._book.begin(self, verb, {}, body)

        return self._loop.run(begin())

    def commander(self, verb: str = "/commander", rank: Rank = Rank.MOVEMENT, *, shown: bool = False) -> Job:
        job = self.job(verb)
        self.authority.take(job, rank)
        if shown:
            self.authority.confirm(job)
        return job

    def switch(self, at: float) -> None:
        """A heartbeat shows another mode."""
        self.state.mode, self.state.mode_since, self.state.heartbeat_at = 5, at, at


@pytest.fixture
def tower(loop: FastLoop) -> Tower:
    return Tower(loop)


@pytest.mark.parametrize("newer", RANKS)
@pytest.mark.parametrize("older", RANKS)
def test_what_is_on_its_way_is_superseded_by_its_own_rank_or_a_higher_one(
    tower: Tower, older: Rank, newer: Rank
) -> None:
    first, second = tower.commander("/first", older), tower.job("/second")
    if newer < older:
        with pytest.raises(Busy, match="/first is on its way"):
            tower.authority.take(second, newer)
        assert tower.authority.commander is first and first.running
    else:
        tower.authority.take(second, newer)
        assert tower.authority.commander is second
        assert isinstance(first.error, Superseded) and "by /second" in str(first.error)


@pytest.mark.parametrize("newer", RANKS)
@pytest.mark.parametrize("older", RANKS)
def test_what_has_been_shown_is_superseded_by_any_rank(tower: Tower, older: Rank, newer: Rank) -> None:
    first, second = tower.commander("/first", older, shown=True), tower.job("/second")
    tower.authority.take(second, newer)
    assert tower.authority.commander is second and not first.running


@pytest.mark.parametrize("newer", RANKS)
def test_what_has_ended_stands_in_nobodys_way(tower: Tower, newer: Rank) -> None:
    tower.commander("/first", Rank.FORCE).abort(Superseded("it ended"))
    second = tower.job("/second")
    tower.authority.take(second, newer)
    assert tower.authority.commander is second


def test_commander_takes_what_it_has(tower: Tower) -> None:
    job = tower.commander(rank=Rank.STOP)
    tower.authority.take(job, Rank.MOVEMENT)
    assert job.running and tower.authority.commander is job


def test_only_the_commander_and_who_goes_beside_it_may_send(tower: Tower) -> None:
    first, turning = tower.commander("/first"), tower.job("/turn")
    tower.authority.accompany(turning, "ground speed")
    tower.authority.require(first)
    tower.authority.require(turning)
    second = tower.commander("/second")
    tower.authority.require(second)
    tower.authority.require(turning)
    with pytest.raises(Superseded, match="/first was superseded"):
        tower.authority.require(first)


def test_newer_companion_supersedes_the_older_one_of_its_kind_alone(tower: Tower) -> None:
    tower.commander()
    slow, fast, turn = tower.job("/slow"), tower.job("/fast"), tower.job("/turn")
    for job, kind in ((slow, "ground speed"), (turn, YAW), (fast, "ground speed")):
        tower.authority.accompany(job, kind)
    assert not slow.running and fast.running and turn.running


def test_movement_ends_a_turn_and_leaves_a_speed(tower: Tower) -> None:
    turn, speed = tower.job("/turn"), tower.job("/speed")
    tower.authority.accompany(turn, YAW)
    tower.authority.accompany(speed, "ground speed")
    tower.commander()
    assert not turn.running and speed.running


@pytest.mark.parametrize("rank", [Rank.ARM, Rank.STOP, Rank.FORCE])
def test_what_is_more_than_a_movement_ends_all_that_goes_beside(tower: Tower, rank: Rank) -> None:
    turn, speed = tower.job("/turn"), tower.job("/speed")
    tower.authority.accompany(turn, YAW)
    tower.authority.accompany(speed, "ground speed")
    tower.commander(rank=rank)
    assert not turn.running and not speed.running


@pytest.mark.parametrize("rank", [Rank.ARM, Rank.STOP, Rank.FORCE])
def test_nothing_goes_beside_what_is_on_its_way(tower: Tower, rank: Rank) -> None:
    tower.commander(rank=rank)
    with pytest.raises(Busy):
        tower.authority.accompany(tower.job("/speed"), "ground speed", stopped_too=True)


def test_somebody_elses_word_shows_nothing(tower: Tower) -> None:
    tower.commander(rank=Rank.STOP)
    tower.authority.confirm(tower.job("/other"))
    with pytest.raises(Busy):
        tower.authority.admit(Rank.MOVEMENT)


# -- stop --------------------------------------------------------------------------------------------------


@pytest.fixture
def stopped(tower: Tower) -> Tower:
    """The tower, with a movement that `stop` has interrupted; the jobs are `moving` and `stopping`."""
    tower.moving, tower.stopping = tower.commander("/moving"), tower.job("/stop")
    tower.authority.interrupt(tower.stopping)
    return tower


def test_stop_interrupts_a_movement_and_lets_none_begin(stopped: Tower) -> None:
    authority = stopped.authority
    assert authority.paused and authority.interrupted is stopped.moving and stopped.moving.running
    with pytest.raises(Paused, match="/moving ended"):
        authority.require(stopped.moving)
    authority.confirm(stopped.stopping)
    with pytest.raises(Paused, match="`resume`"):
        authority.admit(Rank.MOVEMENT)
    authority.admit(Rank.MOVEMENT, stopped_too=True)


def test_end_of_a_pause_gives_the_movement_back_its_vehicle(stopped: Tower) -> None:
    stopped.authority.end_pause()
    assert not stopped.authority.paused
    assert stopped.authority.commander is stopped.moving and stopped.authority.interrupted is None
    stopped.authority.require(stopped.moving)


def test_second_stop_keeps_what_the_first_one_interrupted(stopped: Tower) -> None:
    again = stopped.job("/stop again")
    stopped.authority.interrupt(again)
    assert not stopped.stopping.running and stopped.moving.running
    stopped.authority.end_pause()
    assert stopped.authority.commander is stopped.moving


def test_mode_of_somebody_else_ends_a_pause(stopped: Tower) -> None:
    stopped.switch(at=11.0)
    assert not stopped.authority.paused


@pytest.mark.parametrize("rank", [Rank.STOP, Rank.FORCE])
def test_what_takes_a_stopped_vehicle_ends_the_stop_and_what_waited(stopped: Tower, rank: Rank) -> None:
    newer = stopped.commander("/newer", rank)
    assert not stopped.stopping.running and not stopped.moving.running
    assert stopped.authority.commander is newer and stopped.authority.interrupted is None


@pytest.mark.parametrize("rank", [Rank.STOP, Rank.FORCE])
def test_stop_interrupts_no_landing(tower: Tower, rank: Rank) -> None:
    landing = tower.commander("/land", rank, shown=True)
    tower.authority.interrupt(tower.job("/stop"))
    assert not landing.running and tower.authority.interrupted is None


def test_who_flies_is_the_commander_or_what_waits(stopped: Tower) -> None:
    assert stopped.authority.flies is stopped.stopping
    stopped.stopping.abort(Superseded("it ended"))
    assert stopped.authority.flies is stopped.moving
    stopped.moving.abort(Superseded("it ended"))
    assert stopped.authority.flies is None


# -- flights: who has the command -------------------------------------------------------------------------


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
def waiting(request: pytest.FixtureRequest, loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage) -> Job:
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
    waiting: Job, loop: FastLoop, drone: Drone, pilotage: Pilotage, mode: str
) -> None:
    drone.pilot(mode)
    started = loop.time()
    with pytest.raises(ModeChanged, match=mode):
        pilotage.result(waiting)
    assert waiting.ended_at - started < 0.05
    assert loop.time() - started < 0.05 + REASON_WITHIN
    nothing_more(loop, drone)
    assert drone.mode == mode


def test_newer_verb_supersedes_every_wait_at_once(
    waiting: Job, loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage
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


def test_client_that_hangs_up_ends_the_verb_and_nothing_more_is_sent(
    waiting: Job, loop: FastLoop, drone: Drone
) -> None:
    client = loop.create_task(waiting.outcome())
    loop.settle()
    client.cancel()
    loop.settle()
    assert isinstance(waiting.error, Aborted)
    nothing_more(loop, drone)


def test_link_loss_ends_every_wait(
    waiting: Job, loop: FastLoop, host: Host, drone: Drone, pilotage: Pilotage
) -> None:
    drone.power_off()
    started = loop.time()
    with pytest.raises(LinkLost):
        pilotage.result(waiting)
    assert loop.time() - started <= host.link_watch.timeout + 0.1
    assert len(host.pending) == 0
    nothing_more(loop, drone)


def test_disarming_ends_every_flight(waiting: Job, loop: FastLoop, drone: Drone, pilotage: Pilotage) -> None:
    drone.armed = False
    drone.tell("HEARTBEAT")
    if waiting.verb.startswith(("land", "rtl")):
        assert pilotage.result(waiting) == "done"
    else:
        with pytest.raises(NotArmed):
            pilotage.result(waiting)
    nothing_more(loop, drone)


def test_job_that_set_a_speed_before_it_flew_is_only_interrupted(tower: Tower) -> None:
    flight, stop = tower.job("/vision/mission"), tower.job("/movement/stop")
    tower.authority.accompany(flight, "ground speed")
    tower.authority.take(flight, Rank.MOVEMENT)
    tower.authority.interrupt(stop)
    assert flight.running and tower.authority.interrupted is flight


def refuse() -> None:
    raise Busy("anna holds it")


@pytest.mark.parametrize("refuses", ["permit", "allow"])
def test_refused_command_changes_nothing(tower: Tower, refuses: str) -> None:
    commander, job = tower.commander("/first", shown=True), tower.job("/second")
    if refuses == "permit":
        job.require_permit = refuse
    for take in (
        tower.authority.take,
        lambda job, rank, allow: tower.authority.accompany(job, YAW, rank, allow=allow),
    ):
        with pytest.raises(Busy, match="anna"):
            take(job, Rank.STOP, refuse if refuses == "allow" else no_check)
        assert tower.authority.commander is commander and commander.running
        with pytest.raises(Superseded):
            tower.authority.require(job)
