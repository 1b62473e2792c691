"""The MQTT sink: each reading to its topic with QoS 1; the broker's PUBACK is the acknowledgement.

The URL's path is the topic; {sysid}, {device} and {quantity} stand for the reading's values:
`mqtt://broker/fleet/{device}/{quantity}`. Positions are retained, so that a new subscriber gets the last one at once.
Beside them each vehicle's retained topic `status` has `online`; by our last will the broker sets it to `offline` when
the connection breaks. A connection has one will, so each status topic has its own connection. It keeps its client id:
a new one ends the one before at the broker, whose will is then not published after the new one's `online`.

With `#ack=station` at the end of the URL the station's confirmation is the acknowledgement; see `confirmations.py`.
Unconfirmed readings are published again, so they expire at the broker after EXPIRY, retained positions too.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import uuid
from collections import defaultdict
from collections.abc import Awaitable, Sequence
from urllib.parse import unquote

import aiomqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding.confirmations import LARGEST, QUIET, Confirmations
from mavproxy_gradys.forwarding.quantities import OFFLINE, ONLINE, POSITION, STATUS
from mavproxy_gradys.forwarding.readings import CONFIRMED_TOPIC, UAV, Reading, Stored, device_of
from mavproxy_gradys.forwarding.sink_address import DEFAULT_TOPIC
from mavproxy_gradys.net.addresses import split_url
from mavproxy_gradys.net.mqtt_client import disconnect, make_client
from mavproxy_gradys.net.resolver import Resolver
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.text import reason_of
from mavproxy_uavapi.core.timeout import kept, wait_with_timeout

WINDOW = 20  # readings in flight at once on one connection
CLOSE_TIMEOUT = 1.0  # s
CONFIRMATION_TIMEOUT = 20.0  # s for a station's confirmation; long, because sending again would add to its load
EXPIRY = 60  # s


class MqttSink:
    """Publishes to one broker.

    Args:
        url: mqtt(s)://[USER:PASSWORD@]HOST[:PORT]/TOPIC.
        timeout: s for an answer of the broker.
        ca_file: as for `Client`.
        station_confirms: whether the station acknowledges, not the broker.
        device: the beginning of the device names of our vehicles.
    """

    def __init__(
        self, url: str, timeout: float, ca_file: str, station_confirms: bool = False, device: str = UAV
    ) -> None:
        self._device = device
        self._parts, self._port = split_url(url, ("mqtt", "mqtts"))
        self._topic = unquote(self._parts.path.lstrip("/")) or DEFAULT_TOPIC
        self._timeout = timeout
        self._ca_file = ca_file
        self._station_confirms = station_confirms
        self._confirmations: defaultdict[str, Confirmations] = defaultdict(Confirmations)  # by status topic
        self._reply_topics: dict[str, str] = {}  # by status topic
        self._clients: dict[str, aiomqtt.Client] = {}  # by status topic
        self._client_ids: defaultdict[str, str] = defaultdict(lambda: uuid.uuid4().hex)  # by status topic
        self._names = Resolver()
        self._connecting: defaultdict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._tasks = HeldTasks()
        self._leaving: dict[str, asyncio.Task[None]] = {}  # abandoned attempts to connect, by status topic

    async def send(self, batch: Sequence[Stored]) -> set[int]:
        """See `Sink.send`; in order on each connection."""
        by_status: defaultdict[str, list[Stored]] = defaultdict(list)
        for stored in batch:
            by_status[status_topic(self._topic, stored.reading, self._device)].append(stored)
        await self._reach(next(iter(by_status)))
        sending = [self._send(status, part) for status, part in by_status.items()]
        results = await asyncio.gather(*sending, return_exceptions=True)
        taken: set[int] = set()
        failed: list[NotDelivered] = []
        for result in results:
            if isinstance(result, NotDelivered):
                failed.append(result)
            elif isinstance(result, BaseException):
                raise result
            else:
                taken |= result
        if failed and not taken:
            raise failed[0]
        return taken

    async def _reach(self, status: str) -> None:
        """Check on one connection whether the broker answers; if not, the others need not try."""
        try:
            await self._client(status)
        except aiomqtt.MqttError as error:
            raise NotDelivered(self._explain(error)) from error

    async def _send(self, status: str, batch: Sequence[Stored]) -> set[int]:
        if not self._station_confirms:
            return await self._publish_all(status, batch)
        confirmations, numbers = self._confirmations[status], {stored.seq for stored in batch}
        if late := confirmations.collect(numbers):
            return late
        # A reading that was not confirmed when it was published first delays the others no longer than it must.
        timeout = CONFIRMATION_TIMEOUT if confirmations.expect(numbers) else QUIET
        published = await self._publish_all(status, batch)
        confirmed = await confirmations.wait(published, timeout)
        if not confirmed:
            raise NotDelivered(f"{self._broker_name}: published, but no station has confirmed it", reached=True)
        return confirmed

    async def _publish_all(self, status: str, batch: Sequence[Stored]) -> set[int]:
        """Publish readings; the numbers of those that the broker has acknowledged.

        Raises:
            NotDelivered: it has acknowledged none.
        """
        try:
            client = await self._client(status)
            window = asyncio.Semaphore(WINDOW)
            properties = self._properties(status)
            publishing = [self._publish(client, window, stored, properties) for stored in batch]
            results = await asyncio.gather(*publishing, return_exceptions=True)
        except aiomqtt.MqttError as error:
            raise NotDelivered(self._explain(error)) from error
        for result in results:
            if isinstance(result, BaseException) and not isinstance(result, aiomqtt.MqttError):
                raise result
        taken = {stored.seq for stored, result in zip(batch, results, strict=True) if result is None}
        if len(taken) < len(batch):
            await self._drop(status)
        if not taken:
            raise NotDelivered(self._explain(next(result for result in results if result is not None)))
        return taken

    def _is_position(self, reading: Reading) -> bool:
        """Whether the reading is a vehicle's own position, which is retained for new subscribers."""
        return reading.quantity == POSITION and reading.device == device_of(reading.system, self._device)

    async def _publish(
        self, client: aiomqtt.Client, window: asyncio.Semaphore, stored: Stored, properties: Properties | None
    ) -> None:
        topic = topic_of(self._topic, stored.reading)
        payload = json.dumps(stored.body(), allow_nan=False)
        async with window:
            await client.publish(
                topic, payload, qos=1, retain=self._is_position(stored.reading), properties=properties
            )

    def _properties(self, status: str) -> Properties | None:
        """The properties of a reading: the topic for the station's confirmation, and the expiry."""
        if not self._station_confirms:
            return None
        properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
        properties.ResponseTopic = self._reply_topic(status)
        properties.MessageExpiryInterval = EXPIRY
        return properties

    def _reply_topic(self, status: str) -> str:
        return self._reply_topics.setdefault(status, f"{CONFIRMED_TOPIC}{uuid.uuid4().hex}")

    async def _client(self, status: str) -> aiomqtt.Client:
        """The connection whose last will is for that topic; opened if necessary.

        Raises:
            aiomqtt.MqttError: the broker does not accept it.
        """
        async with self._connecting[status]:
            if status not in self._clients:
                self._clients[status] = await self._connect(status)
            return self._clients[status]

    async def _connect(self, status: str) -> aiomqtt.Client:
        """Open a connection and publish `online`. One that opens too late is closed.

        Raises:
            aiomqtt.MqttError: the broker does not accept it in time.
        """
        if status in self._leaving:
            raise aiomqtt.MqttError("the last attempt to connect has not ended yet")
        # The name is looked up in a thread of its own, not in the pool that other work needs.
        await self._within(self._names.look_up(self._parts.hostname or "", self._port))
        client = self._make(status)
        connecting = asyncio.ensure_future(client.__aenter__())
        try:
            await self._within(kept(connecting))
            await client.publish(status, ONLINE, qos=1, retain=True)
            if self._station_confirms:
                await client.subscribe(self._reply_topic(status), qos=0)
                self._confirmations[status].begin()
                self._tasks.start(listen(client, self._confirmations[status]), "the reading of confirmations")
        except BaseException:
            leaving = self._leaving[status] = self._tasks.start(
                leave(client, connecting), f"the closing of a connection to {self._broker_name}"
            )
            leaving.add_done_callback(lambda _: self._leaving.pop(status))
            raise
        return client

    async def _within(self, answer: Awaitable[object]) -> None:
        """Wait for an answer, at most for the setting `timeout`.

        Raises:
            aiomqtt.MqttError: it took longer, or failed.
        """
        try:
            await wait_with_timeout(self._timeout, answer)
        except (asyncio.TimeoutError, OSError) as error:
            raise aiomqtt.MqttError(reason_of(error) or f"no answer within {self._timeout:g} s") from error

    def _make(self, status: str) -> aiomqtt.Client:
        properties = None
        if self._station_confirms:
            properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
            properties.MaximumPacketSize = LARGEST
        return make_client(
            self._parts,
            self._port,
            self._timeout,
            self._ca_file,
            identifier=self._client_ids[status],
            max_inflight_messages=WINDOW,
            will=aiomqtt.Will(status, OFFLINE, qos=1, retain=True),
            protocol=aiomqtt.ProtocolVersion.V5 if self._station_confirms else aiomqtt.ProtocolVersion.V311,
            properties=properties,
        )

    def _explain(self, error: BaseException | None) -> str:
        return f"{self._broker_name}: {(reason_of(error) if error else '') or 'no answer'}"

    @property
    def _broker_name(self) -> str:
        return f"broker {self._parts.hostname}:{self._port}"

    async def _drop(self, status: str) -> None:
        """Close a connection; the next batch opens a new one."""
        client = self._clients.pop(status, None)
        if client is not None:
            await disconnect(client)

    async def close(self) -> None:
        """Publish `offline` and close: after an orderly close the broker does not publish the will."""

        async def go_offline(status: str, client: aiomqtt.Client) -> None:
            with contextlib.suppress(aiomqtt.MqttError, asyncio.TimeoutError):
                await wait_with_timeout(CLOSE_TIMEOUT, client.publish(status, OFFLINE, qos=1, retain=True))
            await self._drop(status)

        if self._leaving:
            await asyncio.wait(self._leaving.values(), timeout=CLOSE_TIMEOUT)
        await asyncio.gather(*(go_offline(status, client) for status, client in list(self._clients.items())))


async def listen(client: aiomqtt.Client, confirmations: Confirmations) -> None:
    """Read the station's confirmations until the connection ends."""
    try:
        async for message in client.messages:
            confirmations.take(message.payload)
    except aiomqtt.MqttError:
        return
    finally:
        confirmations.end()


async def leave(client: aiomqtt.Client, connecting: asyncio.Future[aiomqtt.Client]) -> None:
    """Close a connection once the attempt to open it has ended; the attempt cannot be aborted."""
    await asyncio.gather(connecting, return_exceptions=True)
    await disconnect(client)


def topic_of(template: str, reading: Reading) -> str:
    """The topic of a reading."""
    return fill(template, reading.system, reading.device, reading.quantity)


def status_topic(template: str, reading: Reading, device: str = UAV) -> str:
    """The topic for `online` and `offline` of the reading's vehicle, beside the topics of its readings.

    A reading of another device of that vehicle has the same one: each status topic needs a connection.

    Args:
        template: the topic of readings.
        reading: the reading.
        device: the beginning of the device names of our vehicles.
    """
    vehicle = device_of(reading.system, device)
    if "{quantity}" in template:
        return fill(template, reading.system, vehicle, STATUS)
    return f"{fill(template, reading.system, vehicle, '')}/{STATUS}"


def fill(template: str, system: int, device: str, quantity: str) -> str:
    """The template with these names filled in."""
    names = {"{sysid}": str(system), "{device}": device, "{quantity}": quantity}
    for name, value in names.items():
        template = template.replace(name, value)
    return template
