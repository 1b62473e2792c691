"""Hears the positions that other MAVProxys tell an MQTT broker, and warns of vehicles that come near."""

from __future__ import annotations

import asyncio
import logging
import random
from urllib.parse import unquote

import aiomqtt

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding.mqtt_sink import disconnect
from mavproxy_gradys.forwarding.readings import UAV, device_of
from mavproxy_gradys.nearby.advice import Advice, Track
from mavproxy_gradys.net.addresses import split_url
from mavproxy_gradys.net.mqtt_client import make_client
from mavproxy_gradys.net.outage_log import Outage
from mavproxy_gradys.net.schedule import Backoff
from mavproxy_uavapi.core.host import Host

DEFAULT_TOPIC = "fleet/+/position"
LONGEST_PAUSE = 20.0  # s between attempts to connect
log = logging.getLogger("gradys.nearby")


class Listener:
    """Subscribes to the positions of others.

    Args:
        host: our vehicles, and their `separation`.
        url: mqtt(s)://[USER:PASSWORD@]HOST[:PORT][/TOPIC]
        timeout: s for an answer of the broker.
        ca_file: certificates to check TLS with; empty for the system's.
        device: the beginning of the device names of our vehicles.
    """

    def __init__(self, host: Host, url: str, timeout: float, ca_file: str, device: str = UAV) -> None:
        self._host = host
        self._device = device
        self._parts, self._port = split_url(url, ("mqtt", "mqtts"))
        self._topic = unquote(self._parts.path.lstrip("/")) or DEFAULT_TOPIC
        self._timeout = timeout
        self._ca_file = ca_file
        self._advice = Advice()
        name = f"the broker {self._parts.hostname}:{self._port}"
        self._outage = Outage(log, f"no positions of others from {name}", f"positions of others from {name} again")

    async def run(self) -> None:
        """Listen, until cancelled."""
        backoff = Backoff(random.random, LONGEST_PAUSE)
        while True:
            try:
                client = make_client(self._parts, self._port, self._timeout, self._ca_file)
                await self._listen(client, backoff)
            except (aiomqtt.MqttError, NotDelivered) as error:
                self._outage.update(str(error) or "no answer")
            await asyncio.sleep(backoff.failed(self._host.clock()))

    async def _listen(self, client: aiomqtt.Client, backoff: Backoff) -> None:
        try:
            await client.__aenter__()
            await client.subscribe(self._topic, qos=0)
            backoff.succeeded()
            self._outage.update("")
            async for message in client.messages:
                if not message.retain:  # nobody knows how old a retained position is
                    self._take(message.payload)
        finally:
            await disconnect(client)

    def _take(self, payload: object) -> None:
        if isinstance(payload, bytes | str) and self._advice.take(payload, self._host.clock()):
            separation, now = self._host.registry.traffic.separation, self._host.clock()
            names = {device_of(system, self._device) for system in self._host.fleet.vehicles}
            for sentence in self._advice.warnings(self._in_the_air(), names, separation, now):
                log.warning("%s", sentence)
                self._host.warn(sentence)

    def _in_the_air(self) -> dict[str, Track]:
        tracks = {}
        for state in self._host.fleet.vehicles.values():
            received = state.messages.get("GLOBAL_POSITION_INT")
            if received is not None and state.armed and not state.landed:
                at = received.message
                place, velocity = (at.lat / 1e7, at.lon / 1e7), (at.vx / 100, at.vy / 100)
                tracks[device_of(state.system, self._device)] = Track(place, velocity, received.at)
        return tracks
