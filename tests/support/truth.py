"""Where simulated vehicles truly are, as a MAVProxy forwards it."""

from __future__ import annotations

import socket
import threading
from collections import defaultdict

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import offset

SIMSTATE = int(mavlink.MAVLINK_MSG_ID_SIMSTATE)
LONGEST = 2048


class Truth:
    """Receives what MAVProxy forwards to an `--out`, a message in each datagram, and keeps SIMSTATE.

    Attributes:
        address: HOST:PORT for MAVProxy.
    """

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.1)
        self.address = f"127.0.0.1:{self._socket.getsockname()[1]}"
        self._places: defaultdict[int, list[tuple[float, float]]] = defaultdict(list)
        self._parser = mavlink.MAVLink(None)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._receive)
        self._thread.start()

    def _receive(self) -> None:
        while not self._ended.is_set():
            try:
                frame = self._socket.recv(LONGEST)
            except TimeoutError:
                continue
            if frame[0] == mavlink.PROTOCOL_MARKER_V2 and int.from_bytes(frame[7:10], "little") == SIMSTATE:
                message = self._parser.decode(bytearray(frame))
                self._places[message.get_srcSystem()].append((message.lat / 1e7, message.lng / 1e7))

    @property
    def systems(self) -> set[int]:
        """The vehicles that have told their place; MAVProxy asks for it every 15 s."""
        return set(self._places)

    def start_of(self, system: int) -> tuple[float, float]:
        """Its first place, degrees."""
        return self._places[system][0]

    def path(self, system: int) -> list[tuple[float, float]]:
        """Where it was, one after the other: m north and east of its first place."""
        return [offset(*self.start_of(system), *place) for place in list(self._places[system])]

    def close(self) -> None:
        """End the reception."""
        self._ended.set()
        self._thread.join()
        self._socket.close()
