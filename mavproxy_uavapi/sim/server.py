"""Sockets and the wall clock around a `Simulator`: TCP server, UDP peers and the control port, one thread."""

from __future__ import annotations

import contextlib
import selectors
import socket
import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.platform import follow_at_once

from .control import Control
from .link import PeerLink
from .simulator import Simulator

BACKLOG_LIMIT = 1 << 20
"""Bytes that may wait for a slow TCP peer; a peer with more is disconnected."""
LONGEST_WAIT = 0.05
SHORTEST_TURN = 0.005
"""Wall seconds from one look at the sockets to the next, if nothing arrives: at a high speed-up several steps."""
LONGEST_BURST = 0.05
"""Wall seconds of simulation at a stretch before the sockets get their turn."""
BEHIND_LIMIT = 0.1
"""Wall seconds the simulation may lag; beyond it simulated time is slowed down instead of jumping."""
READ_SIZE = 65536


class Peer:
    """A connected ground link: its socket, parser and unsent bytes."""

    def __init__(self, link: PeerLink, sock: socket.socket, address: Any = None) -> None:
        self.link, self.sock, self.address = link, sock, address
        self.unsent = b""
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True

    def parse(self, data: bytes) -> list[Any]:
        """Messages in data; garbage in between is skipped."""
        messages = self._parser.parse_buffer(data) or []
        return [message for message in messages if message.get_type() != "BAD_DATA"]


class ControlPeer:
    """A connection to the control port and its half line."""

    def __init__(self, sock: socket.socket) -> None:
        self.sock = sock
        self.partial = b""


class Server:
    """Owns the sockets. OSError from `listen`, `add_udp` and `listen_control` says why a port is not free."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        self._control = Control(simulator)
        self._selector = selectors.DefaultSelector()
        self._peers: list[Peer] = []
        self._stopped = False
        self._links_made = 0

    def listen(self, host: str, port: int) -> int:
        """Accept MAVLink over TCP; the port (useful with 0)."""
        return self._listen(host, port, self._accept)

    def listen_control(self, host: str, port: int) -> int:
        """Accept the control protocol over TCP; the port."""
        return self._listen(host, port, self._accept_control)

    def _listen(self, host: str, port: int, accept: Callable[[socket.socket], None]) -> int:
        server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            follow_at_once(server)
            server.bind((host, port))
            server.listen(8)
        except OSError:
            server.close()
            raise
        server.setblocking(False)
        self._selector.register(server, selectors.EVENT_READ, lambda: accept(server))
        return int(server.getsockname()[1])

    def add_udp(self, host: str, port: int) -> None:
        """Send to a UDP address and hear its answers, like MAVProxy's udpout."""
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setblocking(False)
        peer = Peer(self._open_link(f"udp:{host}:{port}"), sock, (host, port))
        self._peers.append(peer)
        self._selector.register(sock, selectors.EVENT_READ, lambda: self._read_datagrams(peer))

    def hear_decks(self, host: str, port: int) -> None:
        """Hear on a UDP port the rovers that the vehicle may land on."""
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setblocking(False)
        peer = Peer(PeerLink(self.simulator.options.sysid, "decks"), sock)
        self._selector.register(sock, selectors.EVENT_READ, lambda: self._hear_deck(peer))
        sock.bind((host, port))

    def _hear_deck(self, peer: Peer) -> None:
        with contextlib.suppress(OSError):  # a rover that has ended shows as ECONNREFUSED on some systems
            data, rover = peer.sock.recvfrom(READ_SIZE)
            for message in peer.parse(data):
                answer = self.simulator.decks.hear(message, self.simulator.vehicle.now)
                if answer is not None:
                    peer.link.send(answer)
            peer.sock.sendto(peer.link.drain(), rover)

    def _open_link(self, name: str) -> PeerLink:
        self._links_made += 1
        return self.simulator.open_link(f"{name}#{self._links_made}")

    def stop(self) -> None:
        """Let `run` return; may be called from a signal handler."""
        self._stopped = True

    def close(self) -> None:
        """Close all sockets."""
        for key in list(self._selector.get_map().values()):
            sock = key.fileobj
            self._selector.unregister(sock)
            if isinstance(sock, socket.socket):
                sock.close()
        self._selector.close()

    def run(self) -> None:
        """Serve and simulate at SIM_SPEEDUP until `stop`."""
        last = time.monotonic()
        owed, step = 0.0, self.simulator.options.step
        while not self._stopped:
            now = time.monotonic()
            owed = min(owed + (now - last) * self.simulator.speedup, BEHIND_LIMIT * self.simulator.speedup + step)
            last = now
            owed = self._simulate(owed, now + LONGEST_BURST)
            self._flush()
            behind = owed >= step
            due = max(step, SHORTEST_TURN * self.simulator.speedup)
            wait = 0.0 if behind else min((due - owed) / self.simulator.speedup, LONGEST_WAIT)
            self._serve(wait)

    def _simulate(self, owed: float, deadline: float) -> float:
        while owed >= self.simulator.options.step:
            self.simulator.step()
            owed -= self.simulator.options.step
            if time.monotonic() > deadline:
                break
        return owed

    def _serve(self, wait: float) -> None:
        for key, _ in self._selector.select(wait):
            key.data()
        self._flush()

    def _accept(self, server: socket.socket) -> None:
        with contextlib.suppress(BlockingIOError):
            sock, address = server.accept()
            sock.setblocking(False)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            peer = Peer(self._open_link(f"tcp:{address[0]}:{address[1]}"), sock)
            self._peers.append(peer)
            self._selector.register(sock, selectors.EVENT_READ, lambda: self._read_stream(peer))

    def _read_stream(self, peer: Peer) -> None:
        try:
            data = peer.sock.recv(READ_SIZE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._take(peer, data)
        else:
            self._drop(peer)

    def _read_datagrams(self, peer: Peer) -> None:
        # A peer that is not there (yet) shows as ECONNREFUSED on some systems; it may come later.
        with contextlib.suppress(OSError):
            self._take(peer, peer.sock.recv(READ_SIZE))

    def _take(self, peer: Peer, data: bytes) -> None:
        for message in peer.parse(data):
            self.simulator.receive(peer.link, message, time.time())

    def _drop(self, peer: Peer) -> None:
        self._selector.unregister(peer.sock)
        peer.sock.close()
        self._peers.remove(peer)
        self.simulator.close_link(peer.link)

    def _flush(self) -> None:
        for peer in list(self._peers):
            data = peer.link.drain()
            if data or peer.unsent:
                self._send(peer, data)

    def _send(self, peer: Peer, data: bytes) -> None:
        if peer.address is not None:
            with contextlib.suppress(OSError):
                for start in range(0, len(data), 1400):
                    peer.sock.sendto(data[start : start + 1400], peer.address)
            return
        peer.unsent += data
        try:
            sent = peer.sock.send(peer.unsent)
        except BlockingIOError:
            sent = 0
        except OSError:
            self._drop(peer)
            return
        peer.unsent = peer.unsent[sent:]
        if len(peer.unsent) > BACKLOG_LIMIT:
            self._drop(peer)

    def _accept_control(self, server: socket.socket) -> None:
        with contextlib.suppress(BlockingIOError):
            sock, _ = server.accept()
            # A test that does not read its answers must not stop the vehicle for long.
            sock.settimeout(1.0)
            peer = ControlPeer(sock)
            self._selector.register(sock, selectors.EVENT_READ, lambda: self._read_control(peer))

    def _read_control(self, peer: ControlPeer) -> None:
        try:
            data = peer.sock.recv(READ_SIZE)
            if data:
                *lines, peer.partial = (peer.partial + data).split(b"\n")
                for line in lines:
                    answer = self._control.handle_line(line.decode(errors="replace"))
                    peer.sock.sendall(answer.encode() + b"\n")
                return
        except OSError:
            pass  # The peer has gone; it is closed below like one that disconnects.
        self._selector.unregister(peer.sock)
        peer.sock.close()
