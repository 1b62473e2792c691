"""Hears the positions that other MAVProxys tell an MQTT broker, and warns of vehicles that come near."""

from __future__ import annotations

import logging
from urllib.parse import unquote

from mavproxy_gradys.forwarding.readings import UAV, device_of
from mavproxy_gradys.nearby.advice import Advice, Track
from mavproxy_gradys.net.addresses import split_url
from mavproxy_gradys.net.mqtt_subscription import MqttSubscription
from mavproxy_gradys.net.outage_log import Outage
from mavproxy_uavapi.core.host import Host

DEFAULT_TOPIC = "fleet/+/position"
log = logging.getLogger("gradys.nearby")


class PositionListener:
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
        self._advice = Advice()
        parts, port = split_url(url, ("mqtt", "mqtts"))
        name = f"the broker {parts.hostname}:{port}"
        outage = Outage(log, f"no positions of others from {name}", f"positions of others from {name} again")
        topic = unquote(parts.path.lstrip("/")) or DEFAULT_TOPIC
        self._subscription = MqttSubscription((parts, port), topic, outage, timeout, ca_file)

    async def run(self) -> None:
        """Listen, until cancelled."""
        await self._subscription.run(lambda _topic, payload: self._take(payload))

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
