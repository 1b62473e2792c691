"""Readings of many vehicles, as lightly as Python can: ready-made MQTT 5 packets on one socket, QoS 1.

No MAVProxy, no spool: this loads broker, workers and database. Vehicles take turns within each second. Prints JSON:
what was sent and acknowledged, and how late (s) the generator itself was at most.
"""

from __future__ import annotations

import argparse
import json
import selectors
import socket
import struct
import sys
import time

TURN = 0.02  # s
PUBACK, MANY = 4, 1 << 20
QUANTITIES = ("position", "heading", "battery", "voltage", "ground_speed")


def length(size: int) -> bytes:
    """MQTT's variable byte integer."""
    encoded = bytearray()
    while True:
        size, digit = divmod(size, 128)
        encoded.append(digit | (0x80 if size else 0))
        if not size:
            return bytes(encoded)


def field(data: bytes) -> bytes:
    """A text with its length before it."""
    return struct.pack("!H", len(data)) + data


def connect(name: str) -> bytes:
    """CONNECT, clean start, no keep-alive."""
    body = field(b"MQTT") + bytes([5, 2, 0, 0, 0]) + field(name.encode())
    return b"\x10" + length(len(body)) + body


def publish(topic: str, payload: bytes, mid: int, reply_to: bytes) -> bytes:
    """PUBLISH, QoS 1; `reply_to` is the property of the response topic, or nothing."""
    body = field(topic.encode()) + struct.pack("!H", mid) + length(len(reply_to)) + reply_to + payload
    return b"\x32" + length(len(body)) + body


def reading(vehicle: int, seq: int, at: float) -> tuple[str, bytes]:
    """Topic and payload, of the size that the MQTT sink's have."""
    quantity = QUANTITIES[seq % len(QUANTITIES)]
    value: object = round(40 + seq % 600 / 10, 1)
    if quantity == "position":
        value = [round(-35.36 + vehicle * 1e-4, 7), round(149.16 + seq % 1000 * 1e-6, 7), 20.5]
    body = {"device": f"uav-{vehicle}", "id": str(vehicle), "seq": seq, "quantity": quantity}
    whole = {**body, "representation": "m", "value": value, "time": round(at, 3)}
    return f"fleet/uav-{vehicle}/{quantity}", json.dumps(whole).encode()


class Generator:
    """One connection's readings."""

    def __init__(self, port: int, first: int, count: int, reply: bool) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port))
        self._socket.sendall(connect(f"generator-{first}"))
        assert self._socket.recv(2)[0] >> 4 == 2, "no CONNACK"
        self._acknowledged = 0
        self._first, self._count = first, count
        topic = f"confirmed/generator-{first}".encode()
        self._reply = b"\x08" + field(topic) if reply else b""
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)
        self.sent = 0
        self.latest = 0.0
        self._drain_connack()

    def _drain_connack(self) -> None:
        """Read what is left of the CONNACK: it is all that the broker sends before the first reading."""
        while self._selector.select(0.2):
            self._socket.recv(MANY)

    def run(self, rate: float, seconds: float) -> None:
        """Send `rate` readings a second of each vehicle."""
        began = time.time()
        total, period = self._count * rate, 1.0 / (self._count * rate)
        while self.sent < total * seconds:
            due = min(int((time.time() - began) * total), int(total * seconds))
            packets = []
            for number in range(self.sent, due):
                at = began + number * period
                vehicle, seq = self._first + number % self._count, number // self._count
                topic, payload = reading(vehicle, seq, at)
                packets.append(publish(topic, payload, number % 65535 + 1, self._reply))
            if packets:
                self.latest = max(self.latest, time.time() - began - self.sent * period)
                self._socket.sendall(b"".join(packets))
                self.sent = due
            self._read(TURN)

    def _read(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            if self._selector.select(left):
                self._acknowledged += len(self._socket.recv(MANY))

    def finish(self, timeout: float) -> None:
        """Wait for the last acknowledgements."""
        end = time.monotonic() + timeout
        while self.acknowledged < self.sent and time.monotonic() < end:
            self._read(0.1)
        self._socket.close()

    @property
    def acknowledged(self) -> int:
        """PUBACKs that came."""
        return self._acknowledged // PUBACK


def main() -> int:
    """Send, and report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("port", type=int, help="of the broker")
    parser.add_argument("--first", type=int, default=1, help="number of the first vehicle (%(default)s)")
    parser.add_argument("--vehicles", type=int, default=1000, help="(%(default)s)")
    parser.add_argument("--rate", type=float, default=1.0, help="readings/s of each (%(default)g)")
    parser.add_argument("--seconds", type=float, default=20.0, help="(%(default)g)")
    parser.add_argument("--reply", action="store_true", help="ask the station to confirm each reading")
    options = parser.parse_args()
    generator = Generator(options.port, options.first, options.vehicles, options.reply)
    generator.run(options.rate, options.seconds)
    generator.finish(30.0)
    report = {"sent": generator.sent, "acknowledged": generator.acknowledged, "late": round(generator.latest, 3)}
    print(json.dumps(report), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
