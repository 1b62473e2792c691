"""Whether a worker reaches what it needs."""

from __future__ import annotations

from typing import Any, Protocol

from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.inbox import Inbox


class Connection(Protocol):
    """A connection; `problem` says why there is none, and is empty while there is one."""

    problem: str


class Health:
    """Broker and database, as they were a second ago at most.

    Args:
        watch: asks the database once a second.
        inbox, broker: of a worker that consumes; None for one that does not.
    """

    def __init__(self, watch: FleetWatch, inbox: Inbox | None = None, broker: Connection | None = None) -> None:
        self._watch = watch
        self._inbox = inbox
        self._broker = broker

    @property
    def database(self) -> str:
        """What is wrong with the database; empty when nothing is."""
        return self._watch.problem

    @property
    def broker(self) -> str | None:
        """What is wrong with the broker; empty when nothing is, None when there is none."""
        return None if self._broker is None else self._broker.problem

    @property
    def waiting(self) -> int:
        """Messages that are not stored yet."""
        return 0 if self._inbox is None else len(self._inbox)

    @property
    def dropped(self) -> int:
        """Messages of former connections that the inbox had no room for."""
        return 0 if self._inbox is None else self._inbox.dropped

    @property
    def is_good(self) -> bool:
        """Whether nothing is wrong."""
        return not self.database and not self.broker

    def report(self) -> dict[str, Any]:
        """What `/health` says."""
        return {
            "status": "ok" if self.is_good else "failing",
            "database": self.database or "ok",
            "broker": "none" if self.broker is None else self.broker or "ok",
            "waiting": self.waiting,
        }
