"""IP addresses, and URLs of them. Pure."""

from __future__ import annotations

import ipaddress
import re

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


def bracketed(host: str) -> str:
    """A host as a URL has it: an IPv6 address in brackets, without its zone."""
    return f"[{host.partition('%')[0]}]" if ":" in host else host


def url_of(host: str, port: int, *, tls: bool = False) -> str:
    """The URL of a server that listens on that address."""
    return f"{'https' if tls else 'http'}://{bracketed(host)}:{port}"


def local_url_of(host: str, port: int, *, tls: bool = False) -> str:
    """The URL by which this machine reaches a server that listens on that address."""
    return url_of(EVERYWHERE.get(host, host), port, tls=tls)


def masked(url: str) -> str:
    """A URL as it may be shown: without the password before its host, and without its query, which may hold one."""
    return re.sub(r"\?[^#]*", "?***", re.sub(r"(?s)(://[^:/?#@]*):.*@", r"\1:***@", url))
