"""A connection to an MQTT 5 broker: paho's client, run by the asyncio loop, with manual acknowledgements.

A shared subscription delivers each message to one of its workers. The session outlasts a connection: unacknowledged
messages are delivered again. The receive maximum limits the number of messages in flight to us. While the inbox is
full, nothing is read, so that TCP makes the broker wait.
"""

from __future__ import annotations

import asyncio
import logging
import random
import socket
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any
from urllib.parse import unquote

from paho.mqtt import client as mqtt
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.subscribeoptions import SubscribeOptions

from mavproxy_gradys.net.addresses import split_url
from mavproxy_gradys.net.http_client import ssl_context
from mavproxy_gradys.net.outage_log import Outage
from mavproxy_gradys.net.schedule import Backoff
from mavproxy_gradys.station.inbox import Inbox, Message
from mavproxy_uavapi.core.timeout import wait_with_timeout

KEEP_ALIVE = 15  # s
CONNECT_TIMEOUT = 5.0  # s
LONGEST_PAUSE = 5.0  # s between attempts
MISC_EVERY = 1.0  # s between checks of the keep-alive
AT_ONCE = 200  # packets read in one turn of the loop
LARGEST_PACKET = 128 * 1024  # bytes; the broker does not deliver larger ones
log = logging.getLogger("station.broker")


@dataclass(frozen=True)
class BrokerAddress:
    """The broker, and the subscription.

    Attributes:
        url: mqtt(s)://[USER:PASSWORD@]HOST[:PORT]
        topic: the topic filter.
        group: the name of the group of workers that share the subscription.
        name: the name of this worker and of its session.
        session: s for which the broker keeps messages for a disconnected worker.
        receive_maximum: largest number of messages in flight to us.
        ca_file: certificates to check TLS with; empty for the system's.
    """

    url: str
    topic: str
    group: str
    name: str
    session: int
    receive_maximum: int
    ca_file: str


class BrokerConnection:
    """Keeps a connection to the broker.

    Attributes:
        connected: whether it is connected and subscribed.
        problem: why it is not; empty while connected.

    Args:
        address: the broker.
        inbox: gets each message.

    Raises:
        SettingError: the URL is malformed.
        NotDelivered: the CA file cannot be read.
    """

    def __init__(self, address: BrokerAddress, inbox: Inbox) -> None:
        self._address = address
        self._parts, self._port = split_url(address.url, ("mqtt", "mqtts"))
        self._context = ssl_context(address.ca_file) if self._parts.scheme == "mqtts" else None
        self._inbox = inbox
        inbox.on_taken = self._read_on
        self._paused = False
        self._client: mqtt.Client | None = None  # of the present attempt
        self._ended = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._thread = threading.get_ident()
        self._outage = Outage(log, "no messages from the broker", "messages from the broker again")
        self._taken = 0
        self.connected = False
        self.problem = "not connected yet"

    async def run(self) -> None:
        """Keep connected, until cancelled."""
        backoff = Backoff(random.random, LONGEST_PAUSE)
        while True:
            client = self._client = self._make()
            self._ended.clear()
            try:
                await self._connect(client)
                await self._attend(client, backoff)
            except (OSError, ValueError, asyncio.TimeoutError) as error:
                self._failed(str(error) or "no answer")
            finally:
                self._client, self.connected = None, False
                self._leave(client)
            await asyncio.sleep(backoff.failed(time.monotonic()))

    def _failed(self, why: str) -> None:
        self.connected = False
        self.problem = f"{self._parts.hostname}:{self._port}: {why}"
        self._outage.update(self.problem)

    def _make(self) -> mqtt.Client:
        address, parts = self._address, self._parts
        client = mqtt.Client(
            CallbackAPIVersion.VERSION2,
            client_id=address.name,
            protocol=mqtt.MQTTv5,
            manual_ack=True,
        )
        client.connect_timeout = CONNECT_TIMEOUT
        if parts.username:
            client.username_pw_set(unquote(parts.username), unquote(parts.password or ""))
        if parts.scheme == "mqtts":
            client.tls_set_context(self._context)
        client.on_connect = self._on_connect
        client.on_subscribe = self._on_subscribe
        client.on_disconnect = self._on_disconnect
        client.on_message = self._on_message
        client.on_socket_open = lambda client, _, sock: self._in_loop(self._watch, client, sock)
        client.on_socket_close = lambda _, __, sock: self._in_loop(self._unwatch, sock)
        client.on_socket_register_write = lambda client, _, sock: self._in_loop(self._watch_writing, client, sock)
        client.on_socket_unregister_write = lambda _, __, sock: self._in_loop(self._loop.remove_writer, sock)
        return client

    async def _connect(self, client: mqtt.Client) -> None:
        """Open the connection in a thread, because it looks up a name and waits.

        Raises:
            OSError, ValueError: it cannot be opened.
            asyncio.TimeoutError: it takes too long.
        """
        properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
        properties.SessionExpiryInterval = self._address.session
        properties.ReceiveMaximum = self._address.receive_maximum
        properties.MaximumPacketSize = LARGEST_PACKET
        host = self._parts.hostname or ""
        connecting = self._loop.run_in_executor(
            None, lambda: client.connect(host, self._port, KEEP_ALIVE, clean_start=False, properties=properties)
        )
        await wait_with_timeout(2 * CONNECT_TIMEOUT, connecting)

    async def _attend(self, client: mqtt.Client, backoff: Backoff) -> None:
        """Handle the keep-alive until the connection ends."""
        began = time.monotonic()
        while not self._ended.is_set():
            client.loop_misc()
            if self.connected:
                backoff.succeeded()
            elif time.monotonic() - began > CONNECT_TIMEOUT:
                raise asyncio.TimeoutError
            try:
                await wait_with_timeout(MISC_EVERY, self._ended.wait())
            except asyncio.TimeoutError:
                continue

    # -- paho's callbacks ---------------------------------------------------------------------------------

    def _on_connect(self, client: mqtt.Client, _data: Any, _flags: Any, code: Any, _properties: Any) -> None:
        if code.is_failure:
            self._failed(str(code))
            self._ended.set()
            return
        topic = f"$share/{self._address.group}/{self._address.topic}"
        client.subscribe(topic, options=SubscribeOptions(qos=1))

    def _on_subscribe(self, _client: mqtt.Client, _data: Any, _mid: int, codes: Any, _properties: Any) -> None:
        if any(code.is_failure for code in codes):
            self._failed(f"it refuses the subscription: {codes[0]}")
            self._ended.set()
            return
        self.connected, self.problem = True, ""
        self._outage.update("")
        log.info("connected to %s:%d", self._parts.hostname, self._port)

    def _on_disconnect(self, client: mqtt.Client, _data: Any, _flags: Any, code: Any, _properties: Any) -> None:
        if client is self._client and not self._ended.is_set():  # after a refusal its reason stays
            self._failed(str(code))
            self._ended.set()

    def _on_message(self, client: mqtt.Client, _data: Any, message: mqtt.MQTTMessage) -> None:
        self._taken += 1
        reply_to = getattr(message.properties, "ResponseTopic", "")
        try:
            topic = message.topic
        except UnicodeDecodeError:
            topic = "?"
        self._inbox.put(Message(client, message.mid, topic, bytes(message.payload), reply_to))

    # -- to the broker ------------------------------------------------------------------------------------

    def acknowledge(self, messages: Iterable[Message]) -> None:
        """Acknowledge stored messages; those of an earlier connection cannot be acknowledged and will come again."""
        for message in messages:
            if message.mid and message.connection is self._client and self._client is not None:
                self._client.ack(message.mid, 1)

    def publish(self, topic: str, payload: str) -> None:
        """Publish a message that may be lost; without a connection nothing is sent."""
        if self.connected and self._client is not None:
            self._client.publish(topic, payload, qos=0)

    # -- the sockets, in the loop -------------------------------------------------------------------------

    def _in_loop(self, work: Callable[..., Any], *args: Any) -> None:
        """Call `work` in the loop's thread; paho connects in another thread."""
        if threading.get_ident() == self._thread:
            work(*args)
        else:
            self._loop.call_soon_threadsafe(work, *args)

    def _watch(self, client: mqtt.Client, sock: Any) -> None:
        if client is not self._client:  # the attempt was abandoned
            sock.close()
        elif sock.fileno() >= 0:
            self._loop.add_reader(sock, self._read, client)

    def _unwatch(self, sock: Any) -> None:
        if sock.fileno() >= 0:
            self._loop.remove_reader(sock)
            self._loop.remove_writer(sock)

    def _watch_writing(self, client: mqtt.Client, sock: Any) -> None:
        if sock.fileno() >= 0:
            self._loop.add_writer(sock, client.loop_write)

    def _read(self, client: mqtt.Client) -> None:
        """Read the available packets while the inbox has room; TLS may hold more than the socket shows."""
        for _ in range(AT_ONCE):
            if not self._inbox.has_room(client):
                self._pause(client)
                return
            before = self._taken
            client.loop_read()
            if self._taken == before:
                return
        self._loop.call_soon(self._read, client)

    def _pause(self, client: mqtt.Client) -> None:
        """Read nothing until the consumer has taken a batch."""
        sock = client.socket()
        if client is self._client and isinstance(sock, socket.socket) and sock.fileno() >= 0:
            self._paused = True
            self._loop.remove_reader(sock)

    def _read_on(self) -> None:
        """Read again after a pause."""
        client, paused, self._paused = self._client, self._paused, False
        if paused and client is not None and (sock := client.socket()) is not None:
            self._watch(client, sock)
            self._loop.call_soon(self._read, client)

    def _leave(self, client: mqtt.Client) -> None:
        """Disconnect, and close the socket."""
        client.disconnect()
        client.loop_write()
        open_socket = client.socket()
        if isinstance(open_socket, socket.socket):
            self._unwatch(open_socket)
            open_socket.close()
