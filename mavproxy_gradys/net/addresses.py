"""Addresses: the stations' as a person writes them, and ours as a station needs it. Pure, but for `own_address`."""

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
        url: scheme, host and port, without a slash at the end: what it is called in the status.
        host: name or IP address, without brackets.
        port: TCP port.
    """

    url: str
    host: str
    port: int

    @property
    def update_url(self) -> str:
        """Where it takes positions; the slash at the end belongs to it."""
        return f"{self.url}/update-info/"


def stations(text: str) -> tuple[StationAddress, ...]:
    """The stations of a list by comma: HOST:PORT, [IPV6]:PORT, or http(s)://HOST:PORT.

    Raises:
        SettingError: one of them cannot be read.
    """
    found = [station(part.strip()) for part in text.split(",") if part.strip()]
    return tuple(dict.fromkeys(found))


def station(text: str) -> StationAddress:
    """One station.

    Raises:
        SettingError: it cannot be read.
    """
    parts, port = split_url(text if "://" in text else f"http://{text}", ("http", "https"))
    if parts.path not in ("", "/") or parts.query or parts.fragment or parts.username:
        raise SettingError(f"{text!r}: it takes HOST:PORT, or http(s)://HOST:PORT")
    host = parts.hostname or ""
    shown = f":{port}" if parts.port is not None else ""
    return StationAddress(f"{parts.scheme}://{bracketed(host)}{shown}", host, port)


def split_url(text: str, schemes: tuple[str, ...]) -> tuple[SplitResult, int]:
    """An address and its port, after a look at both.

    Raises:
        SettingError: no such scheme, no host, or no such port.
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
        raise SettingError(f"{shown!r} is not an address: no host has such a name ({error})") from error
    return parts, PORTS[parts.scheme] if port is None else port


async def own_address(names: Resolver, host: str, port: int) -> str:
    """Our address on the interface that reaches `host`; nothing is sent.

    Raises:
        OSError: there is no such host, or no way there.
    """
    found = await names.look_up(host, port, kind=socket.SOCK_DGRAM)
    family, kind, protocol, _, peer = found[0]
    with socket.socket(family, kind, protocol) as probe:
        probe.connect(peer)
        return str(probe.getsockname()[0])


def ip_field(given: str, own: str, api: tuple[str, int] | None) -> str:
    """The form's `ip`: where a station reaches our API, without a scheme and with a slash at the end.

    Args:
        given: the setting; empty for none. Its port counts, or else the API's.
        own: our address on the interface that reaches the station.
        api: where the API listens; None while it does not, and then the field names no port.
    """
    name = given.partition("://")[2] if "://" in given else given
    name = name.rstrip("/") or bracketed(own)
    if api is None or has_port(name):
        return f"{name}/"
    return f"{name}:{api[1]}/"


def has_port(name: str) -> bool:
    """Whether HOST or HOST:PORT ends in a port."""
    return name.rpartition("]")[2].rpartition(":")[2].isdigit() and ":" in name.rpartition("]")[2]


def checked_ip(given: str) -> str:
    """The same `ip`, if a station can call it; empty for none.

    Raises:
        SettingError: it has a path, a space, or no host.
    """
    name = given.partition("://")[2] if "://" in given else given
    name = name.rstrip("/")
    if not given:
        return given
    split_url(f"http://{name}", ("http",))
    if "/" in name:
        raise SettingError(f"{given!r}: it takes HOST or HOST:PORT")
    return given


def api_note(api: tuple[str, int] | None, host: str) -> str:
    """What the status says of the API that `ip` names; empty when a station can reach it.

    Args:
        api: where it listens, None while it does not.
        host: the station's.
    """
    if api is None:
        return "uavapi is not listening: ip names no API, and the station cannot command the vehicles"
    if is_loopback(api[0]) and not is_loopback(host):
        return f"the API listens on {api[0]} only: the station cannot command the vehicles"
    return ""
