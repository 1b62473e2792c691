"""Something on its way to the clients of a stream; encoded once for all of them, and only when one reads it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from mavproxy_uavapi.http.contract.responses import dumps
from mavproxy_uavapi.http.contract.telemetry_views import fields


class When(NamedTuple):
    """When something arrived.

    Attributes:
        time: s since 1970; steps when the server's clock is set.
        clock: s of the server's monotonic clock: what tells how old it is, and, for a text, which one it is.
    """

    time: float
    clock: float


class Event:
    """Something on its way to its subscribers.

    Args:
        kind: `name` for a message, `view`, or `event`: the member of the JSON that holds the name.
        name: what it is called.
        system: of which vehicle; 0 for none.
        at: when it arrived.
        members: makes the rest of the JSON, at the first reader.
        component: of a message.

    Attributes:
        at: when it arrived.
    """

    def __init__(
        self,
        kind: str,
        name: str,
        system: int,
        at: When,
        members: Callable[[], Mapping[str, Any]],
        *,
        component: int = 0,
    ) -> None:
        self.kind, self.name, self.system, self.component = kind, name, system, component
        self.at, self._make = at, members
        self._encoded: tuple[int, bytes] | None = None
        self._made: Mapping[str, Any] | None = None  # no cached_property: that takes a lock each time
        self._text = ""

    def _members(self) -> str:
        if not self._text:
            time, clock = round(self.at.time, 3), round(self.at.clock, 3)
            head = {"system": self.system, self.kind: self.name, "time": time, "clock": clock}
            self._text = dumps({**head, **self._made_members()})[1:]
        return self._text

    def _made_members(self) -> Mapping[str, Any]:
        if self._made is None:
            self._made = self._make()
        return self._made

    @property
    def info(self) -> Mapping[str, Any]:
        """The payload of a view or an event."""
        return self._made_members()["info"]  # type: ignore[no-any-return]

    def json(self, dropped: int) -> str:
        """The event as JSON, for a client that has lost `dropped` events so far."""
        return f'{{"dropped": {dropped}, {self._members()}'

    def sse(self, dropped: int) -> bytes:
        """The same as a Server-Sent Event; encoded once for all who have lost as many."""
        if self._encoded is None or self._encoded[0] != dropped:
            self._encoded = dropped, f"event: {self.name}\ndata: {self.json(dropped)}\n\n".encode()
        return self._encoded[1]


def of_message(message: Any, at: When) -> Event:
    """A MAVLink message that arrived at `at`."""
    component = message.get_srcComponent()
    return Event(
        "name",
        message.get_type(),
        message.get_srcSystem(),
        at,
        lambda: {"component": component, "fields": fields(message)},
        component=component,
    )


def of_info(kind: str, name: str, system: int, at: When, info: Mapping[str, Any]) -> Event:
    """A view or an event whose payload is made already."""
    return Event(kind, name, system, at, lambda: {"info": info})
