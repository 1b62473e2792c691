"""One host per MAVProxy: whichever of our modules loads first makes it, the last to unload ends it."""

from __future__ import annotations

import asyncio
import contextlib
import select
import time
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.store import OPERATOR, Envelopes, missing
from mavproxy_uavapi.core.audit import Audit, Entry, utc_at, utc_now
from mavproxy_uavapi.core.control.jobs import Job, JobBook
from mavproxy_uavapi.core.errors import LinkLost, UavApiError
from mavproxy_uavapi.core.geotag import Geotag, geotag_of, report_of, tagged
from mavproxy_uavapi.core.link.link import Link, MavproxyLink
from mavproxy_uavapi.core.mainloop.bridge import Bridge
from mavproxy_uavapi.core.mavproxy_watch import MavproxyWatch
from mavproxy_uavapi.core.mission.mission_watch import MissionWatch
from mavproxy_uavapi.core.oversight.endings import FlightEndings
from mavproxy_uavapi.core.oversight.envelope_watch import EnvelopeWatch
from mavproxy_uavapi.core.oversight.history import VehicleHistory
from mavproxy_uavapi.core.oversight.leases import Leases
from mavproxy_uavapi.core.telemetry.link_watch import LinkWatch
from mavproxy_uavapi.core.telemetry.pending_waits import PendingWaits
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState
from mavproxy_uavapi.core.telemetry.vehicle_states import VehicleStates
from mavproxy_uavapi.core.terminal import alarm
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry

ATTRIBUTE = "uavapi_host"  # attribute of MAVProxy's state, so that a reloaded module finds it


class Host:
    """What our modules share: bridge, link, fleet, waits, the vehicles and the jobs that fly them.

    Everything except `bridge` belongs to the asyncio thread.

    Attributes:
        audit: the trail of commands and events.
        history: adds to it what happens to the vehicles, and knows why a flight ended.
        envelopes: where vehicles may fly.
        leases: which clients and operators have vehicles, and for how long they count as present without a call.
        envelope_watch: stops our vehicles before they leave their envelope.
        listeners: called with each vehicle message, after the state has taken it and the waits have seen it.
        observers: called with what happens besides: name, system id, s ago, and what; see `tell`.
        api_address: where `uavapi` listens; None while it does not.
        extensions: HTTP routes of the other modules, by path; `uavapi` serves them while it is loaded.
        commands: words after `uavapi` at the prompt that other modules serve.
        closing_messages: called before the host ends: the messages to be sent then, and the systems that they go to.
        newest_frame: gives the newest camera frame as JPEG, geotagged; None while no module has a camera.
        on_picture: called with each picture that was taken: system id, where and when, JPEG.
        missions: those that the vehicles were seen to have.
        mavproxy_watch: hands over what MAVProxy itself knows.

    Args:
        mpstate: MAVProxy's state.
        clock: monotonic seconds.
        link: sends messages, in place of MAVProxy's links.
        loop: an asyncio loop that the caller runs, in place of the host's own thread.
    """

    def __init__(
        self,
        mpstate: Any,
        clock: Callable[[], float] = time.monotonic,
        link: Link | None = None,
        loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        self.clock = clock
        self.fleet = VehicleStates()
        self.bridge = Bridge(mpstate.select_extra, self._receive, loop)
        self.pending = PendingWaits(self.bridge.listening)
        self.bridge.links_have_unread = self._links_have_unread
        self._mavproxy_link = MavproxyLink(self.bridge, mpstate)
        self.link = link or self._mavproxy_link
        self.link_watch = LinkWatch(self.pending, self.bridge.listening.seconds, self.bridge.loop)
        self.envelopes = Envelopes()
        self.registry = VehicleRegistry(
            self.fleet, self.link, self.link_watch, self.pending, clock, envelopes=self.envelopes
        )
        self.audit = Audit(log_directory(mpstate))
        self.audit.on_added.append(lambda entry: self.tell("history", entry.system, entry.report()))
        self.history = VehicleHistory(self.registry, clock, self.bridge.loop, self.note, self.utc)
        self.link_watch.on_change = self.history.take_link
        self.jobs = JobBook()
        self.jobs.on_ended += [self.history.explain, self._leave_trace]
        self.endings = FlightEndings(self.jobs)
        self.leases = Leases(
            self.endings,
            self.link_watch,
            clock,
            self.bridge.loop,
            self.announce,
            note=self.note,
            find=self.registry.find,
        )
        self.envelope_watch = EnvelopeWatch(self.registry, self.jobs, self.envelopes, self.announce)
        self.listeners: list[Callable[[VehicleState, Any, float], None]] = []
        self.observers: list[Callable[[str, int, float, Mapping[str, Any]], None]] = []
        self.extensions: dict[str, Any] = {}
        self.commands: dict[str, Callable[[list[str]], None]] = {}
        self.newest_frame: Callable[[], Awaitable[bytes]] | None = None
        self.on_picture: list[Callable[[int, Geotag, bytes], None]] = []
        self.missions = MissionWatch()
        self.api_address: tuple[str, int] | None = None
        self.members: list[Any] = []
        self.closing_messages: list[Callable[[], list[tuple[Any, int]]]] = [
            self.endings.closing_messages,
            self.envelope_watch.closing_messages,
        ]
        self._mpstate = mpstate
        self._doubled: set[int] = set()  # systems with two autopilots
        self._unsent: deque[tuple[Any, int]] = deque()
        self.mavproxy_watch = MavproxyWatch(
            mpstate,
            self.bridge,
            registry=self.registry,
            fleet=self.fleet,
            envelopes=self.envelopes,
            missions=self.missions,
            take_fences=self._take_fences,
        )

    @property
    def mavlink_ports(self) -> list[int]:
        """The ports of MAVProxy's links and outputs: where another program would find the vehicles."""
        ends = [str(getattr(link, "address", "")) for link in (*self._mpstate.mav_master, *self._mpstate.mav_outputs)]
        ports = {end.rpartition(":")[2] for end in ends if ":" in end}
        return sorted(int(port) for port in ports if port.isdecimal())

    # -- MAVProxy's main loop ---------------------------------------------------------------------------

    def feed(self, member: Any, message: Any) -> None:
        """Hand a message over; of several loaded modules only the first one does."""
        if self.members[:1] == [member]:
            self.bridge.feed(message)

    def idle(self, member: Any) -> None:
        """MAVProxy's idle task: start at the first call, then send what is queued.

        MAVProxy calls it a hundred times a second and more. At rest these calls are most of what we cost.
        """
        if self.members[:1] != [member]:
            return
        looks = self.mavproxy_watch.is_due()
        if looks and not self.bridge.running:
            self.bridge.start()
        self.mavproxy_watch.share_target()
        self.bridge.turn()
        if looks:  # last: whatever fails there, vehicles are heard and commands go out
            self.mavproxy_watch.look()

    def _links_have_unread(self) -> bool:
        """Whether something came on one of MAVProxy's links that it has not read yet."""
        descriptors = [getattr(master, "fd", None) for master in self._mpstate.mav_master]
        present = [fd for fd in descriptors if isinstance(fd, int) and fd >= 0]
        try:
            return bool(select.select(present, [], [], 0)[0])
        except (OSError, ValueError):  # one was closed just now: nothing more comes from it
            return False

    def end(self) -> None:
        """Send the closing messages, and end the asyncio thread and all that it kept open.

        MAVProxy's main loop waits for us, or has ended, and sends nothing. So this thread sends, only here.
        """

        async def collect() -> list[tuple[Any, int]]:
            self.history.close()
            self.leases.close()
            await self.envelope_watch.close()
            return [message for messages in self.closing_messages for message in messages()]

        try:
            if self.bridge.running:
                for message, system in self.bridge.run(collect()):
                    self._write(message, system)
                self._send_unsent()
        finally:
            self.mavproxy_watch.release()
            self.bridge.stop()
            self.audit.close()

    def _send_unsent(self) -> None:
        while self._unsent:
            self._write(*self._unsent.popleft())

    def _write(self, message: Any, system: int) -> None:
        with contextlib.suppress(LinkLost):  # the vehicle does not hear us
            self._mavproxy_link.write(message, system)

    # -- the asyncio thread -----------------------------------------------------------------------------

    def _receive(self, message: Any, came_after: float | None = None) -> None:
        now = self.clock()
        state = self.fleet.update(message, now, came_after)
        if state is None:
            return
        self.pending.feed(state.system, message.get_type(), message)
        self.link_watch.watch(state)
        if message.get_type() == "HEARTBEAT":
            self._look_for_second(state, now)
        self.history.listen(state, message)
        self.envelope_watch.listen(state, message)
        self.missions.listen(state.system, message)
        for listener in list(self.listeners):
            listener(state, message, now)

    def _look_for_second(self, state: VehicleState, now: float) -> None:
        """Say it once if a second autopilot with the same system id comes, or goes."""
        if state.are_two(now) == (state.system in self._doubled):
            return
        self._doubled ^= {state.system}
        are_two = state.system in self._doubled
        self.announce(
            "link",
            state.system,
            f"two autopilots have the system id {state.system}: nothing is sent to them until there is one"
            if are_two
            else f"vehicle {state.system} is alone on its system id again",
        )
        self.tell("second_autopilot", state.system, {"present": are_two})

    def tell(self, name: str, system: int, info: Mapping[str, Any]) -> None:
        """Tell the observers that something has happened; the asyncio thread only."""
        for observer in list(self.observers):
            observer(name, system, 0.0, info)

    def geotagged(self, system: int, jpeg: bytes, at: float, *, is_taken: bool = True) -> bytes:
        """A picture with where and when it was taken in its EXIF.

        Args:
            system: the vehicle with the camera.
            jpeg: the picture.
            at: when it was taken, s on the clock.
            is_taken: whether somebody took it on purpose: then the flight's record has it, too.
        """
        state, utc = self.fleet.vehicles.get(system), time.time() - (self.clock() - at)
        knows = state is not None and self.registry.find(system).has_position
        tag = geotag_of(state, at, utc) if state is not None and knows else Geotag(utc)
        picture = tagged(jpeg, tag)
        if is_taken:
            self.tell("picture", system, report_of(tag))
            for take in self.on_picture:
                take(system, tag, picture)
        return picture

    def _take_fences(self, fences: dict[int, list[Any]]) -> None:
        for system, items in fences.items():
            source = f"the fence of vehicle {system}"
            try:
                self.envelopes.put(OPERATOR, system, formats.of_fence(items, source, partial(self.home_of, system)))
            except UavApiError as error:
                self.envelopes.put(OPERATOR, system, missing(f"{source}: {error}", source, is_own=True))
                self.warn(f"{source} cannot be its envelope: {error}")

    def note_fence(self, system: int, fence: list[Any]) -> None:
        """Take a fence that we have put into a vehicle, as MISSION_ITEM_INTs; it may be the vehicle's envelope."""
        if self.envelopes.expects_fences:
            self._take_fences({system: fence})
        self.bridge.post(lambda: self.mavproxy_watch.note_fence(system, fence))

    def send_unwaited(self, messages: list[tuple[Any, int]]) -> None:
        """Send messages, each to a system, when MAVProxy's main loop comes to it, or when the host ends."""
        self._unsent.extend(messages)
        self.bridge.post(self._send_unsent)

    def home_of(self, system: int) -> tuple[float, float] | None:
        """Latitude and longitude of a vehicle's home, degrees; None while it is unknown."""
        state = self.fleet.vehicles.get(system)
        home = None if state is None else state.home
        return None if home is None else home.place

    def warn(self, sentence: str) -> None:
        """Print a sentence at the prompt, loudly. Any thread."""
        self.bridge.post(lambda: alarm(sentence))

    def announce(self, kind: str, system: int, sentence: str) -> None:
        """Print a sentence about a vehicle at the prompt, loudly, and add it to the trail; see `note`."""
        self.warn(sentence)
        self.note(kind, system, sentence)

    def note(self, kind: str, system: int, sentence: str, *, ago: float = 0.0, **info: Any) -> None:
        """Add an event of a vehicle to the trail; the asyncio thread only.

        Args:
            kind: one of `audit.KINDS`.
            system: the vehicle's system id.
            sentence: what happened, for a pilot.
            ago: how long ago (s).
            info: what else is known of it.
        """
        self.audit.add(Entry(utc_at(time.time() - ago), system=system, detail=sentence, kind=kind, info=info))

    def utc(self, at: float) -> str:
        """UTC, ISO 8601, of a time on the clock."""
        return utc_at(time.time() - (self.clock() - at))

    def _leave_trace(self, job: Job) -> None:
        """Write a job that ended to the trail when it is known why, unless the HTTP call that began it does."""
        if job.sent is not None:
            job.when_told(lambda: self._trace(job))

    def _trace(self, job: Job) -> None:
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
            sent=job.sent.summary(),
            script=job.script or "",
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
