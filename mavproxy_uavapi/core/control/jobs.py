"""Verbs in flight: every call that flies is a job.

The CommandAuthority of a vehicle decides which job commands it. An identical request joins the running job.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Awaitable, Callable, Collection, Mapping
from enum import Enum
from typing import Any, Literal

from mavproxy_uavapi.core.errors import Aborted, Superseded, TimedOut, UavApiError, without_frames
from mavproxy_uavapi.core.mainloop.permit import Written
from mavproxy_uavapi.core.sent_messages import SentNames, noting_sent_unless_noted

FINISHED_KEPT = 100
MOMENT = 1.0  # s after its request, in which its client knows what the pilot did
CONSOLE = "console"  # the client of what was typed at MAVProxy's prompt


class Ending(Enum):
    """Why a job ended; `endings.py` says what its vehicle does then."""

    DONE = "done"
    FAILED = "failed"  # the vehicle or its pilot prevented it, or it took too long
    SUPERSEDED = "superseded"
    ABORTED = "aborted"  # by DELETE, or at the prompt
    CLIENT_GONE = "client gone"
    SCRIPT_GONE = "script gone"
    LEASE_OVER = "lease over"
    UNLOADED = "unloaded"  # the API stops, or a module is unloaded
    DEFECT = "defect"  # of this program


class Job:
    """One verb in flight.

    Attributes:
        id: its number, as text.
        verb: the path that was called, `/movement/go_to_ned_wait`.
        request: the validated parameters.
        vehicle: what it commands; jobs of one vehicle share this object while its type is the same.
        client: the client that began it: an address, with the name of its token before it, or CONSOLE.
        holder: the name by which that client may hold a lease; the same where it gave none.
        operator: the name by which it may hold the vehicle.
        began_at, ended_at: on the loop's clock (s); ended_at is None while it runs.
        ending: why it ended; None while it runs.
        steers: whether the job flies the vehicle by a stream of setpoints, without which the vehicle must stop.
        protects: whether it protects its vehicle (an ending, the border, separation): nobody deletes it before
            telemetry shows what it does.
        is_interrupted: whether it waits for the end of a `stop`.
        modes: names of the flight modes that it switched to; in any other mode the pilot has the vehicle.
        script: the session of a script that the job goes on for; None for no script.
        outlives_client: whether it goes on when its client hangs up (land, rtl).
        on_disconnect: the value of the `Policy` for a client that hangs up; None for the setting's.
        stage: the present step of a verb that consists of several: its name and numbers.
        progress: its last report, such as distance_to_go (m) and altitude (m above home).
        result: the text of its success.
        error: why it failed.
        require_permit: raises Busy if another operator holds the vehicle, from whom the job must not take it.
        sent: names of the messages sent for it; None where the HTTP call that began it notes them.
        last_sent: the name of the last order or setpoint of its command, and when (s); None before the first.
    """

    def __init__(
        self, number: int, verb: str, request: Mapping[str, Any], vehicle: Any, *, client: str, outlives_client: bool
    ) -> None:
        self.id = str(number)
        self.client = self.holder = self.operator = client
        self.verb = verb
        self.request = dict(request)
        self.vehicle = vehicle
        self.outlives_client = outlives_client
        self.require_permit: Callable[[], None] = lambda: None
        self.on_disconnect: str | None = None
        self.stage: dict[str, str | int] = {}
        self.progress: dict[str, float] = {}
        self.result: str | None = None
        self.error: UavApiError | None = None
        self.sent: SentNames | None = None
        self.last_sent: tuple[str, float] | None = None
        self._loop = asyncio.get_running_loop()
        self.began_at = self._loop.time()
        self.ended_at: float | None = None
        self.ending: Ending | None = None
        self.steers = self.protects = False
        self.is_interrupted = False
        self._modes: list[tuple[Collection[str], Written]] = []
        self.script: str | None = None
        self._task: asyncio.Task[None] | None = None
        self._limit: asyncio.TimerHandle | None = None
        self._finished = asyncio.Event()
        self._clients: list[str | None] = []  # the waiting clients: the session of a script, None for other clients
        self._sessions_sought = 0
        self._goes_on_for_others = False  # whether a client that is no script keeps it going
        self._when_ended: list[Callable[[], None]] = []
        self._told = asyncio.Event()
        self._lacks_reason = False
        self._when_told: list[Callable[[], None]] = []
        self._commands = False
        self._when_commanding: list[Callable[[], None]] = []

    @property
    def running(self) -> bool:
        """Whether it has no outcome yet."""
        return not self._finished.is_set()

    def note_modes(self, modes: Collection[str], written: Written) -> None:
        """Note modes that it switches to, or flies in, if that order is written."""
        self._modes.append((modes, written))

    @property
    def modes(self) -> set[str]:
        """The modes that it has switched to."""
        return {mode for modes, written in self._modes if written.value is not False for mode in modes}

    @property
    def is_late(self) -> bool:
        """Whether it was requested more than a moment ago: then a mode switch waits for `wait_for_heartbeat`."""
        return self._loop.time() - self.began_at > MOMENT

    def is_newer_than(self, other: Job) -> bool:
        """Whether it was requested later."""
        return int(self.id) > int(other.id)

    def is_for(self, verb: str, request: Mapping[str, Any]) -> bool:
        """Whether it does exactly what another request asks for; a job that `stop` interrupted does not."""
        return self.verb == verb and self.request == dict(request) and not self.is_interrupted

    @property
    def outcome_name(self) -> Literal["running", "succeeded", "failed"]:
        """`running`, `succeeded` or `failed`."""
        if self.running:
            return "running"
        return "succeeded" if self.error is None else "failed"

    def start(self, body: Callable[[Job], Awaitable[str]], timeout: float | None = None) -> None:
        """Run `body`, which returns the text of the result, for `timeout` s at most."""
        self._task = self._loop.create_task(self._run(body))
        if timeout is not None:
            self._limit = self._loop.call_later(timeout, self._overdue, timeout)

    def _overdue(self, timeout: float) -> None:
        distance = self.progress.get("distance_to_go")
        to_go = "" if distance is None else f": {distance:.1f} m to go"
        self.abort(TimedOut(f"{self.verb} was not done within {timeout:g} s{to_go}"), Ending.FAILED)

    async def _run(self, body: Callable[[Job], Awaitable[str]]) -> None:
        try:
            result = await body(self)
        except UavApiError as error:
            self._finish(Ending.SUPERSEDED if isinstance(error, Superseded) else Ending.FAILED, error=error)
        except asyncio.CancelledError:
            self._finish(Ending.UNLOADED, error=Aborted(f"{self.verb} was aborted"))
            raise
        except Exception as error:  # our own defect: the client gets a sentence, the log the traceback
            sentence = f"{self.verb} failed because of a defect in this program: {error!r}"
            self._finish(Ending.DEFECT, error=UavApiError(sentence))
            raise
        else:
            self.note_command()
            self._finish(Ending.DONE, result)

    def abort(self, error: UavApiError, ending: Ending | None = None) -> None:
        """End the job now with that error: its clients get it at once, and nothing more is sent.

        Args:
            error: what its clients get.
            ending: why it ended; by default SUPERSEDED for that error, else ABORTED.
        """
        self._finish(ending or (Ending.SUPERSEDED if isinstance(error, Superseded) else Ending.ABORTED), error=error)
        if self._task is not None:
            self._task.cancel()

    def _finish(self, ending: Ending, result: str | None = None, error: UavApiError | None = None) -> None:
        if self.running:
            self.ending = ending
            self.result, self.error = result, None if error is None else without_frames(error)
            self.ended_at = self._loop.time()
            if self._limit is not None:
                self._limit.cancel()
            self._finished.set()
            for callback in self._when_ended:
                callback()
            if not self._lacks_reason:
                self.tell()

    def when_ended(self, callback: Callable[[], None]) -> None:
        """Call `callback` when the outcome of a running job is known."""
        self._when_ended.append(callback)

    def wait_for_reason(self) -> None:
        """Let its clients wait for `tell`: why it ended is yet to be heard. For callbacks of `when_ended` only."""
        self._lacks_reason = True

    def tell(self) -> None:
        """Tell its clients the outcome."""
        self._told.set()
        callbacks, self._when_told = self._when_told, []
        for callback in callbacks:
            callback()

    @property
    def is_told(self) -> bool:
        """Whether its outcome is known, and why."""
        return self._told.is_set()

    def when_told(self, callback: Callable[[], None]) -> None:
        """Call `callback` when the outcome is known, and why; at once if it is."""
        self._when_told.append(callback)
        if self.is_told:
            self.tell()

    def note_sent(self, name: str) -> None:
        """Note that an order or a setpoint of that name goes out."""
        self.last_sent = name, self._loop.time()

    def note_command(self) -> None:
        """Note that it commands its vehicle, or has succeeded without a command."""
        self._commands = True
        callbacks, self._when_commanding = self._when_commanding, []
        for callback in callbacks:
            callback()

    def when_commanding(self, callback: Callable[[], None]) -> None:
        """Call `callback` once the job commands its vehicle, at once if it does already; never if it is refused."""
        self._when_commanding.append(callback)
        if self._commands:
            self.note_command()

    async def go_on_for(self, session: Awaitable[str | None]) -> str | None:
        """Let the job go on without its clients: while the calling script lives, or for other clients to its end.

        Args:
            session: finds the session of the calling script; None for other clients. The job goes on meanwhile.

        Returns:
            What `session` found.
        """
        self._sessions_sought += 1
        script = None
        try:
            script = await session
        finally:
            self._sessions_sought -= 1
            if script is None:
                self._goes_on_for_others = True
            else:
                self.script = script
        return script

    def join(self, on_disconnect: str | None) -> None:
        """Another client joins the job. If either asks for `hold`, the vehicle holds.

        Args:
            on_disconnect: its wish; None for the setting's, which may be a hold, too.
        """
        wishes = (self.on_disconnect, on_disconnect)
        self.on_disconnect = "hold" if "hold" in wishes else None if None in wishes else on_disconnect

    def end_with_script(self) -> None:
        """End the job because its script died. It goes on if another client requested the same, or waits for it."""
        others_wait = any(client != self.script for client in self._clients)
        if not (others_wait or self._goes_on_for_others or self._sessions_sought):
            self.abort(Aborted(f"{self.verb}: its script died"), Ending.SCRIPT_GONE)
        self.script = None

    @property
    def _needs_client(self) -> bool:
        others = self._goes_on_for_others or self._sessions_sought > 0
        return not (self.outlives_client or self.script is not None or others)

    async def outcome(self, script: str | None = None) -> str:
        """Await its result for a client. When the last client hangs up, the job ends, unless `go_on_for` keeps it.

        Args:
            script: the client's session, if it is a script that the job goes on for.

        Raises:
            UavApiError: what the job failed with.
        """
        self._clients.append(script)
        try:
            await self._finished.wait()
        finally:
            self._clients.remove(script)
            if self.running and not self._clients and self._needs_client:
                self.abort(Aborted(f"{self.verb}: its client hung up"), Ending.CLIENT_GONE)
        await self._told.wait()
        if self.error is not None:
            raise self.error
        assert self.result is not None
        return self.result


class JobBook:
    """All jobs, the running ones and the last finished ones.

    Attributes:
        on_ended: called with each job when its outcome is known.
    """

    def __init__(self) -> None:
        self.on_ended: list[Callable[[Job], None]] = []
        self._jobs: dict[str, Job] = {}
        self._running: dict[str, Job] = {}
        self._numbers = itertools.count(1)

    def begin(
        self,
        vehicle: Any,
        verb: str,
        request: Mapping[str, Any],
        body: Callable[[Job], Awaitable[str]],
        *,
        client: str = CONSOLE,
        outlives_client: bool = False,
        timeout: float | None = None,
    ) -> Job:
        """Start a job for `vehicle`, or join the running one that does exactly the same."""
        running = self.running_for(vehicle, verb, request)
        if running is not None:
            return running
        job = Job(next(self._numbers), verb, request, vehicle, client=client, outlives_client=outlives_client)
        self._jobs[job.id] = self._running[job.id] = job
        job.when_ended(lambda: self._ended(job))
        self._forget_old()
        with noting_sent_unless_noted() as job.sent:
            job.start(body, timeout)
        return job

    def running_for(self, vehicle: Any, verb: str, request: Mapping[str, Any]) -> Job | None:
        """The running job that does exactly that for `vehicle`; None if there is none."""
        return next((job for job in self.running() if job.vehicle is vehicle and job.is_for(verb, request)), None)

    def _ended(self, job: Job) -> None:
        del self._running[job.id]
        for callback in self.on_ended:
            callback(job)

    def get(self, number: str) -> Job | None:
        """The job of that number; None when there is none, or it is forgotten."""
        return self._jobs.get(number)

    def all(self) -> list[Job]:
        """The running jobs and the last ones that ended, oldest first."""
        return list(self._jobs.values())

    def running(self) -> list[Job]:
        """The jobs without an outcome, oldest first."""
        return list(self._running.values())

    def abort_remote(self, reason: str) -> None:
        """End every running job that came over the network; what protects a vehicle goes on."""
        for job in self.running():
            if job.client != CONSOLE and not job.protects:
                job.abort(Aborted(f"{job.verb}: {reason}"), Ending.UNLOADED)

    def _forget_old(self) -> None:
        while len(self._jobs) - len(self._running) > FINISHED_KEPT:
            del self._jobs[next(number for number in self._jobs if number not in self._running)]
