"""Verbs in flight: every blocking call is a job that somebody awaits.

A vehicle has one seat for a commander. A newer movement or flight command that takes it supersedes the job
that had it; an identical request joins that job instead.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from mavproxy_uavapi.errors import Aborted, Superseded, TimedOut, UavApiError, without_frames
from mavproxy_uavapi.sent import SentNames, noting_sent_if_nobody_does

FINISHED_KEPT = 100
CONSOLE = "console"  # the client of what was typed at MAVProxy's prompt


class Job:
    """One verb in flight.

    Attributes:
        id: its number, as text.
        verb: the path that was called, `/movement/go_to_ned_wait`.
        request: the validated parameters.
        seat: the vehicle's, which it takes.
        client: who asked for it: an address, or CONSOLE.
        began_at, ended_at: on the loop's clock (s); ended_at is None while it runs.
        ended_by_hang_up: whether it ended because its last client hung up.
        outlives_client: whether it goes on when its client hangs up (land, rtl).
        stage: of a verb that is made of others, which one it is at: its name and numbers.
        progress: what it last said of itself, such as distance_to_go (m) and altitude (m above home).
        result: the text of its success.
        error: why it failed.
        sent: names of the messages sent for it; None where the HTTP call that began it notes them.
    """

    def __init__(
        self, number: int, verb: str, request: Mapping[str, Any], seat: Seat, *, client: str, outlives_client: bool
    ) -> None:
        self.id = str(number)
        self.client = client
        self.verb = verb
        self.request = dict(request)
        self.seat = seat
        self.outlives_client = outlives_client
        self.stage: dict[str, str | int] = {}
        self.progress: dict[str, float] = {}
        self.result: str | None = None
        self.error: UavApiError | None = None
        self.sent: SentNames | None = None
        self._loop = asyncio.get_running_loop()
        self.began_at = self._loop.time()
        self.ended_at: float | None = None
        self.ended_by_hang_up = False
        self._task: asyncio.Task[None] | None = None
        self._limit: asyncio.TimerHandle | None = None
        self._finished = asyncio.Event()
        self._clients = 0
        self._when_ended: list[Callable[[], None]] = []

    @property
    def running(self) -> bool:
        """Whether it has no outcome yet."""
        return not self._finished.is_set()

    def is_for(self, verb: str, request: Mapping[str, Any]) -> bool:
        """Whether it does just what another request asks for."""
        return self.verb == verb and self.request == dict(request)

    @property
    def outcome_name(self) -> str:
        """`running`, `succeeded` or `failed`."""
        if self.running:
            return "running"
        return "succeeded" if self.error is None else "failed"

    def start(self, body: Callable[[Job], Awaitable[str]], timeout: float | None = None) -> None:
        """Run `body`, whose text is the result; it never outlives `timeout` (s)."""
        self._task = self._loop.create_task(self._run(body))
        if timeout is not None:
            self._limit = self._loop.call_later(timeout, self._overdue, timeout)

    def _overdue(self, timeout: float) -> None:
        left = self.progress.get("distance_to_go")
        to_go = "" if left is None else f": {left:.1f} m to go"
        self.abort(TimedOut(f"{self.verb} was not done within {timeout:g} s{to_go}"))

    async def _run(self, body: Callable[[Job], Awaitable[str]]) -> None:
        try:
            result = await body(self)
        except UavApiError as error:
            self._finish(error=error)
        except asyncio.CancelledError:
            self._finish(error=Aborted(f"{self.verb} was aborted"))
            raise
        except Exception as error:  # a defect of ours: its client learns of it, and the log has the trace
            self._finish(error=UavApiError(f"{self.verb} failed by a defect of this program: {error!r}"))
            raise
        else:
            self._finish(result)

    def abort(self, error: UavApiError) -> None:
        """End it now with that error: its clients know at once, and it sends nothing more."""
        self._finish(error=error)
        if self._task is not None:
            self._task.cancel()

    def _finish(self, result: str | None = None, error: UavApiError | None = None) -> None:
        if self.running:
            self.result, self.error = result, None if error is None else without_frames(error)
            self.ended_at = self._loop.time()
            if self._limit is not None:
                self._limit.cancel()
            self._finished.set()
            for callback in self._when_ended:
                callback()

    def when_ended(self, callback: Callable[[], None]) -> None:
        """Have `callback` called when the outcome of a running job is known."""
        self._when_ended.append(callback)

    async def outcome(self) -> str:
        """Await its result for a client; when the last client hangs up, the job ends too.

        Raises:
            UavApiError: what the job failed with.
        """
        self._clients += 1
        try:
            await self._finished.wait()
        finally:
            self._clients -= 1
            if self.running and not self._clients and not self.outlives_client:
                self.ended_by_hang_up = True
                self.abort(Aborted(f"{self.verb}: its client hung up"))
        if self.error is not None:
            raise self.error
        assert self.result is not None
        return self.result


class Seat:
    """Who commands a vehicle just now."""

    def __init__(self) -> None:
        self.job: Job | None = None

    def take(self, job: Job) -> None:
        """Give `job` the command; whoever had it learns which verb took over."""
        before, self.job = self.job, job
        if before is not None and before is not job and before.running:
            before.abort(Superseded(f"{before.verb} was superseded by {job.verb}"))


class JobBook:
    """All jobs, the running ones and the last finished ones.

    Args:
        on_ended: called with each job when it has ended.
    """

    def __init__(self, on_ended: Callable[[Job], None] = lambda _: None) -> None:
        self._on_ended = on_ended
        self._jobs: dict[str, Job] = {}
        self._numbers = itertools.count(1)

    def begin(
        self,
        seat: Seat,
        verb: str,
        request: Mapping[str, Any],
        body: Callable[[Job], Awaitable[str]],
        *,
        client: str = CONSOLE,
        outlives_client: bool = False,
        timeout: float | None = None,
    ) -> Job:
        """Start a job, or join the one for that seat that does just the same."""
        for job in self.running():  # not the one in the seat: a job takes that when it has begun
            if job.seat is seat and job.is_for(verb, request):
                return job
        job = Job(next(self._numbers), verb, request, seat, client=client, outlives_client=outlives_client)
        self._jobs[job.id] = job
        self._forget_old()
        job.when_ended(lambda: self._on_ended(job))
        with noting_sent_if_nobody_does() as job.sent:
            job.start(body, timeout)
        return job

    def get(self, number: str) -> Job | None:
        """The job of that number; None when there is none, or it is forgotten."""
        return self._jobs.get(number)

    def all(self) -> list[Job]:
        """The running jobs and the last ones that ended, oldest first."""
        return list(self._jobs.values())

    def running(self) -> list[Job]:
        """The jobs without an outcome, oldest first."""
        return [job for job in self._jobs.values() if job.running]

    def abort_remote(self, reason: str) -> None:
        """End every running job that came over the network."""
        for job in self.running():
            if job.client != CONSOLE:
                job.abort(Aborted(f"{job.verb}: {reason}"))

    def _forget_old(self) -> None:
        finished = [job for job in self._jobs.values() if not job.running]
        for job in finished[: max(0, len(finished) - FINISHED_KEPT)]:
            del self._jobs[job.id]
