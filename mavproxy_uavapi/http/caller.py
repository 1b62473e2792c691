"""The caller: its address, its group for limits, and how it passed the door check."""

from __future__ import annotations

import functools
import ipaddress
from collections.abc import Iterable
from dataclasses import dataclass

from aiohttp import web

from mavproxy_uavapi.settings import Network

IpAddress = ipaddress.IPv4Address | ipaddress.IPv6Address

PREFIX = 64  # bits of an IPv6 address that identify its owner, who chooses the other bits freely
NOBODY = "unknown"
LOOPBACK = "this machine"


@functools.lru_cache(maxsize=1024)
def address_of(remote: str | None) -> IpAddress | None:
    """A peer's address without its zone; an IPv4 address written as IPv6 becomes IPv4. None if there is none."""
    try:
        address = ipaddress.ip_address((remote or "").partition("%")[0])
    except ValueError:
        return None
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return mapped or address


@functools.lru_cache(maxsize=1024)
def group_of(address: IpAddress | None) -> str:
    """The caller's group for limits: an IPv4 address, a /64 of IPv6, or this machine."""
    if address is None:
        return NOBODY
    if address.is_loopback:
        return LOOPBACK
    if isinstance(address, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((address, PREFIX), strict=False))
    return str(address)


@dataclass(frozen=True)
class Caller:
    """A caller that passed the door check.

    Attributes:
        address: its IP address; None if the connection has none.
        has_token: whether it sent the token.
        forwarded: whether a proxy passed the request on; the address is the proxy's then.
    """

    address: IpAddress | None
    has_token: bool = False
    forwarded: bool = False

    @property
    def group(self) -> str:
        """The group whose requests are counted together."""
        return group_of(self.address)

    @property
    def is_local(self) -> bool:
        """Whether it is a program on this machine."""
        return not self.forwarded and self.address is not None and self.address.is_loopback

    def is_in(self, networks: Iterable[Network]) -> bool:
        """Whether its address is in one of `networks`; never behind a proxy."""
        return (
            not self.forwarded and self.address is not None and any(self.address in network for network in networks)
        )


CALLER = web.RequestKey("caller", Caller)  # set by the door check
