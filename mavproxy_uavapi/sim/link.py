"""One MAVLink link of the vehicle: its stream rates, its sequence numbers and what waits to be sent."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .streams import GROUPS, Groups, Streams

COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1


class PeerLink:
    """Messages for one peer; the owner of the socket takes them with `drain` or `messages`.

    While muted() is true what is to be sent is lost, as on a link that is down.
    """

    def __init__(
        self, system: int, name: str = "", muted: Callable[[], bool] = lambda: False, groups: Groups = GROUPS
    ) -> None:
        self._groups = groups
        self.name = name
        self._muted = muted
        self.streams = Streams(self._groups)
        self.parameter_cursor: int | None = None
        """Next index of a running PARAM_REQUEST_LIST, or None."""
        self._source = (system, COMPONENT)
        self._encoder = mavlink.MAVLink(None)
        self._outbox: list[tuple[Any, tuple[int, int] | None]] = []

    def restart(self) -> None:
        """The vehicle has booted: streams are back to heartbeats only."""
        self.streams = Streams(self._groups)
        self.parameter_cursor = None

    def send(self, message: Any, source: tuple[int, int] | None = None) -> None:
        """Queue a message; source makes it come from another system and component."""
        if self._muted():
            self.lose()
        else:
            self._outbox.append((message, source))

    def lose(self) -> None:
        """A message of the vehicle's is lost on its way: the peer sees that its number is missing."""
        self._encoder.seq = (self._encoder.seq + 1) % 256

    def messages(self) -> list[Any]:
        """Take what is queued as messages."""
        queued, self._outbox = self._outbox, []
        return [message for message, _ in queued]

    def drain(self) -> bytes:
        """Take what is queued as bytes."""
        if not self._outbox:
            return b""
        queued, self._outbox = self._outbox, []
        return b"".join(self._pack(message, source) for message, source in queued)

    def _pack(self, message: Any, source: tuple[int, int] | None) -> bytes:
        encoder = self._encoder
        encoder.srcSystem, encoder.srcComponent = source or self._source
        data = bytes(message.pack(encoder))
        encoder.seq = (encoder.seq + 1) % 256
        return data
