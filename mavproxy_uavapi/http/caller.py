"""Who calls: an address, whom it shares its limits with, and what the door let it in by."""

from __future__ import annotations

import functools
import ipaddress
from collections.abc import Iterable
from dataclasses import dataclass

from aiohttp import web

from mavproxy_uavapi.settings import Network

IpAddress = ipaddress.IPv4Address | ipaddress.IPv6Address

PREFIX = 64  # bits of an IPv6 address that say whose it is: the rest its owner chooses as he likes
NOBODY = "unknown"
LOOPBACK = "this machine"


@functools.lru_cache(maxsize=1024)
def address_of(remote: str | None) -> IpAddress | None:
    """A peer's address without its zone; an IPv4 address that is written as IPv6 is IPv4. None where it is none."""
    try:
        address = ipaddress.ip_address((remote or "").partition("%")[0])
    except ValueError:
        return None
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return mapped or address


@functools.lru_cache(maxsize=1024)
def group_of(address: IpAddress | None) -> str:
    """Who counts as one caller: an IPv4 address, a /64 of IPv6, or this machine."""
    if address is None:
        return NOBODY
    if address.is_loopback:
        return LOOPBACK
    if isinstance(address, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((address, PREFIX), strict=False))
    return str(address)


@dataclass(frozen=True)
class Caller:
    """Whom the door let in.

    Attributes:
        address: its IP address; None where the connection has none.
        has_token: whether it sent the token.
        forwarded: whether a proxy passed the request on, so that the address is the proxy's.
    """

    address: IpAddress | None
    has_token: bool = False
    forwarded: bool = False

    @property
    def group(self) -> str:
        """Whose requests are counted together."""
        return group_of(self.address)

    @property
    def is_local(self) -> bool:
        """Whether it is a program of this machine."""
        return not self.forwarded and self.address is not None and self.address.is_loopback

    def is_in(self, networks: Iterable[Network]) -> bool:
        """Whether one of them is its own, as far as its address says."""
        return not self.forwarded and self.address is not None and any(self.address in one for one in networks)


CALLER = web.RequestKey("caller", Caller)  # where the door leaves whom it let in
