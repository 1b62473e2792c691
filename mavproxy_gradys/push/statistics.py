"""Counts updates and their outcomes, for each station and vehicle. Pure: the clock is an argument."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mavproxy_gradys.net.round_trips import RoundTrips
from mavproxy_gradys.net.schedule import Backoff


@dataclass
class VehicleTally:
    """One vehicle's updates to one station.

    Attributes:
        seq: number of the next update.
        sent: number of updates that were sent.
        acknowledged: those that the station answered with 200, `dropped` included.
        dropped: those that the station received but dropped (its type 101: no browser watches).
        failed: those without an acknowledgement.
        withheld: number of turns without a position to send.
        why_not: why the last turn sent nothing; empty if it sent an update.
        last_error: why the last failed update failed.
        acknowledged_at: when the newest acknowledgement arrived (s).
        backoff: the pauses after the station refused this vehicle.
    """

    backoff: Backoff
    seq: int = 0
    sent: int = 0
    acknowledged: int = 0
    dropped: int = 0
    failed: int = 0
    withheld: int = 0
    why_not: str = ""
    last_error: str = ""
    acknowledged_at: float | None = None

    def withhold(self, why: str) -> None:
        """Count a turn without a position to send."""
        self.withheld += 1
        self.why_not = why

    def answered(self, dropped: bool, now: float) -> None:
        """Count an acknowledgement."""
        self.seq += 1
        self.acknowledged += 1
        self.dropped += dropped
        self.acknowledged_at = now
        self.backoff.succeeded()

    def refused(self, why: str) -> None:
        """Count an update without an acknowledgement."""
        self.failed += 1
        self.last_error = why

    def report(self, now: float) -> dict[str, Any]:
        """The report for the status."""
        age = None if self.acknowledged_at is None else round(now - self.acknowledged_at, 3)
        return {
            "seq": self.seq,
            "sent": self.sent,
            "acknowledged": self.acknowledged,
            "dropped_by_station": self.dropped,
            "failed": self.failed,
            "withheld": self.withheld,
            "why_not": self.why_not or None,
            "last_error": self.last_error or None,
            "acknowledged_age_s": age,
        }


@dataclass
class StationTally:
    """The counts of one station; they outlive a stop and a start.

    Attributes:
        url: the station's URL.
        random: numbers from 0 to 1 for the pauses.
        vehicles: the tallies of the vehicles, by system id.
        round_trips: the times from an update to its answer.
        ip: our address in the form; empty before the first update.
        note: what is wrong with that address, for a pilot.
        last_error: why the newest failed update failed.
        last_error_at: when that was (s).
        backoff: the pauses after the station did not answer.
    """

    url: str
    random: Callable[[], float]
    vehicles: dict[int, VehicleTally] = field(default_factory=dict)
    round_trips: RoundTrips = field(default_factory=RoundTrips)
    ip: str = ""
    note: str = ""
    last_error: str = ""
    last_error_at: float = 0.0
    backoff: Backoff = field(init=False)

    def __post_init__(self) -> None:
        self.backoff = Backoff(self.random)

    def vehicle(self, system: int) -> VehicleTally:
        """The tally of one vehicle; created at its first update."""
        if system not in self.vehicles:
            self.vehicles[system] = VehicleTally(Backoff(self.random))
        return self.vehicles[system]

    def failed(self, why: str, now: float) -> None:
        """Note why an update failed."""
        self.last_error, self.last_error_at = why, now

    def total(self, name: str) -> int:
        """The sum of one count over the vehicles."""
        return sum(getattr(vehicle, name) for vehicle in self.vehicles.values())

    def report(self, now: float) -> dict[str, Any]:
        """The report for the status."""
        waits = self.backoff.waits(now)
        return {
            "station": self.url,
            "sent": self.total("sent"),
            "acknowledged": self.total("acknowledged"),
            "dropped_by_station": self.total("dropped"),
            "failed": self.total("failed"),
            "ip": self.ip or None,
            "note": self.note or None,
            "last_error": self.last_error or None,
            "last_error_age_s": round(now - self.last_error_at, 1) if self.last_error else None,
            "next_try_s": round(self.backoff.until - now, 1) if waits else None,
            "round_trip_ms": self.round_trips.summary(),
            "vehicles": {str(system): tally.report(now) for system, tally in sorted(self.vehicles.items())},
        }
