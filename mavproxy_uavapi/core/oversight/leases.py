"""Leases: a client promises to call again within so many seconds; else its vehicle does what `on_lease_end` says.

MAVProxy's own heartbeats keep the autopilot's ground station failsafe quiet, so nobody else notices a remote program
that died, or whose network did.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass

from mavproxy_uavapi.core.control.jobs import Ending, Job
from mavproxy_uavapi.core.errors import Aborted, Superseded
from mavproxy_uavapi.core.oversight.endings import FlightEndings, Situation, situation
from mavproxy_uavapi.core.telemetry.link_watch import LinkWatch
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

log = logging.getLogger("uavapi.copter")

LINK_PAUSE = 0.2  # s between two checks for a heartbeat after a lease has run out


@dataclass
class Lease:
    """One client's lease of one vehicle: its length, and when it runs out (s, on the clock of arrivals)."""

    holder: str
    seconds: float
    ends_at: float


def client_of(job: Job) -> str:
    """The client that a job is for."""
    return job.holder


def operator_of(job: Job) -> str:
    """The operator that a job is for."""
    return job.operator


class Leases:
    """The leases by vehicle; one each, that of the client who asked last. Asyncio thread only.

    Args:
        endings: sees to vehicles, by its `on_lease_end`.
        link_watch: knows which hear us.
        clock: monotonic seconds.
        loop: where the timers run.
        say: told each end in a sentence.
        whose: gives the name under which a job's client has leases.
    """

    def __init__(
        self,
        endings: FlightEndings,
        link_watch: LinkWatch,
        clock: Callable[[], float],
        loop: asyncio.AbstractEventLoop,
        say: Callable[[str], None],
        *,
        whose: Callable[[Job], str] = client_of,
    ) -> None:
        self._endings = endings
        self._link_watch = link_watch
        self._clock = clock
        self._loop = loop
        self._say = say
        self._whose = whose
        self._leases: dict[Vehicle, Lease] = {}
        self._timers: dict[Vehicle, asyncio.TimerHandle] = {}

    def of(self, vehicle: Vehicle) -> Lease | None:
        """The lease of a vehicle; None where there is none."""
        return self._leases.get(vehicle)

    def take(self, vehicle: Vehicle, holder: str, seconds: float) -> None:
        """Begin, or lengthen or shorten, a client's lease of a vehicle; 0 s gives it back."""
        self._forget(vehicle)
        if seconds > 0:
            self._leases[vehicle] = Lease(holder, seconds, self._clock() + seconds)
            self._timers[vehicle] = self._loop.call_later(seconds, self._look, vehicle)

    def ask(self, job: Job, holder: str, seconds: float) -> None:
        """As `take` once a client's job commands; a refused call changes no lease.

        The lease of another client is left alone, unless this one has the flight.
        """

        def begun() -> None:
            lease, authority = self.of(job.vehicle), job.vehicle.authority
            flights = [flight for flight in (authority.commander, authority.interrupted) if flight is not None]
            has_flight = seconds > 0 and holder in map(self._whose, flights)
            if lease is None or lease.holder == holder or has_flight:
                self.take(job.vehicle, holder, seconds)

        job.when_commanding(begun)

    def renew(self, holder: str) -> None:
        """A call of that client arrived."""
        for lease in self._leases.values():
            if lease.holder == holder:
                lease.ends_at = self._clock() + lease.seconds

    def move(self, before: Vehicle, now: Vehicle) -> None:
        """Keep the lease of a vehicle that is another object now, because its type has changed."""
        lease = self._leases.get(before)
        if lease is not None:
            self._forget(before)
            self._leases[now] = lease
            self._timers[now] = self._loop.call_later(max(lease.ends_at - self._clock(), 0.0), self._look, now)

    def close(self) -> None:
        """Forget them all."""
        for vehicle in list(self._leases):
            self._forget(vehicle)

    def _forget(self, vehicle: Vehicle) -> None:
        self._leases.pop(vehicle, None)
        timer = self._timers.pop(vehicle, None)
        if timer is not None:
            timer.cancel()

    def _look(self, vehicle: Vehicle) -> None:
        """See whether the lease has run out; if so, see to the vehicle after its next heartbeat."""
        lease = self._leases[vehicle]
        remaining = lease.ends_at - self._clock()
        heard = vehicle.state.heartbeat_at > lease.ends_at and self._link_watch.is_alive(vehicle.state)
        if remaining <= 0 and heard:
            self._forget(vehicle)
            self._end(vehicle, lease)
        else:
            self._timers[vehicle] = self._loop.call_later(max(remaining, LINK_PAUSE), self._look, vehicle)

    def _end(self, vehicle: Vehicle, lease: Lease) -> None:
        commander, interrupted = vehicle.authority.commander, vehicle.authority.interrupted
        if commander is not None and interrupted is not None and self._whose(commander) != lease.holder:
            if interrupted.running and self._whose(interrupted) == lease.holder:
                interrupted.abort(Superseded(f"{interrupted.verb}: another client stopped it, and its lease ran out"))
            return
        commander = vehicle.authority.flies or commander
        if commander is None or self._whose(commander) != lease.holder:
            return  # somebody else commands by now
        if situation(vehicle, commander.modes) in (Situation.LAND, Situation.RTL):
            return  # its last command brings the vehicle down already
        why = f"the lease of {lease.holder} ran out"
        self._say(f"vehicle {vehicle.state.system}: {why} ({lease.seconds:g} s without a call)")
        log.warning("vehicle %d: %s", vehicle.state.system, why)
        if commander.running and not commander.protects:
            commander.abort(Aborted(f"{commander.verb}: {why}"), Ending.LEASE_OVER)
        else:
            self._endings.see_to(vehicle, self._endings.on_lease_end, f"after {why}", lease.holder, commander.modes)
