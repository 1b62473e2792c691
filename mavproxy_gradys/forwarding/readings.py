"""Readings, and how a quantity of a vehicle becomes one. Pure: the clock is an argument."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from mavproxy_gradys.forwarding.quantities import Quantity
from mavproxy_uavapi.core.telemetry.vehicle_state import Received, VehicleState

UAV = "uav"  # the beginning of the device names of vehicles
CONFIRMED_TOPIC = "confirmed/"  # below it a station confirms the readings that it has stored

Value = float | int | str | bool | list[float]


@dataclass(frozen=True)
class Reading:
    """One measurement.

    Attributes:
        device: the device that measured it, such as `uav-1`.
        system: MAVLink system id of its vehicle.
        quantity, representation, value: the measurement.
        time: s since 1970 on this machine's clock.
    """

    device: str
    system: int
    quantity: str
    representation: str
    value: Value
    time: float

    def report(self) -> dict[str, Any]:
        """The reading as the station's exports have it, without its number."""
        return {
            "device": self.device,
            "quantity": self.quantity,
            "representation": self.representation,
            "value": self.value,
            "time": round(self.time, 3),
        }


@dataclass(frozen=True)
class Stored:
    """A reading in the spool, with its sequence number."""

    seq: int
    reading: Reading

    def body(self) -> dict[str, Any]:
        """The JSON object that is sent."""
        reading = self.reading
        return {"device": reading.device, "id": str(reading.system), "seq": self.seq, **reading.report()}


def device_of(system: int, name: str = UAV) -> str:
    """The device name of a vehicle; `name` is the setting `device`."""
    return f"{name}-{system}"


@dataclass
class Sampler:
    """Samples one quantity of every vehicle.

    A message is sampled once; a further reading needs a new message.

    Attributes:
        device: the beginning of the device names.
        sampled_at: arrival of the last message that was sampled, s on the clock of arrivals, by system id.
        taken: number of readings.
        why_not: why the last turn gave none, by system id.
    """

    quantity: Quantity
    device: str = UAV
    sampled_at: dict[int, float] = field(default_factory=dict)
    taken: int = 0
    why_not: dict[int, str] = field(default_factory=dict)

    def sample(self, state: VehicleState, now: float, wall: float, max_age: float) -> Reading | None:
        """A reading from the newest message; None if there is nothing new, and then `why_not` has the reason.

        Args:
            state: the vehicle's state.
            now: s on the clock of arrivals.
            wall: the same moment in s since 1970.
            max_age: s after which a message is too old for a measurement.
        """
        received = state.newest(self.quantity.message)
        value, why = self._read(received, now, max_age)
        if received is None or value is None:
            self.skip(state.system, f"{self.quantity.message} {why}")
            return None
        return self.take(state.system, value, received.at, wall - (now - received.at))

    def _read(self, received: Received | None, now: float, max_age: float) -> tuple[Value | None, str]:
        """The value, or why there is none."""
        if received is None:
            return None, "has not arrived yet"
        if now - received.at > max_age:
            return None, f"is {now - received.at:.1f} s old"
        return self._value(received.message), "has no such number"

    def take(self, system: int, value: Value, received_at: float, at: float) -> Reading | None:
        """A reading of `value`, measured at `at` (s since 1970); None if its message was sampled before.

        Args:
            system: the vehicle's system id.
            value: the measurement.
            received_at: arrival of its message, s on the clock of arrivals.
            at: see above.
        """
        if self.sampled_at.get(system) == received_at:
            self.skip(system, f"no new {self.quantity.message or self.quantity.name} has arrived")
            return None
        self.sampled_at[system] = received_at
        self.why_not.pop(system, None)
        self.taken += 1
        quantity = self.quantity
        device = device_of(system, self.device)
        return Reading(device, system, quantity.name, quantity.representation, value, at)

    def skip(self, system: int, why: str) -> None:
        """Note why there is no reading."""
        self.why_not[system] = why

    def _value(self, message: Any) -> float | int | str | None:
        value = getattr(message, self.quantity.attribute, None)
        if self.quantity.index is not None:
            value = _element(value, self.quantity.index)
        if isinstance(value, str):
            return value
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            return None
        return self.quantity.scaled(value)


def _element(values: Any, index: int) -> Any:
    return values[index] if isinstance(values, list | tuple) and index < len(values) else None
