"""Which operator holds a vehicle: others of the same or a lower role do not command it meanwhile, but may stop it.

A hold lasts as long as its lease, which each call of its operator renews. When the lease runs out, the hold ends; if
the operator still commands the vehicle, it does what `on_lease_end` says. The prompt's hold has no lease.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mavproxy_uavapi.core.errors import Busy
from mavproxy_uavapi.core.oversight.leases import Leases
from mavproxy_uavapi.core.roles import THE_PROMPT, Operator
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle


@dataclass(frozen=True)
class Holder:
    """A vehicle's holder, and for how many s the hold lasts without a call; None for the prompt's."""

    operator: Operator
    remaining: float | None


class Holds:
    """The holds by vehicle, one each. Asyncio thread only.

    Args:
        leases: of operators by their names.
        clock: monotonic seconds.
    """

    def __init__(self, leases: Leases, clock: Callable[[], float]) -> None:
        self._leases = leases
        self._clock = clock
        self._operators: dict[Vehicle, Operator] = {}

    def of(self, vehicle: Vehicle) -> Holder | None:
        """Who holds the vehicle; None if nobody does."""
        operator, lease = self._operators.get(vehicle), self._leases.of(vehicle)
        if operator == THE_PROMPT:
            return Holder(operator, None)
        if operator is None or lease is None or lease.ends_at <= self._clock():
            return None
        return Holder(operator, lease.ends_at - self._clock())

    def require(self, vehicle: Vehicle, operator: Operator) -> None:
        """Raise Busy if somebody else of the same or a higher role holds the vehicle."""
        hold = self.of(vehicle)
        if hold is None or hold.operator.name == operator.name or operator.role > hold.operator.role:
            return
        raise Busy(
            f"{hold.operator.name} holds vehicle {vehicle.state.system}; others may stop it (stop, brake, land, rtl)"
        )

    def take(self, vehicle: Vehicle, operator: Operator, seconds: float) -> None:
        """Make that operator the holder, until so many s have passed without a call; nothing is sent.

        Raises:
            Busy: somebody else holds it, from whom only an admin or the prompt may take it.
        """
        hold = self.of(vehicle)
        if hold is not None and hold.operator.name != operator.name and not operator.takes_from(hold.operator):
            raise Busy(
                f"{hold.operator.name} holds vehicle {vehicle.state.system}; only an admin or the prompt takes it"
            )
        commander = vehicle.authority.commander
        if commander is not None and commander.operator != operator.name:
            vehicle.repeat_nothing()
        self._operators[vehicle] = operator
        self._leases.take(vehicle, operator.name, 0 if operator == THE_PROMPT else seconds)

    def release(self, vehicle: Vehicle, operator: Operator) -> bool:
        """End the operator's hold, or that of somebody from whom the operator may take; nothing is sent.

        Returns:
            Whether there was one.

        Raises:
            Busy: somebody else holds it.
        """
        hold = self.of(vehicle)
        if hold is None:
            return False
        if hold.operator.name != operator.name and not operator.takes_from(hold.operator):
            raise Busy(f"{hold.operator.name} holds vehicle {vehicle.state.system}")
        del self._operators[vehicle]
        self._leases.take(vehicle, hold.operator.name, 0)
        return True

    def renew(self, operator: Operator) -> None:
        """A call of that operator arrived."""
        self._leases.renew(operator.name)

    def move(self, before: Vehicle, now: Vehicle) -> None:
        """Keep the hold of a vehicle that is another object now, because its type has changed."""
        if before in self._operators:
            self._operators[now] = self._operators.pop(before)
            self._leases.move(before, now)

    def close(self) -> None:
        """Forget them all."""
        self._operators.clear()
        self._leases.close()
