"""IP addresses, and URLs of them. Pure, but for this machine's name and addresses."""

from __future__ import annotations

import functools
import ipaddress
import re
import socket
from urllib.parse import urlsplit

import psutil

EVERYWHERE = {
    "0.0.0.0": "127.0.0.1",
    "::": "::1",
    "": "127.0.0.1",
}  # address to listen on -> address by which this machine reaches it


def is_loopback(host: str) -> bool:
    """Whether the host is this machine by its loopback: localhost, or a loopback address, with a zone or not."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.partition("%")[0]).is_loopback
    except ValueError:  # another name
        return False


def is_our_name(host: str, *others: str) -> bool:
    """Whether a Host header names this machine: `localhost`, its name, an IP address, or one of the `others`.

    A foreign name server cannot make any of the first three point to this machine. Case makes no difference.
    """
    return _names_us(host, socket.gethostname().lower(), others)


@functools.lru_cache(maxsize=256)  # each request has one, mostly the same
def _names_us(host: str, own: str, others: tuple[str, ...]) -> bool:
    try:
        name = (urlsplit(f"//{host}").hostname or "").removesuffix(".")
    except ValueError:  # for example a bracket that is not closed
        return False
    if name and name in ("localhost", own, f"{own}.local", *map(str.lower, others)):
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def bracketed(host: str) -> str:
    """A host as a URL has it: an IPv6 address in brackets, without its zone."""
    return f"[{host.partition('%')[0]}]" if ":" in host else host


def url_of(host: str, port: int, *, tls: bool = False) -> str:
    """The URL of a server that listens on that address."""
    return f"{'https' if tls else 'http'}://{bracketed(host)}:{port}"


def local_url_of(host: str, port: int, *, tls: bool = False) -> str:
    """The URL by which this machine reaches a server that listens on that address."""
    return url_of(EVERYWHERE.get(host, host), port, tls=tls)


def urls_of(host: str, port: int, *, tls: bool = False) -> list[str]:
    """The URLs by which other machines, if they may, reach a server that listens on that address."""
    hosts = (own_addresses() or [host]) if host in EVERYWHERE else [host]
    return [url_of(one, port, tls=tls) for one in hosts]


def own_addresses() -> list[str]:
    """This machine's IPv4 addresses, without the loopback."""
    found = [one.address for each in psutil.net_if_addrs().values() for one in each if one.family == socket.AF_INET]
    return [address for address in found if not is_loopback(address)]


# Where a host would have a port there is something else: the first half of a password, whose host is missing.
HALF_A_PASSWORD = re.compile(r"(://[^:/?#@\[]*):(?!\*\*\*@|[0-9]*(?:[/?#]|$)).*", re.DOTALL)


def masked(url: str) -> str:
    """A URL as it may be shown: without the password before its host, and without its query, which may hold one."""
    shown = HALF_A_PASSWORD.sub(r"\1:***", re.sub(r"(?s)(://[^:/?#@]*):.*@", r"\1:***@", url))
    return re.sub(r"\?[^#]*", "?***", shown)
