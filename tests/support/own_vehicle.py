"""An embedded vehicle in this process, as a link of pymavlink."""

from __future__ import annotations

from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim import Options, Simulator


class OwnVehicle:
    """A link to a vehicle whose time passes while somebody listens, and only then."""

    def __init__(self, kind: str, **options: Any) -> None:
        self._simulator = Simulator(Options(vehicle=kind, **options))
        self._link = self._simulator.open_link("station")
        self._arrived: deque[Any] = deque()
        self._parser = mavlink.MAVLink(None)
        self.mav = mavlink.MAVLink(self, 255, 190)

    def write(self, data: bytes) -> None:
        """Hand a packet over."""
        for message in mavlink.MAVLink(None).parse_buffer(data) or ():
            self._simulator.receive(self._link, message)

    def recv_match(self, **_options: Any) -> Any:
        """The next message."""
        while not self._arrived:
            self._simulator.step()
            self._arrived.extend(self._parser.parse_buffer(self._link.drain()) or ())
        return self._arrived.popleft()

    def close(self) -> None:
        """Do nothing: nobody else knows the vehicle."""
