from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mavproxy_uavapi.core.errors import Busy, Paused, Superseded
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle.authority import YAW, CommandAuthority, Rank
from mavproxy_uavapi.core.vehicle.jobs import Job, JobBook

RANKS = list(Rank)


class Tower:
    """An authority, and jobs that last until somebody ends them."""

    def __init__(self, loop: Any) -> None:
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
            self.authority.shown(job)
        return job

    def switch(self, at: float) -> None:
        """A heartbeat shows another mode."""
        self.state.mode, self.state.mode_since, self.state.heartbeat_at = 5, at, at


@pytest.fixture
def tower(loop: Any) -> Tower:
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
    tower.authority.shown(tower.job("/other"))
    with pytest.raises(Busy):
        tower.authority.admit(Rank.MOVEMENT)


# -- stop --------------------------------------------------------------------------------------------------


@pytest.fixture
def stopped(tower: Tower) -> Any:
    """The tower, with a movement that `stop` has interrupted; the jobs are `moving` and `stopping`."""
    tower.moving, tower.stopping = tower.commander("/moving"), tower.job("/stop")  # type: ignore[attr-defined]
    tower.authority.interrupt(tower.stopping)  # type: ignore[attr-defined]
    return tower


def test_stop_interrupts_a_movement_and_lets_none_begin(stopped: Any) -> None:
    authority = stopped.authority
    assert authority.paused and authority.interrupted is stopped.moving and stopped.moving.running
    with pytest.raises(Paused, match="/moving ended"):
        authority.require(stopped.moving)
    authority.shown(stopped.stopping)
    with pytest.raises(Paused, match="`resume`"):
        authority.admit(Rank.MOVEMENT)
    authority.admit(Rank.MOVEMENT, stopped_too=True)


def test_end_of_a_pause_gives_the_movement_back_its_vehicle(stopped: Any) -> None:
    stopped.authority.end_pause()
    assert not stopped.authority.paused
    assert stopped.authority.commander is stopped.moving and stopped.authority.interrupted is None
    stopped.authority.require(stopped.moving)


def test_second_stop_keeps_what_the_first_one_interrupted(stopped: Any) -> None:
    again = stopped.job("/stop again")
    stopped.authority.interrupt(again)
    assert not stopped.stopping.running and stopped.moving.running
    stopped.authority.end_pause()
    assert stopped.authority.commander is stopped.moving


def test_mode_of_somebody_else_ends_a_pause(stopped: Any) -> None:
    stopped.switch(at=11.0)
    assert not stopped.authority.paused


@pytest.mark.parametrize("rank", [Rank.STOP, Rank.FORCE])
def test_what_takes_a_stopped_vehicle_ends_the_stop_and_what_waited(stopped: Any, rank: Rank) -> None:
    newer = stopped.commander("/newer", rank)
    assert not stopped.stopping.running and not stopped.moving.running
    assert stopped.authority.commander is newer and stopped.authority.interrupted is None


@pytest.mark.parametrize("rank", [Rank.STOP, Rank.FORCE])
def test_stop_interrupts_no_landing(tower: Tower, rank: Rank) -> None:
    landing = tower.commander("/land", rank, shown=True)
    tower.authority.interrupt(tower.job("/stop"))
    assert not landing.running and tower.authority.interrupted is None


def test_who_flies_is_the_commander_or_what_waits(stopped: Any) -> None:
    assert stopped.authority.flies is stopped.stopping
    stopped.stopping.abort(Superseded("it ended"))
    assert stopped.authority.flies is stopped.moving
    stopped.moving.abort(Superseded("it ended"))
    assert stopped.authority.flies is None
