"""Parameters of one vehicle: those that are known, and requests for others."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable

from mavproxy_uavapi.core.errors import TimedOut
from mavproxy_uavapi.core.mavlink.link import Address, Link
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle import messages
from mavproxy_uavapi.core.vehicle.message_waiter import MessageWaiter

MOST_REQUESTS = 2  # for a name in one boot
TIMEOUT = 1.0  # s; ArduPilot answers a known name at once and an unknown one not at all

Names = tuple[str, ...]  # of one quantity, of which a firmware has one


class Parameters:
    """Reads parameters; each is read once and then remembered."""

    def __init__(self, state: VehicleState, link: Link, waiting: MessageWaiter) -> None:
        self._state = state
        self._link = link
        self._waiting = waiting
        self._requests: dict[tuple[int, str], int] = {}  # times, by boot and name

    async def read(self, quantities: Iterable[Names]) -> dict[str, float]:
        """Values by name, of those that the vehicle has.

        ArduPilot does not answer for an unknown name. A name is requested twice in a boot, because a message may be
        lost, and then counts as absent.

        Args:
            quantities: the names of each quantity.
        """
        quantities = list(quantities)
        known = self._state.parameters
        missing = [names for names in quantities if not known.keys() & set(names)]
        requested = [name for names in missing for name in names if self._count(name) < MOST_REQUESTS]
        if requested:
            with self._waiting.expecting(
                {"PARAM_VALUE"}, lambda _: all(known.keys() & set(names) for names in missing) or None
            ) as answers:
                for name in requested:
                    self._requests[self._state.reboots, name] = self._count(name) + 1
                    address = Address(self._state.system, self._state.component)
                    await self._link.send(messages.read_parameter(address, name), self._state.system)
                with contextlib.suppress(TimedOut):
                    await answers.within(TIMEOUT, f"tell {', '.join(requested)}")
        return {name: known[name] for names in quantities for name in names if name in known}

    def _count(self, name: str) -> int:
        return self._requests.get((self._state.reboots, name), 0)
