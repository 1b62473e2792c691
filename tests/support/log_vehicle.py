"""A vehicle's end of the log protocol, scripted: as ArduPilot has it, over a link that may lose messages."""

from __future__ import annotations

import random
from typing import Any

from tests.support.virtual_time import FastLoop

PIECE = 90
PIECES_AT_ONCE = 10


class LogVehicle:
    """Holds logs for a `Drone`, and sends them.

    Attributes:
        logs: by id.
        began: unix s of each log; 0 is what a vehicle says that does not know the time.
        loss: share of the messages that are lost, each way.
        interval: s between some pieces and the next ones.
        mute: names of its messages that are all lost.
        received: what reached it, as name and fields.
    """

    def __init__(self, loop: FastLoop, drone: Any, link: Any) -> None:
        self._loop, self._drone = loop, drone
        self.logs = {1: bytes(range(256)) * 4, 2: random.Random(5).randbytes(250_001)}
        self.began = {1: 0, 2: 1_790_000_000}
        self.loss = 0.0
        self.mute: set[str] = set()
        self.interval = 0.01
        self.received: list[tuple[str, dict[str, Any]]] = []
        self._chance = random.Random(1)
        self._sending: list[int] | None = None  # id, next byte, the one after the last
        before = link.on_send

        def on_send(message: Any, system: int) -> None:
            before(message, system)
            if message.get_type().startswith("LOG_") and system == drone.system:
                loop.call_later(0.02, self._take, message)

        link.on_send = on_send

    def names(self) -> list[str]:
        """The names of what reached it."""
        return [name for name, _ in self.received]

    def send_to_others(self, number: int) -> None:
        """Begin to send a log that another program has requested."""
        self._sending = [number, 0, len(self.logs[number])]
        self._send()

    def _is_lost(self, name: str) -> bool:
        return name in self.mute or self._chance.random() < self.loss

    def _take(self, message: Any) -> None:
        name = message.get_type()
        if self._chance.random() < self.loss:
            return
        self.received.append((name, message.to_dict()))
        if name == "LOG_REQUEST_END":
            self._sending = None
        elif self._sending is not None or self._drone.armed:
            return
        elif name == "LOG_REQUEST_LIST":
            self._list(message)
        elif message.id in self.logs:
            end = min(message.ofs + message.count, len(self.logs[message.id]))
            self._sending = [message.id, message.ofs, end]
            self._send()

    def _list(self, message: Any) -> None:
        last = min(message.end, len(self.logs))
        for number in range(max(message.start, 1), last + 1) if self.logs else [0]:
            if not self._is_lost("LOG_ENTRY"):
                size, began = len(self.logs.get(number, b"")), self.began.get(number, 0)
                listed = {"id": number, "num_logs": len(self.logs), "last_log_num": last}
                self._drone.send("log_entry", **listed, size=size, time_utc=began)

    def _send(self) -> None:
        for _ in range(PIECES_AT_ONCE):
            if self._sending is None or self._drone.armed:
                return
            number, start, end = self._sending
            data = self.logs[number][start : min(start + PIECE, end)]
            self._sending = [number, start + len(data), end] if start + len(data) < end else None
            if not self._is_lost("LOG_DATA"):
                padded = list(data.ljust(PIECE, b"\0"))
                self._drone.send("log_data", id=number, ofs=start, count=len(data), data=padded)
        self._loop.call_later(self.interval, self._send)
