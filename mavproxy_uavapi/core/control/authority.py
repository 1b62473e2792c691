"""Who may command a vehicle: one commander at a time, by rank. Pure.

A verb asks here before it sends anything, and again before each message. Until telemetry shows that a verb has taken
effect, only its own rank or a higher one supersedes it; a lower one is refused.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from enum import IntEnum

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Busy, Paused, Superseded
from mavproxy_uavapi.core.mainloop.permit import no_check
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

YAW = "yaw"


class Rank(IntEnum):
    """Which verb supersedes which: a higher rank comes first."""

    MOVEMENT = 1  # movements, yaw, speeds
    ARM = 2  # arm, takeoff, guided, set_mode, the start of a mission
    STOP = 3  # land, rtl, brake, stop, hold, disarm
    PROTECT = 4  # what stops a vehicle at its envelope, or before another vehicle
    FORCE = 5  # disarm in flight


class CommandAuthority:
    """Says who commands one vehicle.

    Attributes:
        commander: the job that commands the vehicle, or was the last to do so.
        rank: its rank.
        epoch: changes whenever another job commands, or a pause begins or ends. Any thread may read it.
        taken_in: `state.mode_since` of the mode in which the commander took the vehicle (s).

    Args:
        state: the vehicle's state; a pause ends when its mode changes.
    """

    def __init__(self, state: VehicleState) -> None:
        self.commander: Job | None = None
        self.epoch, self.taken_in = 0, -math.inf
        self._state = state
        self.rank = Rank.MOVEMENT
        self._shown = True
        self._suspended: tuple[Job, Rank, bool] | None = None  # the commander that a pause interrupted
        self._companions: dict[str, Job] = {}  # jobs beside a movement, by kind: yaw, a speed, resume
        self._next: list[Job] = []  # what stops it as soon as it is protected no more
        self._paused_at: float | None = None
        self._knows_pause_since = state.heartbeat_at  # s; a pause from before that is nobody's knowledge

    # -- asking -------------------------------------------------------------------------------------------

    @property
    def paused(self) -> bool:
        """Whether `stop` holds the vehicle still."""
        return self._paused_at is not None and self._state.mode_since <= self._paused_at

    @property
    def pause_is_unknown(self) -> bool:
        """Whether the vehicle has been in its mode since before we knew it: somebody may have paused it there."""
        return self._state.mode_since <= self._knows_pause_since

    @property
    def on_its_way(self) -> bool:
        """Whether the commander's verb has not shown its effect yet."""
        return self.commander is not None and self.commander.running and not self._shown

    def has_shown(self, job: Job) -> bool:
        """Whether `job` commands, and telemetry has shown the whole effect of its verb."""
        return job is self.commander and self._shown

    @property
    def is_protected(self) -> bool:
        """Whether the vehicle is being stopped at its envelope, or before another vehicle, and does not stand yet."""
        return self.on_its_way and self.rank is Rank.PROTECT

    @property
    def has_next(self) -> bool:
        """Whether a verb waits to stop or land the vehicle as soon as it is protected no more."""
        return bool(self._next)

    @property
    def interrupted(self) -> Job | None:
        """The job that waits for the end of a pause."""
        return None if self._suspended is None else self._suspended[0]

    @property
    def flies(self) -> Job | None:
        """The job that flies the vehicle now, paused or not; None when none does."""
        for job in (self.commander, self.interrupted):
            if job is not None and job.running:
                return job
        return None

    def require(self, job: Job) -> None:
        """Raise unless `job` still commands; called before each of its messages.

        Raises:
            Paused: `stop` interrupts it.
            Superseded: another job commands.
        """
        if job is self.interrupted:
            raise Paused(f"{job.verb} ended: the vehicle is stopped")
        if job is self.commander or job in self._companions.values():
            return
        raise Superseded(f"{job.verb} was superseded")

    def admit(self, rank: Rank, *, stopped_too: bool = False) -> None:
        """Raise unless a verb of that rank may command now.

        Args:
            rank: the verb's.
            stopped_too: whether a verb of rank MOVEMENT may command a vehicle that `stop` holds.

        Raises:
            Busy: a verb of a higher rank has not shown its effect yet, or waits for its turn.
            Paused: `stop` holds the vehicle; rank MOVEMENT only.
        """
        commander = self.commander
        if commander is not None and self.on_its_way and rank < self.rank:
            raise Busy(f"{commander.verb} is on its way; try again when the vehicle shows it")
        if self._next and rank < Rank.STOP:
            raise Busy(f"{self._next[0].verb} is on its way; try again when the vehicle shows it")
        if rank is Rank.MOVEMENT and self.paused and not stopped_too:
            raise Paused("the vehicle is stopped; `resume` or `guided` ends that")

    # -- commanding ---------------------------------------------------------------------------------------

    def take(self, job: Job, rank: Rank, allow: Callable[[], None] = no_check) -> None:
        """Make `job` the commander; the commander before is superseded.

        Args:
            job: the job that commands.
            rank: its verb's.
            allow: called after the rank check; refuses the job by raising.

        Raises:
            Busy, Paused: as `admit` and `Job.require_permit`; then nothing has changed. Likewise what `allow` raises.
                A job that `stop` interrupted sends nothing until `resume`, whatever its rank: Paused.
            Superseded: the job has waited, and one that was requested later commands; what protects the vehicle is
                no request.
        """
        if job is self.interrupted:
            raise Paused(f"{job.verb} waits: the vehicle is stopped")
        self.require_turn(job, rank)
        allow()
        if job is not self.commander:
            self._supersede([self.commander, self.interrupted], job)
            self._suspended = None
        self._take(job, rank)

    def require_turn(self, job: Job, rank: Rank) -> None:
        """Raise unless `job` commands, or may do so now. Raises Busy, Paused and Superseded as `take`."""
        commander = self.commander
        if job is commander:
            return
        self.admit(rank)
        job.require_permit()
        if commander is not None and commander.is_newer_than(job) and not commander.protects:
            raise Superseded(f"{job.verb} was superseded by {commander.verb}")

    @contextlib.contextmanager
    def keeping_turn(self, job: Job) -> Iterator[None]:
        """While `job` waits to stop a vehicle that is protected, no verb of a lower rank takes it."""
        self._next.append(job)
        try:
            yield
        finally:
            self._next.remove(job)

    def interrupt(self, job: Job) -> None:
        """Make `job`, which stops the vehicle, the commander; a movement under way waits until it is resumed.

        Raises:
            Busy: as `admit`.
        """
        self.admit(Rank.STOP)
        before = self.commander
        if before is not None and before.running and self.rank < Rank.STOP:
            self._suspended = before, self.rank, self._shown
            before.is_interrupted = True
        else:
            self._supersede([before], job)
        self.begin_pause()
        self._take(job, Rank.STOP)

    def accompany(
        self,
        job: Job,
        kind: str,
        rank: Rank = Rank.MOVEMENT,
        *,
        stopped_too: bool = False,
        allow: Callable[[], None] = no_check,
    ) -> None:
        """Let `job` command beside the commander; an earlier one of its kind is superseded.

        Args:
            job: the job that commands.
            kind: YAW, a speed, or resume.
            rank, stopped_too: as for `admit`.
            allow: as for `take`.

        Raises:
            Busy, Paused: as `admit` and `Job.require_permit`. Also what `allow` raises.
        """
        if job is self.commander:  # it commands already, and more
            allow()
            return
        self.admit(rank, stopped_too=stopped_too)
        job.require_permit()
        allow()
        self._supersede([self._companions.get(kind)], job)
        self._companions[kind] = job
        self.epoch += 1
        job.note_command()

    def confirm(self, job: Job) -> None:
        """Note that telemetry shows the whole effect of the commander's verb: from now on any rank supersedes it."""
        if job is self.commander:
            self._shown = True

    def begin_pause(self) -> None:
        """Note that the vehicle is held still, or is about to be."""
        self._paused_at = max(self._state.heartbeat_at, self._state.mode_since)
        self._knows_pause_since = -math.inf
        self.epoch += 1

    def keep_pause(self) -> None:
        """Note that what pauses the vehicle is written now: older switches of its mode do not end the pause."""
        if self._paused_at is not None:
            self._paused_at = max(self._state.heartbeat_at, self._state.mode_since)

    def know_pause(self) -> None:
        """Note that the vehicle was not paused before we knew it: whoever pauses it later means it."""
        self._knows_pause_since = -math.inf

    def end_pause(self) -> None:
        """Note the end of the pause; the movement that it interrupted goes on."""
        self._paused_at = None
        self._knows_pause_since = -math.inf
        self.epoch += 1
        if self._suspended is not None:
            self.commander, self.rank, self._shown = self._suspended
            self.commander.is_interrupted = False
            self._suspended = None

    def _take(self, job: Job, rank: Rank) -> None:
        self.commander, self.rank, self._shown = job, rank, False
        self.epoch, self.taken_in = self.epoch + 1, self._state.mode_since
        self._companions = {kind: one for kind, one in self._companions.items() if one not in (job, self.interrupted)}
        kinds = [kind for kind in self._companions if rank > Rank.MOVEMENT or kind == YAW]
        self._supersede([self._companions.pop(kind) for kind in kinds], job)
        job.note_command()

    @staticmethod
    def _supersede(jobs: list[Job | None], by: Job) -> None:
        for job in jobs:
            if job is not None and job is not by and job.running:
                job.abort(Superseded(f"{job.verb} was superseded by {by.verb}"))
