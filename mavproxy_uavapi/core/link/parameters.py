"""Parameters of one vehicle: those that are known, and requests for others."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable
from typing import Any

from mavproxy_uavapi.core.errors import Expired, NotFound, TimedOut
from mavproxy_uavapi.core.link import messages
from mavproxy_uavapi.core.link.link import Address, Link
from mavproxy_uavapi.core.link.message_waiter import MessageWaiter
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

MOST_REQUESTS = 2  # for a name, until it counts as absent
ABSENT_FOR = 30.0  # s for which it does
SET_TIMEOUT = 2.0  # s until a value is confirmed, likewise
TIMEOUT = 1.0  # s, more on a slow link; ArduPilot answers a known name at once and an unknown one not at all

ParameterNames = tuple[str, ...]  # of one quantity, of which a firmware has one


class Parameters:
    """Reads and sets parameters; what the verbs need is read once and then remembered."""

    def __init__(self, state: VehicleState, link: Link, waiting: MessageWaiter) -> None:
        self._state = state
        self._link = link
        self._waiting = waiting
        self._read: set[str] = set()  # names that a verb or a check needed
        self._requests: dict[tuple[int, str], tuple[int, float]] = {}  # times, and the last one (s), by boot and name

    async def read(self, quantities: Iterable[ParameterNames]) -> dict[str, float]:
        """Values by name, of those that the vehicle has.

        ArduPilot does not answer for an unknown name. A name is requested twice, because a message may be lost, and
        then counts as absent for ABSENT_FOR s: both may be lost.

        Args:
            quantities: the names of each quantity.
        """
        quantities = list(quantities)
        self._read.update(name for names in quantities for name in names)
        known = self._state.parameters
        missing = [names for names in quantities if not known.keys() & set(names)]
        requested = [name for names in missing for name in names if self._count(name) < MOST_REQUESTS]
        if requested:
            with (
                self._waiting.expecting(
                    {"PARAM_VALUE"}, lambda _: all(known.keys() & set(names) for names in missing) or None
                ) as answers,
                contextlib.suppress(TimedOut, Expired),
            ):
                for name in requested:
                    await self._link.send(messages.read_parameter(self._address, name), self._state.system)
                    self._requests[self._state.reboots, name] = self._count(name) + 1, self._waiting.clock()
                await answers.within(self._state.trip.at_least(TIMEOUT), f"report {', '.join(requested)}")
        return {name: known[name] for names in quantities for name in names if name in known}

    async def ask_again(self) -> None:
        """Request what was read, and is known, once more: it may have been changed, and the report of it been lost.

        Raises:
            Expired, LinkLost.
        """
        for name in sorted(self._read & self._state.parameters.keys()):
            await self._link.send(messages.read_parameter(self._address, name), self._state.system)

    async def read_now(self, name: str) -> float:
        """Request the value of a parameter now.

        Raises:
            NotFound: the vehicle does not answer for it: it has no such parameter.
            LinkLost: its heartbeats stopped.
        """
        for _ in range(MOST_REQUESTS):
            with self._waiting.expecting({"PARAM_VALUE"}, _value_of(name)) as answer:
                await self._link.send(messages.read_parameter(self._address, name), self._state.system)
                with contextlib.suppress(TimedOut):
                    return await answer.within(self._state.trip.at_least(TIMEOUT), f"report {name}")
        raise NotFound(f"vehicle {self._state.system} has no parameter {name}")

    async def set(self, name: str, value: float) -> float:
        """Set a parameter; the value that the vehicle holds then: it rounds to the parameter's type.

        Raises:
            NotFound: it has no such parameter.
            TimedOut: it does not confirm the value.
            Busy: two autopilots have its id.
            LinkLost: its heartbeats stopped.
        """
        if name not in self._state.parameters:
            await self.read_now(name)
        for _ in range(MOST_REQUESTS):
            values: list[float] = []  # reported meanwhile: its present value, or the answer to an earlier request

            def set_to(message: Any, values: list[float] = values) -> float | None:
                if message.param_id == name:
                    values.append(float(message.param_value))
                return value if values and math.isclose(values[-1], value, rel_tol=1e-5, abs_tol=1e-9) else None

            with self._waiting.expecting({"PARAM_VALUE"}, set_to) as answer:
                self._state.require_one(self._waiting.clock())
                await self._link.send(messages.set_parameter(self._address, name, value), self._state.system)
                with contextlib.suppress(TimedOut):
                    await answer.within(self._state.trip.at_least(SET_TIMEOUT), f"take {name} = {value:g}")
            if values:
                return values[-1]
        raise TimedOut(f"vehicle {self._state.system} did not take {name} = {value:g}")

    @property
    def _address(self) -> Address:
        return Address(self._state.system, self._state.component)

    def _count(self, name: str) -> int:
        count, at = self._requests.get((self._state.reboots, name), (0, 0.0))
        return 0 if self._waiting.clock() - at > ABSENT_FOR else count


def _value_of(name: str) -> Callable[[Any], float | None]:
    def value(message: Any) -> float | None:
        return float(message.param_value) if message.param_id == name else None

    return value
