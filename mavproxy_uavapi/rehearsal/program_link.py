"""MAVLink for programs that speak it themselves, past the API: by TCP and by UDP, as at an output of MAVProxy.

What they send arrives with the vehicles' next step. Scripts in Python come by a Unix socket in TCP's place
(`clock/uavapi_leads.py`): TCP's acknowledgements, for which it holds data back, are on this machine's clock.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.link import orders
from mavproxy_uavapi.rehearsal.virtual_time import VirtualLoop
from mavproxy_uavapi.sim.simulator import Simulator

LOOPBACK = "127.0.0.1"
TRIES = 20  # until a port is free for both
ROOM = 1 << 22  # bytes that a program has not read yet, as far as the kernel allows
STREAM_RATE = 4  # Hz, as MAVProxy asks for all streams
MOVING = orders.Movement | orders.SwitchMode | orders.FlyMission | orders.LandByMission | orders.Arm
COMMANDING = ("COMMAND_", "SET_", "RC_CHANNELS_OVERRIDE", "MANUAL_CONTROL")  # the names of other messages that do
OnOrder = Callable[[int, str], None]  # a message that moves a vehicle: its system id, 0 for all; the message's name


class ProgramLink:
    """Where programs find MAVLink.

    Args:
        loop: its clock is the vehicles'.
        simulators: the vehicles on the link.
        line: the path of the Unix socket.
        on_order: called with each message that moves a vehicle.

    Attributes:
        loop, line: see above.
        address: as pymavlink, DroneKit and MAVProxy take it; UDP has the same port.
        is_dead: whether it neither hears nor says anything.
    """

    def __init__(self, loop: VirtualLoop, simulators: Sequence[Simulator], line: Path, on_order: OnOrder) -> None:
        self.address = ""
        self.is_dead = False
        self.loop, self.line, self._simulators, self._on_order = loop, line, simulators, on_order
        self._peers: dict[Any, _Peer] = {}  # by transport, or by UDP's address

    @asynccontextmanager
    async def up(self) -> AsyncIterator[None]:
        """Programs may come."""
        near, datagrams = _pair()
        by_tcp = await self.loop.create_server(lambda: _ByStream(self), sock=near)
        by_line = await self.loop.create_unix_server(lambda: _ByStream(self), str(self.line))
        transport, _ = await self.loop.create_datagram_endpoint(lambda: _ByUdp(self), sock=datagrams)
        self.address = f"tcp:{LOOPBACK}:{near.getsockname()[1]}"
        try:
            yield
        finally:
            by_tcp.close()
            by_line.close()
            transport.close()
            for peer in list(self._peers.values()):
                peer.close()

    def deliver(self) -> None:
        """Let arrive what programs have sent."""
        for peer in list(self._peers.values()):
            for message in peer.taken():
                if not self.is_dead:
                    peer.deliver(message)
                    if moves(message):
                        self._on_order(getattr(message, "target_system", 0), message.get_type())

    def send(self) -> None:
        """Send what the vehicles have said since the last time."""
        for peer in list(self._peers.values()):
            data = peer.drained()
            if data and not self.is_dead:
                peer.write(data)

    def join(self, name: Any, write: Callable[[bytes], object], close: Callable[[], None]) -> _Peer:
        """A program is there."""
        self._peers[name] = _Peer(self._simulators, write, close)
        return self._peers[name]

    def leave(self, name: Any) -> None:
        """It has gone."""
        self._peers.pop(name).part()

    def known(self, name: Any) -> _Peer | None:
        """The program of that name."""
        return self._peers.get(name)


def moves(message: Any) -> bool:
    """Whether it commands a vehicle to fly."""
    try:
        order = orders.order_of(message)
    except (ValueError, OverflowError):  # a number that is none: the vehicle refuses it
        return True
    is_command = isinstance(order, orders.Unknown) and message.get_type().startswith(COMMANDING)
    return is_command or isinstance(order, MOVING)


class _Peer:
    """One program, and its cable to each vehicle."""

    def __init__(
        self, simulators: Sequence[Simulator], write: Callable[[bytes], object], close: Callable[[], None]
    ) -> None:
        self.write, self.close = write, close
        self._arriving: list[Any] = []
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._cables = [(simulator, simulator.open_link("program")) for simulator in simulators]
        for simulator, cable in self._cables:
            system = simulator.options.sysid
            simulator.receive(cable, mavlink.MAVLink_request_data_stream_message(system, 1, 0, STREAM_RATE, 1))

    def hear(self, data: bytes) -> None:
        self._arriving += [one for one in self._parser.parse_buffer(data) or () if one.get_type() != "BAD_DATA"]

    def taken(self) -> list[Any]:
        arriving, self._arriving = self._arriving, []
        return arriving

    def deliver(self, message: Any) -> None:
        for simulator, cable in self._cables:
            simulator.receive(cable, message)

    def drained(self) -> bytes:
        return b"".join(cable.drain() for _, cable in self._cables)

    def part(self) -> None:
        for simulator, cable in self._cables:
            simulator.close_link(cable)


class _ByStream(asyncio.Protocol):
    def __init__(self, link: ProgramLink) -> None:
        self._link = link

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See asyncio.Protocol."""
        self._transport: asyncio.Transport = transport  # type: ignore[assignment]
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, ROOM)
        self._peer = self._link.join(self, self._send, transport.close)

    def _send(self, data: bytes) -> None:
        if not self._transport.get_write_buffer_size():  # else nobody reads: it is lost, as on a radio
            self._transport.write(data)

    def connection_lost(self, error: Exception | None) -> None:
        """See asyncio.Protocol."""
        self._link.leave(self)

    def data_received(self, data: bytes) -> None:
        """See asyncio.Protocol."""
        self._peer.hear(data)


class _ByUdp(asyncio.DatagramProtocol):
    """A program comes with its first datagram, which may be empty."""

    def __init__(self, link: ProgramLink) -> None:
        self._link = link

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See asyncio.DatagramProtocol."""
        self._transport: asyncio.DatagramTransport = transport  # type: ignore[assignment]

    def datagram_received(self, data: bytes, address: Any) -> None:
        """See asyncio.DatagramProtocol."""
        peer = self._link.known(address)
        if peer is None:
            peer = self._link.join(address, partial(self._send, address), partial(self._link.leave, address))
        peer.hear(data)

    def _send(self, address: Any, data: bytes) -> None:
        self._link.loop.about_to_send()  # as a stream does by itself
        self._transport.sendto(data, address)


def _pair() -> tuple[socket.socket, socket.socket]:
    """A TCP and a UDP socket with the same port.

    Raises:
        OSError: no port is free.
    """
    for _ in range(TRIES):
        near, datagrams = socket.create_server((LOOPBACK, 0)), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            datagrams.bind(near.getsockname())
        except OSError as error:
            near.close()
            datagrams.close()
            failure = error
            continue
        datagrams.setblocking(False)
        return near, datagrams
    raise failure
