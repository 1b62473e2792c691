"""Parameters of one vehicle: what it told, and what it is asked for."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable

from mavproxy_uavapi.core.errors import TimedOut
from mavproxy_uavapi.core.mavlink.link import Address, Link
from mavproxy_uavapi.core.mavlink.vehicle_state import VehicleState
from mavproxy_uavapi.core.vehicle import messages
from mavproxy_uavapi.core.vehicle.message_waiter import MessageWaiter

ASKINGS = 2  # of a name in one boot
TIMEOUT = 1.0  # s; ArduPilot answers a known name at once and an unknown one not at all

Names = tuple[str, ...]  # of one quantity: a firmware has one of them


class Parameters:
    """Reads parameters; each is asked for once and then remembered."""

    def __init__(self, state: VehicleState, link: Link, waiting: MessageWaiter) -> None:
        self._state = state
        self._link = link
        self._waiting = waiting
        self._asked: dict[tuple[int, str], int] = {}  # times, by boot and name

    async def read(self, wanted: Iterable[Names]) -> dict[str, float]:
        """Values by name, of those that the vehicle has.

        ArduPilot does not answer for a name that it does not have: such are asked for twice in a boot, since a
        message may be lost, and then taken as absent.

        Args:
            wanted: one entry for each quantity.
        """
        wanted = list(wanted)
        known = self._state.parameters
        missing = [names for names in wanted if not known.keys() & set(names)]
        asked = [name for names in missing for name in names if self._count(name) < ASKINGS]
        if asked:
            with self._waiting.expecting(
                {"PARAM_VALUE"}, lambda _: all(known.keys() & set(names) for names in missing) or None
            ) as told:
                for name in asked:
                    self._asked[self._state.reboots, name] = self._count(name) + 1
                    address = Address(self._state.system, self._state.component)
                    await self._link.send(messages.read_parameter(address, name), self._state.system)
                with contextlib.suppress(TimedOut):
                    await told.within(TIMEOUT, f"tell {', '.join(asked)}")
        return {name: known[name] for names in wanted for name in names if name in known}

    def _count(self, name: str) -> int:
        return self._asked.get((self._state.reboots, name), 0)
