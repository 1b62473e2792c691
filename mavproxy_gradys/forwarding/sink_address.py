"""Where readings go, as the setting `sink` names it: URL, options, and what may be shown and stored of it. Pure."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from urllib.parse import unquote

from mavproxy_gradys.net.addresses import PORTS, split_url
from mavproxy_uavapi.core.addresses import masked
from mavproxy_uavapi.core.errors import SettingError

SCHEMES = tuple(PORTS)
STATUS_COUNTS = "ack=status"  # of an HTTP sink
STATION_CONFIRMS = "ack=station"  # of an MQTT sink


@dataclass(frozen=True)
class SinkAddress:
    """One sink.

    Attributes:
        url: what to connect to. It may hold a password: it is neither shown nor stored.
        status_counts: whether a 200 acknowledges all that was sent though it names no numbers.
        station_confirms: whether the station's word acknowledges, not the broker's.
    """

    url: str
    status_counts: bool = False
    station_confirms: bool = False

    def __str__(self) -> str:
        """As it may be shown."""
        option = STATUS_COUNTS if self.status_counts else STATION_CONFIRMS if self.station_confirms else ""
        return masked(self.url) + (f"#{option}" if option else "")

    @property
    def name(self) -> str:
        """What the spool's file calls it, from which no secret can be read.

        With another password or other options it is still the same sink.
        """
        parts, port = split_url(self.url, SCHEMES)
        whole = f"{parts.scheme}://{parts.username or ''}@{parts.hostname}:{port}{parts.path}?{parts.query}"
        return f"{parts.hostname}:{port} {hashlib.sha256(whole.encode()).hexdigest()[:16]}"


def sink_addresses(text: str) -> tuple[SinkAddress, ...]:
    """The sinks of a list by comma.

    Raises:
        SettingError: one is no URL of a scheme that we know, no topic, or has an option that there is not.
    """
    addresses = [sink_address(part.strip()) for part in text.split(",") if part.strip()]
    return tuple({sink.name: sink for sink in addresses}.values())


def sink_address(text: str) -> SinkAddress:
    """One sink.

    Raises:
        SettingError: as `sink_addresses`.
    """
    split_url(text, SCHEMES)
    if text.startswith("mqtt"):
        url = text.removesuffix(f"#{STATION_CONFIRMS}")
        if set("+#?") & set(unquote(url.partition("://")[2].partition("/")[2])):
            raise SettingError(f"{masked(text)}: a topic holds none of + # ?; the option is #{STATION_CONFIRMS}")
        return SinkAddress(url, station_confirms=url != text)
    url, _, option = text.partition("#")
    if option not in ("", STATUS_COUNTS):
        raise SettingError(f"{masked(text)}: the only option of an HTTP sink is #{STATUS_COUNTS}")
    return SinkAddress(url, option == STATUS_COUNTS)
