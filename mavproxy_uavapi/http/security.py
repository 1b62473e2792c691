"""Who may call: no page of another site, and no name but ours. Pure but for the middleware at the end.

Many commands are GETs, and any web page can make a browser issue a GET to a loopback address. A browser says
so in Origin or Sec-Fetch-Site; Host catches a foreign name that was rebound to our address.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping
from urllib.parse import urlsplit

from aiohttp import web

from mavproxy_uavapi.errors import Forbidden
from mavproxy_uavapi.http.responses import Handler

OURSELVES = {"same-origin", "none"}  # Sec-Fetch-Site of our own page, and of an address typed by hand


def check_origin(headers: Mapping[str, str]) -> None:
    """Refuse what a page of another site sent, and a Host that is not ours.

    Raises:
        Forbidden: with the reason.
    """
    host = headers.get("Host", "")
    if not is_our_name(host):
        raise Forbidden(f"this is not host {host!r}")
    site = headers.get("Sec-Fetch-Site")
    if site is not None and site not in OURSELVES:
        raise Forbidden(f"a page of another site ({site}) may not call this API")
    origin = headers.get("Origin")
    if origin is not None and origin.partition("://")[2] != host:
        raise Forbidden(f"a page of {origin} may not call this API")


def is_our_name(host: str) -> bool:
    """Whether a Host header names us by `localhost` or an IP address, which no foreign name server can rebind."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:  # such as a bracket that is not closed
        return False
    if name == "localhost":
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


@web.middleware
async def only_for_us(request: web.Request, handler: Handler) -> web.StreamResponse:
    """`check_origin` for every request."""
    check_origin(request.headers)
    return await handler(request)
