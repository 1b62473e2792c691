"""The caller: its address, its group for limits, and how it passed the door check."""

from __future__ import annotations

import functools
import ipaddress
from collections.abc import Iterable
from dataclasses import dataclass

from aiohttp import web

from mavproxy_uavapi.core.roles import Operator, Role
from mavproxy_uavapi.files.tokens import Token
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
        has_token: whether it sent a token that counts.
        forwarded: whether a proxy passed the request on; the address is the proxy's then.
        token: the named token that it sent; None for the setting `token`, and for none.
    """

    address: IpAddress | None
    has_token: bool = False
    forwarded: bool = False
    token: Token | None = None

    @property
    def name(self) -> str:
        """The name of its token; empty for none."""
        return "" if self.token is None else self.token.name

    @property
    def role(self) -> Role:
        """What it may do; without a named token everything, within the limits of its network."""
        return Role.ADMIN if self.token is None else self.token.role

    @functools.cached_property
    def operator(self) -> Operator:
        """The operator who holds vehicles by it: its token's owner, or else its address."""
        return Operator(str(self.address or NOBODY), self.role) if self.token is None else self.token.operator

    def flies(self, system: int) -> bool:
        """Whether it may command that vehicle."""
        named = frozenset() if self.token is None else self.token.vehicles
        return self.role >= Role.FLY and (not named or system in named)

    @functools.cached_property
    def group(self) -> str:
        """The group whose requests are counted together."""
        return group_of(self.address)

    @property
    def counted_as(self) -> str:
        """The name under which limits count it: its group and, apart from others there, its token."""
        return f"{self.name}@{self.group}"

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


def client_of(request: web.BaseRequest) -> str:
    """Who calls, for the trail and for answers: the address, and before it the name of the token if there is one."""
    caller, address = request.get(CALLER), request.remote or NOBODY
    return f"{caller.name}@{address}" if caller is not None and caller.name else address
