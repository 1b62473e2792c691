"""An exchange of several messages with one vehicle, such as the mission protocol's."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from types import TracebackType
from typing import Any

from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.mavlink.link import Address
from mavproxy_uavapi.core.mavlink.pending_waits import PendingWaits, Wait
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.core.timeout import wait_with_timeout


class MessageExchange:
    """What a vehicle's autopilot says to us, caught from entering to leaving the context.

    Args:
        state: the vehicle.
        asker: who we are; what is said to others does not count.
        pending: the host's waits.
        names: message names that belong to the exchange; each has a target.
    """

    def __init__(self, state: VehicleState, asker: Address, pending: PendingWaits, names: Collection[str]) -> None:
        self._state = state
        self._asker = asker
        self._pending = pending
        self._said: asyncio.Queue[Any] = asyncio.Queue()
        self._wait: Wait[Any] = Wait(state.system, names, self._catch)
        self._wait.on_settled = lambda: self._said.put_nowait(None)

    def __enter__(self) -> MessageExchange:
        self._pending.add(self._wait)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pending.discard(self._wait)

    def _catch(self, message: Any) -> None:
        system, component = self._asker
        to_us = message.target_system in (0, system) and message.target_component in (0, component)
        if to_us and message.get_srcComponent() == self._state.component:
            self._said.put_nowait(message)

    async def next(self, timeout: float) -> Any | None:
        """The next message; None when none came for `timeout` s.

        Raises:
            LinkLost: the vehicle's heartbeats stopped.
        """
        try:
            message = await wait_with_timeout(timeout, self._said.get())
        except asyncio.TimeoutError:
            return None
        if message is None:
            raise self._wait.error or LinkLost(f"vehicle {self._state.system} is gone")
        return message
