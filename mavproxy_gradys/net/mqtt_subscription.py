"""A subscription to one topic filter of an MQTT 5 broker, renewed after each outage.

What anybody may publish below the filter must cost little: the broker delivers no packet beyond LARGEST_PACKET, no
queue holds messages, and no message ends the subscription.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from urllib.parse import SplitResult

import aiomqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net.mqtt_client import disconnect, make_client
from mavproxy_gradys.net.outage_log import Defects, Outage
from mavproxy_gradys.net.schedule import Backoff
from mavproxy_uavapi.core.text import reason_of

LONGEST_PAUSE = 20.0  # s between attempts to connect
LARGEST_PACKET = 16 * 1024  # bytes
Take = Callable[[str, object], None]


class MqttSubscription:
    """Passes messages on; their quality of service is 0.

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
        self._broker, self._topic = broker, topic
        self._outage = outage
        self._timeout, self._ca_file = timeout, ca_file
        self._defects = Defects("the reading of the broker's messages")

    async def run(self, take: Take) -> None:
        """Call `take` with the topic and the payload of each message, until cancelled."""
        backoff = Backoff(random.random, LONGEST_PAUSE)
        clock = asyncio.get_running_loop().time
        while True:
            try:
                await self._listen(self._client(take), backoff)
            except (aiomqtt.MqttError, NotDelivered) as error:
                self._outage.update(reason_of(error) or "no answer")
            await asyncio.sleep(backoff.failed(clock()))

    def _client(self, take: Take) -> aiomqtt.Client:
        properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
        properties.MaximumPacketSize = LARGEST_PACKET
        defects = self._defects

        class Taken(asyncio.Queue[aiomqtt.Message]):
            """In the place of the client's queue: takes each message at once."""

            def put_nowait(self, message: aiomqtt.Message) -> None:
                if message.retain:  # nobody knows how old a retained message is
                    return
                try:
                    take(str(message.topic), message.payload)
                except Exception as error:  # noqa: BLE001  one message must not end the subscription
                    defects.report(error)

        return make_client(
            *self._broker,
            self._timeout,
            self._ca_file,
            protocol=aiomqtt.ProtocolVersion.V5,
            properties=properties,
            queue_type=Taken,
        )

    async def _listen(self, client: aiomqtt.Client, backoff: Backoff) -> None:
        try:
            await client.__aenter__()
            await client.subscribe(self._topic, qos=0)
            backoff.succeeded()
            self._outage.update("")
            async for _ in client.messages:  # until the connection ends: `Taken` has none to give
                continue
        finally:
            await disconnect(client)
