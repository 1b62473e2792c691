"""The stations' addresses as a person writes them, and ours as a station needs it. Pure, except `own_address`."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from urllib.parse import SplitResult, urlsplit

from mavproxy_gradys.net.resolver import Resolver
from mavproxy_uavapi.core.addresses import bracketed, is_loopback, masked
from mavproxy_uavapi.core.errors import SettingError

PORTS = {"http": 80, "https": 443, "mqtt": 1883, "mqtts": 8883}


@dataclass(frozen=True)
class StationAddress:
    """A ground station.

    Attributes:
        url: scheme, host and port, without a trailing slash; the status shows it.
        host: name or IP address, without brackets.
        port: TCP port.
    """

    url: str
    host: str
    port: int

    @property
    def update_url(self) -> str:
        """The URL that takes positions; its trailing slash is necessary."""
        return f"{self.url}/update-info/"


def stations(text: str) -> tuple[StationAddress, ...]:
    """The stations in a comma-separated list: HOST:PORT, [IPV6]:PORT, or http(s)://HOST:PORT.

    Raises:
        SettingError: one of them is not valid.
    """
    addresses = [station(part.strip()) for part in text.split(",") if part.strip()]
    return tuple(dict.fromkeys(addresses))


def station(text: str) -> StationAddress:
    """One station.

    Raises:
        SettingError: it is not valid.
    """
    parts, port = split_url(text if "://" in text else f"http://{text}", ("http", "https"))
    if parts.path not in ("", "/") or parts.query or parts.fragment or parts.username:
        raise SettingError(f"{text!r}: it takes HOST:PORT, or http(s)://HOST:PORT")
    host = parts.hostname or ""
    shown = f":{port}" if parts.port is not None else ""
    return StationAddress(f"{parts.scheme}://{bracketed(host)}{shown}", host, port)


def split_url(text: str, schemes: tuple[str, ...]) -> tuple[SplitResult, int]:
    """An address and its port, both checked.

    Raises:
        SettingError: the scheme, the host or the port is not valid.
    """
    shown = masked(text)
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError as error:
        raise SettingError(f"{shown!r} is not an address") from error
    if parts.scheme not in schemes:
        raise SettingError(f"{shown!r}: it begins with one of {', '.join(f'{scheme}://' for scheme in schemes)}")
    if not parts.hostname or any(letter.isspace() for letter in text):
        raise SettingError(f"{shown!r} is not an address: it names no host")
    if "%" in parts.hostname:
        raise SettingError(f"{shown!r}: a URL has no place for an address's zone (%…)")
    try:
        parts.hostname.encode("idna")
    except UnicodeError as error:
        raise SettingError(f"{shown!r} is not an address: no host has such a name") from error
    return parts, PORTS[parts.scheme] if port is None else port


async def own_address(names: Resolver, host: str, port: int) -> str:
    """Our address on the interface that reaches `host`; nothing is sent.

    Raises:
        OSError: there is no such host, or no route to it.
    """
    infos = await names.look_up(host, port, kind=socket.SOCK_DGRAM)
    family, kind, protocol, _, peer = infos[0]
    with socket.socket(family, kind, protocol) as probe:
        probe.connect(peer)
        return str(probe.getsockname()[0])


def ip_field(setting: str, own: str, api: tuple[str, int] | None) -> str:
    """The form's `ip`: the address of our API for a station, without a scheme and with a trailing slash.

    Args:
        setting: the setting `ip`; empty for none. Its port has precedence over the API's.
        own: our address on the interface that reaches the station.
        api: the address on which the API listens; None while it does not; the field has no port then.
    """
    name = setting.partition("://")[2] if "://" in setting else setting
    name = name.rstrip("/") or bracketed(own)
    if api is None or has_port(name):
        return f"{name}/"
    return f"{name}:{api[1]}/"


def has_port(name: str) -> bool:
    """Whether HOST or HOST:PORT has a port."""
    return name.rpartition("]")[2].rpartition(":")[2].isdigit() and ":" in name.rpartition("]")[2]


def checked_ip(setting: str) -> str:
    """The same `ip`, if a station can use it; empty for none.

    Raises:
        SettingError: it has a path, a space, or no host.
    """
    name = setting.partition("://")[2] if "://" in setting else setting
    name = name.rstrip("/")
    if not setting:
        return setting
    split_url(f"http://{name}", ("http",))
    if "/" in name:
        raise SettingError(f"{setting!r}: it takes HOST or HOST:PORT")
    return setting


def api_note(api: tuple[str, int] | None, host: str) -> str:
    """The status's note on the API that `ip` names; empty if a station can reach it.

    Args:
        api: the address on which it listens; None while it does not.
        host: the station's host.
    """
    if api is None:
        return "uavapi is not listening: ip names no API, and the station cannot command the vehicles"
    if is_loopback(api[0]) and not is_loopback(host):
        return f"the API listens on {api[0]} only: the station cannot command the vehicles"
    return ""
