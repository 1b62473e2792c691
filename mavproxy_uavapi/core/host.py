"""One host per MAVProxy: whichever of our modules loads first makes it, the last to unload ends it."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.audit import Audit, Entry, utc_now
from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.mainloop.bridge import Bridge
from mavproxy_uavapi.core.mavlink.link import Link, MavproxyLink
from mavproxy_uavapi.core.mavlink.link_watch import LinkWatch
from mavproxy_uavapi.core.mavlink.parameter_watch import ParameterWatch
from mavproxy_uavapi.core.mavlink.pending_waits import PendingWaits
from mavproxy_uavapi.core.mavlink.vehicle_state import Fleet, VehicleState
from mavproxy_uavapi.core.vehicle.endings import FlightEndings
from mavproxy_uavapi.core.vehicle.jobs import Job, JobBook
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry

ATTRIBUTE = "uavapi_host"  # on MAVProxy's state, so that a module loaded anew finds it


class Host:
    """What our modules share: bridge, link, fleet, waits, the vehicles and the jobs that fly them.

    Everything except `bridge` belongs to the asyncio thread.

    Attributes:
        audit: the trail of commands.
        listeners: called with each vehicle message, after the state has taken it and the waits have seen it.
        api_address: where `uavapi` listens; None while it does not.
        extensions: HTTP routes of the other modules, by path; `uavapi` serves them while it is loaded.
        commands: words after `uavapi` at the prompt that other modules serve.
        last_words: called before the host ends: the messages to be sent then, and the systems that they go to.
        newest_frame: gives the newest camera frame as JPEG; None while no module has a camera.

    Args:
        mpstate: MAVProxy's state.
        clock: monotonic seconds.
        link: sends messages, in place of MAVProxy's links.
        loop: an asyncio loop that somebody else runs, in place of the host's own thread.
    """

    def __init__(
        self,
        mpstate: Any,
        clock: Callable[[], float] = time.monotonic,
        link: Link | None = None,
        loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        self.clock = clock
        self.fleet = Fleet()
        self.pending = PendingWaits()
        self.bridge = Bridge(mpstate.select_extra, self._receive, loop)
        self._mavproxy_link = MavproxyLink(self.bridge, mpstate)
        self.link = link or self._mavproxy_link
        self.link_watch = LinkWatch(self.pending, clock, self.bridge.loop)
        self.registry = VehicleRegistry(self.fleet, self.link, self.link_watch, self.pending, clock)
        self.audit = Audit(log_directory(mpstate))
        self.jobs = JobBook()
        self.jobs.on_ended.append(self._leave_trace)
        self.endings = FlightEndings(self.jobs)
        self.listeners: list[Callable[[VehicleState, Any, float], None]] = []
        self.extensions: dict[str, Any] = {}
        self.commands: dict[str, Callable[[list[str]], None]] = {}
        self.newest_frame: Callable[[], Awaitable[bytes]] | None = None
        self.api_address: tuple[str, int] | None = None
        self.members: list[Any] = []
        self.last_words: list[Callable[[], list[tuple[Any, int]]]] = [self.endings.last_words]
        self._mpstate = mpstate
        self._told_target = 0
        self._parameters = ParameterWatch()

    # -- MAVProxy's main loop ---------------------------------------------------------------------------

    def feed(self, member: Any, message: Any) -> None:
        """Hand a message over; of several loaded modules only the first one does."""
        if self.members[:1] == [member]:
            self.bridge.feed(message)

    def idle(self, member: Any) -> None:
        """MAVProxy's idle task: start at the first call, then send what is queued."""
        if self.members[:1] != [member]:
            return
        if not self.bridge.running:
            self.bridge.start()
        target = self._mpstate.settings.target_system
        if target != self._told_target:
            self._told_target = target
            self.bridge.call_soon(setattr, self.registry, "current", target)
        self._tell_parameters()
        self.bridge.turn()

    def end(self) -> None:
        """Send the last words, and end the asyncio thread.

        MAVProxy's main loop waits for us, or has ended, and sends nothing. So this thread sends, only here.
        """

        async def collect() -> list[tuple[Any, int]]:
            return [word for words in self.last_words for word in words()]

        if self.bridge.running:
            for message, system in self.bridge.run(collect()):
                with contextlib.suppress(LinkLost):  # there is nobody to hear us
                    self._mavproxy_link.write(message, system)
        self.bridge.stop()

    def _tell_parameters(self) -> None:
        """Hand over the parameters that MAVProxy has learnt, in order with the messages: a later PARAM_VALUE wins.

        With `--continue` MAVProxy's tables hold a file of an earlier session, not the vehicle's own values.
        """
        if self._mpstate.continue_mode:
            return
        changes = self._parameters.changes(self._mpstate.mav_param_by_sysid, self.clock())
        if changes:
            self.bridge.feed_call(lambda: self.fleet.learn(changes))

    # -- the asyncio thread -----------------------------------------------------------------------------

    def _receive(self, message: Any) -> None:
        now = self.clock()
        state = self.fleet.update(message, now)
        if state is None:
            return
        self.pending.feed(state.system, message.get_type(), message)
        self.link_watch.watch(state)
        for listener in list(self.listeners):
            listener(state, message, now)

    def _leave_trace(self, job: Job) -> None:
        """Write a job that ended to the trail, unless the HTTP call that began it does."""
        if job.sent is None or job.ended_at is None:
            return
        entry = Entry(
            time=utc_now(),
            client=job.client,
            verb=job.verb,
            request=job.request,
            system=job.vehicle.state.system,
            outcome="ok" if job.error is None else job.error.code,
            detail=(job.result or "") if job.error is None else str(job.error),
            seconds=round(job.ended_at - job.began_at, 3),
            sent=job.sent.tell(),
        )
        self.audit.add(entry)


def log_directory(mpstate: Any) -> Path | None:
    """Where MAVProxy keeps its logs; None when it keeps none (--no-state)."""
    directory = mpstate.status.logdir
    return None if directory is None else Path(directory)


def join(mpstate: Any, member: Any) -> Host:
    """The host of this MAVProxy, made if need be; `member` is the module that uses it."""
    host = getattr(mpstate, ATTRIBUTE, None)
    if host is None:
        host = Host(mpstate)
        setattr(mpstate, ATTRIBUTE, host)
    host.members.append(member)
    return host


def leave(mpstate: Any, member: Any) -> None:
    """Give the host back; the last one ends it."""
    host: Host = getattr(mpstate, ATTRIBUTE)
    host.members.remove(member)
    if not host.members:
        delattr(mpstate, ATTRIBUTE)
        host.end()
        host.audit.close()
