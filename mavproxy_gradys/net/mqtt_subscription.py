"""A subscription to one topic filter of an MQTT broker, renewed after each outage."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from urllib.parse import SplitResult

import aiomqtt

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net.mqtt_client import disconnect, make_client
from mavproxy_gradys.net.outage_log import Defects, Outage
from mavproxy_gradys.net.schedule import Backoff
from mavproxy_uavapi.core.text import reason_of

LONGEST_PAUSE = 20.0  # s between attempts to connect
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
        self._defects = Defects("what a message of a broker causes")

    async def run(self, take: Take) -> None:
        """Call `take` with the topic and the payload of each message, until cancelled."""
        backoff = Backoff(random.random, LONGEST_PAUSE)
        clock = asyncio.get_running_loop().time
        while True:
            try:
                await self._listen(make_client(*self._broker, self._timeout, self._ca_file), take, backoff)
            except (aiomqtt.MqttError, NotDelivered) as error:
                self._outage.update(reason_of(error) or "no answer")
            await asyncio.sleep(backoff.failed(clock()))

    def _pass_on(self, take: Take, topic: str, payload: object) -> None:
        try:
            take(topic, payload)
        except Exception as error:  # noqa: BLE001  one bad message must not end the listening for ever
            self._defects.report(error)

    async def _listen(self, client: aiomqtt.Client, take: Take, backoff: Backoff) -> None:
        try:
            await client.__aenter__()
            await client.subscribe(self._topic, qos=0)
            backoff.succeeded()
            self._outage.update("")
            async for message in client.messages:
                if not message.retain:  # nobody knows how old a retained message is
                    self._pass_on(take, str(message.topic), message.payload)
        finally:
            await disconnect(client)
