"""A link for tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mavproxy_uavapi.core.link.link import Address, require_finite
from mavproxy_uavapi.core.sent_messages import note_sent


class FakeLink:
    """Remembers what was sent, and lets a test answer it.

    Args:
        on_send: called with each message and the system it goes to.
    """

    source = Address(255, 230)

    def __init__(self, on_send: Callable[[Any, int], None] | None = None) -> None:
        self.sent: list[Any] = []
        self.on_send = on_send

    async def send(self, message: Any, system: int) -> None:
        """Remember `message` and tell the test."""
        require_finite(message)
        note_sent(message.get_type())
        self.sent.append(message)
        if self.on_send is not None:
            self.on_send(message, system)
