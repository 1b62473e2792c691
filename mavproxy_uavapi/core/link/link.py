"""Sends MAVLink messages to vehicles; nothing else does."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

from mavproxy_uavapi.core.errors import LinkLost, UavApiError
from mavproxy_uavapi.core.mainloop.bridge import Bridge
from mavproxy_uavapi.core.sent_messages import note_sent


class Address(NamedTuple):
    """A MAVLink system id and component id."""

    system: int
    component: int


def is_finite(message: Any) -> bool:
    """Whether every number in a message is finite."""
    values = (getattr(message, name) for name in message.get_fieldnames())
    numbers = (number for value in values for number in (value if isinstance(value, list | tuple) else (value,)))
    return all(math.isfinite(number) for number in numbers if isinstance(number, float))


def require_finite(message: Any) -> None:
    """Raise UavApiError if a number in `message` is NaN or infinite: no autopilot must ever get one."""
    if not is_finite(message):
        raise UavApiError(f"not sent, because a number in it is not finite: {message}")


class Link(Protocol):
    """Sends messages to vehicles."""

    @property
    def source(self) -> Address:
        """Our address on the link; acknowledgements come back to it."""

    async def send(self, message: Any, system: int) -> None:
        """Send `message` by the best link to vehicle `system`; returns when it has been written.

        Raises:
            LinkLost: there is no link, or writing failed.
            UavApiError: a number in it is not finite; nothing is sent.
        """


class MavproxyLink:
    """Sends through MAVProxy's own links, in MAVProxy's main loop.

    Args:
        bridge: the way into the main loop.
        mpstate: MAVProxy's state; touched in the main loop only.
    """

    def __init__(self, bridge: Bridge, mpstate: Any) -> None:
        self._bridge = bridge
        self._mpstate = mpstate

    @property
    def source(self) -> Address:
        """MAVProxy's own address (its settings source_system and source_component)."""
        settings = self._mpstate.settings
        return Address(settings.source_system, settings.source_component)

    async def send(self, message: Any, system: int) -> None:
        """See `Link.send`."""
        require_finite(message)
        note_sent(message.get_type())
        await self._bridge.on_main(lambda: self.write(message, system))

    def write(self, message: Any, system: int) -> None:
        """Write `message` now. MAVProxy's main loop only.

        Raises:
            LinkLost: as `Link.send`.
        """
        master = self._mpstate.master(system)
        if master is None:
            raise LinkLost("MAVProxy has no link; add one with `link add`")
        try:
            master.mav.send(message)
        except OSError as error:
            raise LinkLost(f"MAVProxy could not write to its link: {error}") from error
