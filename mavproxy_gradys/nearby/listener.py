"""Hears the positions that other MAVProxys tell an MQTT broker, and warns of vehicles that come near."""

from __future__ import annotations

import asyncio
import logging
import math
import time
from urllib.parse import unquote

from mavproxy_gradys.forwarding.readings import UAV, device_of
from mavproxy_gradys.nearby.advice import OLD, Advice, OurTracks, Track, heard_in
from mavproxy_gradys.net.addresses import split_url
from mavproxy_gradys.net.mqtt_subscription import MqttSubscription
from mavproxy_gradys.net.outage_log import Outage
from mavproxy_gradys.net.refusal_log import RefusalLog
from mavproxy_gradys.settings import HEARD_TOPIC
from mavproxy_uavapi.core.airspace.model import Place
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition

LOOKED_EVERY = 1.0  # s between looks at the setting `separation`
SAME = 0.2  # s for which our vehicles are taken to be where they were
ELSEWHERE = 50.0  # m from ours, besides what ours may have turned aside, beyond which a position is not ours
log = logging.getLogger("gradys.nearby")


class PositionListener:
    """Subscribes to the positions of others, while there is a `separation`.

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
        self._ours, self._looked_at = OurTracks({}, 0.0), float("-inf")
        self._places: dict[str, Track | None] = {}  # of our vehicles, in the air or not; None while it is not known
        self._old = RefusalLog(log, host.clock, "positions are old or by a wrong clock")
        namesakes = "positions of others have a name of ours, so nobody is warned of them: `gradys set device`"
        self._namesakes = RefusalLog(log, host.clock, namesakes)
        parts, port = split_url(url, ("mqtt", "mqtts"))
        name = f"the broker {parts.hostname}:{port}"
        outage = Outage(log, f"no positions of others from {name}", f"positions of others from {name} again")
        topic = unquote(url.partition("://")[2].partition("/")[2]) or HEARD_TOPIC  # a # is no fragment
        self._subscription = MqttSubscription((parts, port), topic, outage, timeout, ca_file)

    async def run(self) -> None:
        """Listen, until cancelled."""
        while True:
            await self._until(wanted=True)
            both = [asyncio.ensure_future(one) for one in (self._hear(), self._until(False))]
            try:
                done, _ = await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for one in both:
                    one.cancel()
                await asyncio.gather(*both, return_exceptions=True)
            for one in done:
                one.result()

    async def _until(self, wanted: bool) -> None:
        """Wait until there is a separation, or none."""
        while bool(self._host.registry.traffic.separation) != wanted:  # noqa: ASYNC110  a setting of another module
            await asyncio.sleep(LOOKED_EVERY)

    async def _hear(self) -> None:
        await self._subscription.run(lambda _topic, payload: self._take(payload))

    def _take(self, payload: bytes) -> None:
        separation = self._host.registry.traffic.separation
        heard = heard_in(payload) if separation else None
        if heard is None:
            return
        now, age = self._host.clock(), time.time() - heard.time
        self._look(now)
        if abs(age) > OLD:
            if heard.device not in self._places:
                self._old.add(heard.device, f"measured {age:.0f} s ago")
            return
        if heard.device in self._places:  # the broker has the positions of our vehicles, too
            away = away_from(self._places[heard.device], heard.place, now - age)
            if away > 0.0:
                self._namesakes.add(heard.device, f"{away:.0f} m from ours")
            return
        for sentence in self._advice.hear(heard, now - age, self._ours, separation, now):
            log.warning("%s", sentence)
            self._host.warn(sentence)

    def _look(self, now: float) -> None:
        """Look where our vehicles are, if that is some time ago."""
        if now - self._looked_at < SAME:
            return
        self._looked_at, flying = now, {}
        self._places = dict.fromkeys(device_of(system, self._device) for system in self._host.fleet.vehicles)
        for state in self._host.fleet.vehicles.values():
            received = state.messages.get("GLOBAL_POSITION_INT")
            if received is not None and now - received.at < OLD:
                here, name = GlobalPosition.of(received.message), device_of(state.system, self._device)
                self._places[name] = track = Track(here.place, here.velocity[:2], received.at)
                if state.armed and not state.landed:
                    flying[name] = track
        self._ours = OurTracks(flying, now)


def away_from(ours: Track | None, place: Place, at: float) -> float:
    """Metres from ours to a place, if they cannot be one at `at` (s); 0 if they can.

    Ours was measured seconds before or after, and may have turned in between.
    """
    if ours is None:
        return 0.0
    metres = math.hypot(*offset(*ours.moved_to(at).place, *place))
    turned = 2 * math.hypot(*ours.velocity) * abs(at - ours.at)
    return metres if metres > ELSEWHERE + turned else 0.0
