"""A subscription to one topic filter of an MQTT 5 broker, renewed after each outage.

What anybody may publish below the filter must cost little: the broker delivers no packet beyond LARGEST_PACKET, what
comes is read each PAUSE, nothing is kept, and no message ends the subscription.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from typing import cast
from urllib.parse import SplitResult, unquote

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net import mqtt_packets as mqtt
from mavproxy_gradys.net.http_client import tls_context
from mavproxy_gradys.net.outage_log import Defects, Outage
from mavproxy_gradys.net.resolver import Resolver
from mavproxy_gradys.net.schedule import Backoff
from mavproxy_uavapi.core.text import reason_of
from mavproxy_uavapi.core.timeout import wait_with_timeout

LONGEST_PAUSE = 20.0  # s between attempts to connect
LARGEST_PACKET = 16 * 1024  # bytes
PAUSE = 0.1  # s between reads: to read many messages at once costs little more than to read one
KEEP_ALIVE = 15  # s; the broker closes a silent connection after 1.5 times this
REFUSALS = {  # reason codes of a CONNACK; 1 is that of an older broker
    0x01: "it does not know MQTT 5",
    0x84: "it does not know MQTT 5",
    0x86: "it refuses the user name or the password",
    0x87: "it refuses this client",
}
Take = Callable[[str, bytes], None]


class MqttSubscription:
    """Passes messages on, but those that the broker has retained: nobody knows how old they are.

    Args:
        broker: the parts and the port of mqtt(s)://[USER:PASSWORD@]HOST[:PORT].
        topic: the topic filter.
        outage: reports when the broker goes and comes back.
        timeout: s for an answer of the broker.
        ca_file: certificates to check TLS with; empty for the system's.
    """

    def __init__(
        self, broker: tuple[SplitResult, int], topic: str, outage: Outage, timeout: float, ca_file: str
    ) -> None:
        self._address, self._port = broker
        self._topic = topic
        self._outage = outage
        self._timeout, self._ca_file = timeout, ca_file
        self._names = Resolver()
        self._defects = Defects("the reading of the broker's messages")

    async def run(self, take: Take) -> None:
        """Call `take` with the topic and the payload of each message, until cancelled."""
        backoff = Backoff(random.random, LONGEST_PAUSE)
        clock = asyncio.get_running_loop().time
        while True:
            connection = _Connection(self._greeting(), self._topic, take, self._defects)
            try:
                await wait_with_timeout(self._timeout, self._open(connection))
                await wait_with_timeout(self._timeout, connection.subscribed)
                backoff.succeeded()
                self._outage.update("")
                await connection.keep()
            except (OSError, asyncio.TimeoutError, NotDelivered) as error:
                self._outage.update(reason_of(error) or "no answer")
            finally:
                connection.close()
            await asyncio.sleep(backoff.failed(clock()))

    def _greeting(self) -> bytes:
        user, password = self._address.username, self._address.password
        return mqtt.connect(user and unquote(user), password and unquote(password), KEEP_ALIVE, LARGEST_PACKET)

    async def _open(self, connection: _Connection) -> None:
        """Connect to the first address of the broker that takes a connection.

        Raises:
            OSError, NotDelivered: none does; the CA file cannot be used.
        """
        host, failure = self._address.hostname or "", OSError("it has no address")
        tls = tls_context(self._ca_file) if self._address.scheme == "mqtts" else None
        loop = asyncio.get_running_loop()
        for *_, address in await self._names.look_up(host, self._port):
            try:
                await loop.create_connection(
                    lambda: connection, *address[:2], ssl=tls, server_hostname=host if tls else None
                )
            except OSError as error:
                failure = error
            else:
                return
        raise failure


class _Connection(asyncio.Protocol):
    """One connection to the broker.

    Attributes:
        subscribed: done when the broker has taken the subscription.
        ended: gets the error with which the connection ends.

    Args:
        greeting: the first packet.
        topic: the topic filter.
        take: gets each message.
        defects: gets the errors of `take`.
    """

    def __init__(self, greeting: bytes, topic: str, take: Take, defects: Defects) -> None:
        loop = asyncio.get_running_loop()
        self.subscribed: asyncio.Future[None] = loop.create_future()
        self.ended: asyncio.Future[None] = loop.create_future()
        self._greeting, self._topic = greeting, topic
        self._take, self._defects = take, defects
        self._packets = mqtt.Packets(LARGEST_PACKET)
        self._transport: asyncio.Transport | None = None
        self._resuming: asyncio.TimerHandle | None = None
        self._reads = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Say hello."""
        self._transport = cast(asyncio.Transport, transport)
        self._transport.write(self._greeting)

    def data_received(self, data: bytes) -> None:
        """Take the packets; the next ones wait at the broker for a moment."""
        assert self._transport is not None
        self._reads += 1
        self._transport.pause_reading()
        self._resuming = asyncio.get_running_loop().call_later(PAUSE, self._transport.resume_reading)
        try:
            for packet in self._packets.feed(data):
                self._take_packet(packet, self._transport)
        except (NotDelivered, ValueError) as error:
            self._end(error if isinstance(error, NotDelivered) else NotDelivered(f"it speaks no MQTT 5: {error}"))

    def _take_packet(self, packet: mqtt.Packet, transport: asyncio.Transport) -> None:
        """Take one packet.

        Raises:
            NotDelivered, ValueError: the broker refuses or ends the connection; it is no packet for a subscriber.
        """
        if packet.kind == mqtt.PUBLISH:
            topic, payload = mqtt.published(packet)
            if packet.flags & mqtt.RETAINED:
                return
            try:
                self._take(topic, payload)
            except Exception as error:  # noqa: BLE001  one message must not end the subscription
                self._defects.report(error)
        elif packet.kind == mqtt.CONNACK:
            code = mqtt.reason_code(packet)
            if code:
                raise NotDelivered(REFUSALS.get(code, f"it refuses the connection ({code:#x})"))
            transport.write(mqtt.subscribe(self._topic))
        elif packet.kind == mqtt.SUBACK:
            code = mqtt.reason_code(packet)
            if code >= mqtt.FAILED:
                raise NotDelivered(f"it refuses the topic {self._topic} ({code:#x})")
            if not self.subscribed.done():
                self.subscribed.set_result(None)
        elif packet.kind == mqtt.DISCONNECT:
            raise NotDelivered(f"it ends the connection ({mqtt.reason_code(packet):#x})")
        elif packet.kind != mqtt.PONG:
            raise ValueError(f"a packet of kind {packet.kind}")

    async def keep(self) -> None:
        """Keep the connection until it ends.

        Raises:
            OSError, NotDelivered: why it has ended.
        """
        assert self._transport is not None
        while True:
            reads = self._reads
            self._transport.write(mqtt.PING)
            await asyncio.wait({self.ended}, timeout=KEEP_ALIVE / 2)
            if self.ended.done():
                self.ended.result()
            if self._reads == reads:
                raise NotDelivered("no answer")

    def connection_lost(self, error: Exception | None) -> None:
        """Note that it is over."""
        if self._resuming is not None:
            self._resuming.cancel()
        self._end(error if isinstance(error, OSError) else NotDelivered("it closed the connection"))

    def close(self) -> None:
        """Say goodbye, if there is a connection."""
        self._end(NotDelivered("it is closed"))
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write(mqtt.BYE)
            self._transport.close()

    def _end(self, error: Exception) -> None:
        for one in (self.subscribed, self.ended):
            if not one.done():
                one.set_exception(error)
                one.exception()  # perhaps nobody waits any more
