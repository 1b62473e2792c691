"""Whether a worker reaches its broker and its database, and stores what comes."""

from __future__ import annotations

from typing import Any, Protocol

from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.inbox import Inbox
from mavproxy_gradys.station.intake import Intake
from mavproxy_uavapi.core.text import line_of

STALLED = 15.0  # s for which a batch waits; a database that restarts takes less


class BrokerState(Protocol):
    """A connection; `problem` is the reason while it is down, otherwise empty."""

    problem: str


class StationHealth:
    """The state of broker and database, at most a second old.

    Args:
        watch: queries the database once a second.
        intake: stores what comes.
        inbox, broker: of a worker that consumes messages; otherwise None.
    """

    def __init__(
        self, watch: FleetWatch, intake: Intake, inbox: Inbox | None = None, broker: BrokerState | None = None
    ) -> None:
        self._watch = watch
        self._intake = intake
        self._inbox = inbox
        self._broker = broker

    @property
    def database(self) -> str:
        """The database's problem; empty without one. It may answer, and yet store nothing."""
        if self._watch.problem or self.oldest < STALLED:
            return self._watch.problem
        why = f": {line_of(self._intake.problem)}" if self._intake.problem else ""
        return f"readings have waited for {self.oldest:.0f} s to be stored{why}"

    @property
    def oldest(self) -> float:
        """For how many s the oldest batch has waited to be stored."""
        return self._intake.oldest

    @property
    def broker(self) -> str | None:
        """The broker's problem; empty without one, None without a broker."""
        return None if self._broker is None else self._broker.problem

    @property
    def waiting(self) -> int:
        """The number of messages that are not stored yet."""
        return 0 if self._inbox is None else len(self._inbox)

    @property
    def dropped(self) -> int:
        """The number of messages of earlier connections that the inbox dropped."""
        return 0 if self._inbox is None else self._inbox.dropped

    @property
    def is_good(self) -> bool:
        """Whether there is no problem."""
        return not self.database and not self.broker

    def report(self) -> dict[str, Any]:
        """The body of `/health`."""
        return {
            "status": "ok" if self.is_good else "failing",
            "database": self.database or "ok",
            "broker": "none" if self.broker is None else self.broker or "ok",
            "waiting": self.waiting,
            "oldest_s": round(self.oldest, 1),
        }
