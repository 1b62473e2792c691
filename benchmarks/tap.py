"""A tap on a vehicle's link: each frame with its time, and how long MAVProxy takes to forward it."""

from __future__ import annotations

import contextlib
import selectors
import socket
import struct
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable

BACKLOG = 1 << 16
SO_TIMESTAMPNS = 35  # Linux's: the kernel says when a datagram arrived, however late we read it
MAVLINK2 = 0xFD
SIGNED = 1  # incompatibility flag: 13 bytes of signature follow


class Frames:
    """Cuts a byte stream into MAVLink 2 frames."""

    def __init__(self) -> None:
        self._bytes = b""

    def cut(self, data: bytes) -> list[bytes]:
        """The frames that `data` completes."""
        self._bytes += data
        frames = []
        while True:
            start = self._bytes.find(MAVLINK2)
            if start < 0 or len(self._bytes) < start + 3:
                return frames
            end = start + 12 + self._bytes[start + 1] + (13 if self._bytes[start + 2] & SIGNED else 0)
            if len(self._bytes) < end:
                return frames
            frames.append(self._bytes[start:end])
            self._bytes = self._bytes[end:]


def message_id(frame: bytes) -> int:
    """A MAVLink 2 frame's message number."""
    return int.from_bytes(frame[7:10], "little")


class Tap:
    """Stands between a vehicle and MAVProxy, passes all on, and tells its listeners each frame and its time.

    Args:
        vehicle: the vehicle's TCP port.

    Attributes:
        from_vehicle, to_vehicle: called in the tap's thread with the time (s, of time.time) and the frame.
    """

    def __init__(self, vehicle: int) -> None:
        self._vehicle = vehicle
        self._selector = selectors.DefaultSelector()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self._selector.register(self._listening, selectors.EVENT_READ, self._accept)
        self._wake, self._woken = socket.socketpair()
        self._selector.register(self._woken, selectors.EVENT_READ, None)
        self.from_vehicle: Callable[[float, bytes], None] = lambda _at, _frame: None
        self.to_vehicle: Callable[[float, bytes], None] = lambda _at, _frame: None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def watch(self, sock: socket.socket, read: Callable[[], None]) -> None:
        """Have the tap's thread read a further socket."""
        self._selector.register(sock, selectors.EVENT_READ, read)

    def _run(self) -> None:
        while True:
            for key, _ in self._selector.select():
                if key.data is None:
                    return
                key.data()

    def _accept(self) -> None:
        near, _ = self._listening.accept()
        far = socket.create_connection(("127.0.0.1", self._vehicle))
        for one in (near, far):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._pour(far, near, "from_vehicle")
        self._pour(near, far, "to_vehicle")

    def _pour(self, source: socket.socket, sink: socket.socket, listener: str) -> None:
        frames = Frames()

        def read() -> None:
            try:
                data = source.recv(BACKLOG)
            except OSError:
                data = b""
            if not data:
                self._selector.unregister(source)
                with contextlib.suppress(OSError):
                    sink.shutdown(socket.SHUT_WR)
                source.close()
                return
            at = time.time()
            with contextlib.suppress(OSError):
                sink.sendall(data)
            for frame in frames.cut(data):
                getattr(self, listener)(at, frame)

        self._selector.register(source, selectors.EVENT_READ, read)

    def close(self) -> None:
        """End the thread and close everything."""
        self._wake.send(b"\0")
        self._thread.join()
        for key in list(self._selector.get_map().values()):
            key.fileobj.close()  # type: ignore[union-attr]
        self._selector.close()
        self._wake.close()


class Forwarding:
    """Delays between a tap and MAVProxy's `--out`: the same bytes, seen on both sides."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.bind(("127.0.0.1", 0))
        self.port = int(self._socket.getsockname()[1])
        self._sent: defaultdict[bytes, deque[float]] = defaultdict(deque)
        self.delays: list[tuple[float, float]] = []  # at (s), delay (s)

    def attach(self, tap: Tap) -> None:
        """Begin to listen on both sides."""
        tap.from_vehicle = lambda at, frame: self._sent[frame].append(at)
        tap.watch(self._socket, self._read)

    def _read(self) -> None:
        data, ancillary, _, _ = self._socket.recvmsg(BACKLOG, 64)
        seconds, nanoseconds = struct.unpack("ll", ancillary[0][2][:16])
        sent = self._sent.get(data)
        if sent:
            at = sent.popleft()
            self.delays.append((at, seconds + nanoseconds / 1e9 - at))

    def between(self, start: float, end: float) -> list[float]:
        """The delays (s) of what the vehicle sent from `start` to `end`."""
        return [delay for at, delay in list(self.delays) if start <= at < end]

    def lost(self, start: float, end: float) -> int:
        """How many of the vehicle's messages of that time never came out."""
        return sum(start <= at < end for waiting in list(self._sent.values()) for at in list(waiting))
