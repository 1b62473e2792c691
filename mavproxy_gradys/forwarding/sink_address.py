"""The address of a sink, as in the setting `sink`: its URL, its options, and its name without secrets. Pure."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from urllib.parse import unquote

from mavproxy_gradys.net.addresses import PORTS, split_url
from mavproxy_gradys.net.topics import checked_topic
from mavproxy_uavapi.core.addresses import masked
from mavproxy_uavapi.core.errors import SettingError

SCHEMES = tuple(PORTS)
STATUS_COUNTS = "ack=status"  # option of an HTTP sink
STATION_CONFIRMS = "ack=station"  # option of an MQTT sink
DEFAULT_TOPIC = "fleet/{device}/{quantity}"
PLACES = ("sysid", "device", "quantity")  # names that a topic may have in brackets
ONE_OF_A_LIST = re.compile(r"(?:\s*\w+://[^@/:,]*:[^@/]*@)?[^,]+")


@dataclass(frozen=True)
class SinkAddress:
    """One sink.

    Attributes:
        url: the URL to connect to. It may have a password, so it is neither shown nor stored.
        status_counts: whether a 200 without numbers acknowledges the whole batch.
        station_confirms: whether the station acknowledges, not the broker.
    """

    url: str
    status_counts: bool = False
    station_confirms: bool = False

    def __str__(self) -> str:
        """The URL without its password, with the option."""
        option = STATUS_COUNTS if self.status_counts else STATION_CONFIRMS if self.station_confirms else ""
        return masked(self.url) + (f"#{option}" if option else "")

    @property
    def name(self) -> str:
        """The sink's name in the spool's file; it reveals no secret.

        Another password or another option does not change it.
        """
        parts, port = split_url(self.url, SCHEMES)
        whole = f"{parts.scheme}://{parts.username or ''}@{parts.hostname}:{port}{parts.path}?{parts.query}"
        return f"{parts.hostname}:{port} {hashlib.sha256(whole.encode()).hexdigest()[:16]}"


def sink_addresses(text: str) -> tuple[SinkAddress, ...]:
    """Parse a list of sinks, separated by commas; a password may hold some.

    Raises:
        SettingError: a URL has an unknown scheme, an invalid topic, or an unknown option.
    """
    addresses = [sink_address(part.strip()) for part in ONE_OF_A_LIST.findall(text) if part.strip()]
    return tuple({sink.name: sink for sink in addresses}.values())


def sink_address(text: str) -> SinkAddress:
    """Parse one sink.

    Raises:
        SettingError: as `sink_addresses`.
    """
    split_url(text, SCHEMES)
    if text.startswith("mqtt"):
        url = text.removesuffix(f"#{STATION_CONFIRMS}")
        topic = unquote(url.partition("://")[2].partition("/")[2])
        if "#" in topic:
            raise SettingError(f"{masked(text)}: the only option is #{STATION_CONFIRMS}")
        checked_topic(topic or DEFAULT_TOPIC, PLACES)
        return SinkAddress(url, station_confirms=url != text)
    url, _, option = text.partition("#")
    if option not in ("", STATUS_COUNTS):
        raise SettingError(f"{masked(text)}: the only option of an HTTP sink is #{STATUS_COUNTS}")
    return SinkAddress(url, option == STATUS_COUNTS)
