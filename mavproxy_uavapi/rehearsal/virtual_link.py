"""The link of simulated vehicles in this process: MAVLink's own bytes, on the vehicles' clock."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.link.link import Address, require_finite
from mavproxy_uavapi.core.sent_messages import note_sent
from mavproxy_uavapi.rehearsal.sitl import SitlVehicle
from mavproxy_uavapi.sim.simulator import Simulator

SOURCE = Address(255, 230)  # MAVProxy's
FRAME, LENGTH = 12, 1  # bytes of a frame of MAVLink 2 besides its payload; where the payload's length is


class VirtualLink:
    """What is sent either way arrives with the vehicles' next step.

    Args:
        simulators: the vehicles, all with the same step.

    Attributes:
        arriving: what is on its way to the vehicles, oldest first.
    """

    def __init__(self, simulators: Sequence[Simulator | SitlVehicle]) -> None:
        self.arriving: list[Any] = []
        self._cables: list[tuple[Any, Any]] = []
        self._encoder, self._parser = mavlink.MAVLink(None, *SOURCE), mavlink.MAVLink(None)
        for simulator in simulators:
            self.join(simulator)

    def join(self, simulator: Simulator | SitlVehicle) -> None:
        """Put a vehicle on the link."""
        self._cables.append((simulator, simulator.open_link("companion")))

    @property
    def source(self) -> Address:
        """See `core.link.link.Link`."""
        return SOURCE

    @property
    def simulators(self) -> list[Any]:
        """The vehicles on it."""
        return [simulator for simulator, _ in self._cables]

    async def send(self, message: Any, system: int) -> None:
        """See `core.link.link.Link.send`; who is cancelled before it came to it has sent nothing."""
        require_finite(message)
        await asyncio.sleep(0)
        if system not in (simulator.options.sysid for simulator in self.simulators):
            raise LinkLost(f"there is no vehicle {system}")
        note_sent(message.get_type())
        self.arriving.append(message)

    def take_arriving(self) -> list[Any]:
        """What arrives at this step."""
        arriving, self.arriving = self.arriving, []
        return arriving

    def deliver(self, message: Any) -> None:
        """Let a message arrive at all vehicles: they are on one link."""
        wired = self.wired(message)
        for simulator, cable in self._cables:
            simulator.receive(cable, wired)

    def heard(self) -> Iterator[Any]:
        """What the vehicles have said since the last time."""
        for _, cable in self._cables:
            for frame in _frames(cable.drain()):
                yield self._parser.decode(frame)

    def wired(self, message: Any) -> Any:
        """A message as it comes off the wire."""
        return self._parser.decode(bytearray(message.pack(self._encoder)))


def _frames(data: bytes) -> Iterator[bytearray]:
    """The frames of MAVLink 2, without signatures: a parser would look at each byte."""
    at = 0
    while at < len(data):
        end = at + FRAME + data[at + LENGTH]
        yield bytearray(data[at:end])
        at = end
