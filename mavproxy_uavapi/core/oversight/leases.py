"""Leases: who has a vehicle, and whether he is still there.

A client promises to call again within so many seconds; else its vehicle does what `on_lease_end` says. An operator's
lease is a hold, too: others of the same or a lower role do not command the vehicle meanwhile, but may stop it. Each
call of the client, or of the operator, renews it. The prompt's hold has no end. A lease is of a system id: it stays
when the vehicle's type changes.

MAVProxy's own heartbeats keep the autopilot's ground station failsafe quiet, so nobody else notices a remote program
that died, or whose network did.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable
from dataclasses import dataclass

from mavproxy_uavapi.core.control.jobs import Ending, Job
from mavproxy_uavapi.core.errors import Aborted, Busy, Superseded
from mavproxy_uavapi.core.oversight.endings import FlightEndings, Situation, situation
from mavproxy_uavapi.core.roles import THE_PROMPT, Operator
from mavproxy_uavapi.core.telemetry.link_watch import LinkWatch
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle

log = logging.getLogger("uavapi.copter")

LINK_PAUSE = 0.2  # s between two checks for a heartbeat after a lease has run out
Key = tuple[int, bool]  # the system id, and whether it is a hold


@dataclass
class Lease:
    """A vehicle's lease.

    Attributes:
        holder: the name of the client or the operator.
        seconds: its length; infinite for the prompt's hold.
        ends_at: when it runs out without a call (s, on the clock of arrivals).
        operator: who holds the vehicle by it; None for a client's lease.
    """

    holder: str
    seconds: float
    ends_at: float
    operator: Operator | None = None

    def covers(self, job: Job | None) -> bool:
        """Whether `job` is for its holder."""
        return job is not None and self.holder == (job.holder if self.operator is None else job.operator)

    def remaining(self, now: float) -> float | None:
        """Seconds that are left of it; None where it has no end."""
        return None if math.isinf(self.ends_at) else max(self.ends_at - now, 0.0)


class Leases:
    """The leases of all vehicles: one of a client each, who asked last, and one hold. Asyncio thread only.

    Args:
        endings: applies `on_lease_end`.
        link_watch: knows which vehicles hear us.
        clock: monotonic seconds.
        loop: where the timers run.
        announce: told each end of a client's lease: the kind of the event, the system id, a sentence.
        note: told likewise whatever else becomes of leases and holds.
        find: gives the vehicle of a system id.
    """

    def __init__(
        self,
        endings: FlightEndings,
        link_watch: LinkWatch,
        clock: Callable[[], float],
        loop: asyncio.AbstractEventLoop,
        announce: Callable[[str, int, str], None],
        *,
        note: Callable[[str, int, str], None],
        find: Callable[[int], Vehicle],
    ) -> None:
        self._endings = endings
        self._link_watch = link_watch
        self._clock = clock
        self._loop = loop
        self._announce, self._note = announce, note
        self._find = find
        self._leases: dict[Key, Lease] = {}
        self._timers: dict[Key, asyncio.TimerHandle] = {}

    def of(self, vehicle: Vehicle) -> Lease | None:
        """The client's lease of a vehicle; None where there is none."""
        return self._leases.get((vehicle.state.system, False))

    def hold(self, vehicle: Vehicle) -> Lease | None:
        """The lease of the operator who holds the vehicle; None if nobody does."""
        lease = self._leases.get((vehicle.state.system, True))
        return lease if lease is not None and lease.ends_at > self._clock() else None

    # -- clients ------------------------------------------------------------------------------------------

    def take(self, vehicle: Vehicle, holder: str, seconds: float) -> None:
        """Begin, or lengthen or shorten, a client's lease of a vehicle; 0 s gives it back."""
        before, system = self.of(vehicle), vehicle.state.system
        if seconds <= 0 and before is not None:
            self._note("lease", system, f"{holder} gives its lease of vehicle {system} back")
        elif seconds > 0 and (before is None or before.holder != holder):
            self._note("lease", system, f"{holder} has vehicle {system} until {seconds:g} s pass without a call")
        self._set((vehicle.state.system, False), Lease(holder, seconds, self._clock() + seconds))

    def ask(self, job: Job, holder: str, seconds: float) -> None:
        """As `take` once a client's job commands; a refused call changes no lease.

        The lease of another client is left alone, unless this one has the flight.
        """

        def begun() -> None:
            lease, authority = self.of(job.vehicle), job.vehicle.authority
            flights = [flight for flight in (authority.commander, authority.interrupted) if flight is not None]
            has_flight = seconds > 0 and holder in [flight.holder for flight in flights]
            if lease is None or lease.holder == holder or has_flight:
                self.take(job.vehicle, holder, seconds)

        job.when_commanding(begun)

    def renew(self, client: str, operator: Operator | None = None) -> None:
        """A call of that client, by that operator, arrived."""
        for lease in self._leases.values():
            caller = client if lease.operator is None else operator and operator.name
            if lease.holder == caller:
                lease.ends_at = self._clock() + lease.seconds

    # -- operators ----------------------------------------------------------------------------------------

    def require(self, vehicle: Vehicle, operator: Operator) -> None:
        """Raise Busy if somebody else of the same or a higher role holds the vehicle."""
        holder = self._other_holder(vehicle, operator)
        if holder is not None and operator.role <= holder.role:
            raise Busy(
                f"{holder.name} holds vehicle {vehicle.state.system}; others may stop it (stop, brake, land, rtl)"
            )

    def take_hold(self, vehicle: Vehicle, operator: Operator, seconds: float) -> None:
        """Make that operator the holder, until so many s have passed without a call; nothing is sent.

        Raises:
            Busy: somebody else holds it, from whom only an admin or the prompt may take it.
        """
        holder = self._other_holder(vehicle, operator)
        if holder is not None and not operator.takes_from(holder):
            raise Busy(f"{holder.name} holds vehicle {vehicle.state.system}; only an admin or the prompt takes it")
        commander = vehicle.authority.commander
        if commander is not None and commander.operator != operator.name:
            vehicle.repeat_nothing()
        before, system = self.hold(vehicle), vehicle.state.system
        if before is None or before.holder != operator.name:
            self._note("authority", system, f"{operator.name} takes vehicle {system}")
        length = math.inf if operator == THE_PROMPT else seconds
        self._set((vehicle.state.system, True), Lease(operator.name, length, self._clock() + length, operator))

    def release_hold(self, vehicle: Vehicle, operator: Operator) -> bool:
        """End the operator's hold, or that of somebody from whom the operator may take; nothing is sent.

        Returns:
            Whether there was one.

        Raises:
            Busy: somebody else holds it.
        """
        if self.hold(vehicle) is None:
            return False
        holder = self._other_holder(vehicle, operator)
        if holder is not None and not operator.takes_from(holder):
            raise Busy(f"{holder.name} holds vehicle {vehicle.state.system}")
        self._forget((vehicle.state.system, True))
        self._note("authority", vehicle.state.system, f"{operator.name} releases vehicle {vehicle.state.system}")
        return True

    def _other_holder(self, vehicle: Vehicle, operator: Operator) -> Operator | None:
        hold = self.hold(vehicle)
        return None if hold is None or hold.holder == operator.name else hold.operator

    # -- their end ----------------------------------------------------------------------------------------

    def close(self) -> None:
        """Forget them all."""
        for key in list(self._leases):
            self._forget(key)

    def _set(self, key: Key, lease: Lease) -> None:
        self._forget(key)
        if lease.seconds > 0:
            self._leases[key] = lease
            if math.isfinite(lease.seconds):
                self._timers[key] = self._loop.call_later(lease.seconds, self._look, key)

    def _forget(self, key: Key) -> None:
        self._leases.pop(key, None)
        timer = self._timers.pop(key, None)
        if timer is not None:
            timer.cancel()

    def _look(self, key: Key) -> None:
        """See whether the lease has run out; if so, apply the policy after the vehicle's next heartbeat."""
        lease, vehicle = self._leases[key], self._find(key[0])
        remaining = lease.ends_at - self._clock()
        heard = vehicle.state.heard_since(lease.ends_at) and self._link_watch.is_alive(vehicle.state)
        if remaining <= 0 and heard:
            self._forget(key)
            if lease.operator is not None:
                self._note("authority", key[0], f"{lease.holder} holds vehicle {key[0]} no longer: no call came")
            self._end(vehicle, lease)
        else:
            self._timers[key] = self._loop.call_later(max(remaining, LINK_PAUSE), self._look, key)

    def _end(self, vehicle: Vehicle, lease: Lease) -> None:
        commander, interrupted = vehicle.authority.commander, vehicle.authority.interrupted
        if commander is not None and interrupted is not None and not lease.covers(commander):
            if interrupted.running and lease.covers(interrupted):
                interrupted.abort(Superseded(f"{interrupted.verb}: another client stopped it, and its lease ran out"))
            return
        commander = vehicle.authority.flies or commander
        if commander is None or not lease.covers(commander):
            return  # somebody else commands by now
        if situation(vehicle, commander.modes) in (Situation.LAND, Situation.RTL):
            return  # its last command brings the vehicle down already
        why = f"the lease of {lease.holder} ran out"
        system = vehicle.state.system
        self._announce("lease", system, f"vehicle {system}: {why} ({lease.seconds:g} s without a call)")
        log.warning("vehicle %d: %s", vehicle.state.system, why)
        if commander.running and not commander.protects:
            commander.abort(Aborted(f"{commander.verb}: {why}"), Ending.LEASE_OVER)
        else:
            self._endings.apply_policy(
                vehicle, self._endings.on_lease_end, f"after {why}", lease.holder, commander.modes
            )
