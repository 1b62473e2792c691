"""A series of messages from one vehicle to us: the acks of a command, or the mission protocol."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from typing import Any, Generic, TypeVar

from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.link.link import Address
from mavproxy_uavapi.core.mainloop.listening import Listening
from mavproxy_uavapi.core.telemetry.pending_waits import Wait
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

T = TypeVar("T")


def is_to(message: Any, asker: Address) -> bool:
    """Whether a message is addressed to `asker` or to everybody; one without a target is for everybody."""
    system, component = getattr(message, "target_system", 0), getattr(message, "target_component", 0)
    return system in (0, asker.system) and component in (0, asker.component)


class MessageExchange(Generic[T]):
    """The values of an autopilot's messages to us, in order; several messages may arrive in one batch.

    Attributes:
        wait: to be registered while the exchange lasts.

    Args:
        state: the vehicle.
        asker: our address; messages to others do not count.
        names: message names that belong to the exchange.
        read: gives the value of a message, or None to ignore it; what it raises ends the exchange.
        listening: when messages are read.
    """

    def __init__(
        self,
        state: VehicleState,
        asker: Address,
        names: Collection[str],
        read: Callable[[Any], T | None],
        listening: Listening,
    ) -> None:
        self._listening = listening
        self._state = state
        self._asker = asker
        self._read = read
        self._values: asyncio.Queue[T | None] = asyncio.Queue()
        self.wait: Wait[Any] = Wait(state.system, names, self._catch)
        self.wait.on_settled = lambda: self._values.put_nowait(None)

    def _catch(self, message: Any) -> None:
        if message.get_srcComponent() == self._state.component and is_to(message, self._asker):
            value = self._read(message)
            if value is not None:
                self._values.put_nowait(value)

    async def next(self, timeout: float) -> T | None:
        """The value of the next message; None when none comes within `timeout` s.

        Raises:
            LinkLost: the vehicle's heartbeats stopped; also the errors of `read`.
        """
        try:
            value = await self._listening.wait(timeout, self._values.get)
        except asyncio.TimeoutError:
            return None
        if value is None:
            raise self.wait.error or LinkLost(f"vehicle {self._state.system} is gone")
        return value
