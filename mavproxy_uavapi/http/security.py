"""Who may call: no page of another site, no name but ours, and with a token where one is asked for.

Many commands are GETs, and any web page can make a browser issue a GET to a loopback address. A browser says
so in Origin or Sec-Fetch-Site; Host catches a foreign name that was rebound to our address.
"""

from __future__ import annotations

import hmac
import ipaddress
import socket
from collections.abc import Mapping
from urllib.parse import urlsplit

from aiohttp import web

from mavproxy_uavapi.errors import Forbidden, Unauthorized
from mavproxy_uavapi.http.call import SERVICE
from mavproxy_uavapi.http.responses import Handler
from mavproxy_uavapi.settings import Settings

OURSELVES = {"same-origin", "none"}  # Sec-Fetch-Site of our own page, and of an address typed by hand
CORS_HEADERS = {
    "Access-Control-Allow-Methods": "GET, POST, DELETE",
    "Access-Control-Allow-Headers": "Authorization, Content-Type, Prefer",
    "Access-Control-Expose-Headers": "Location",
    "Vary": "Origin",
}


def check_origin(headers: Mapping[str, str], trusted: tuple[str, ...] = ()) -> None:
    """Refuse what a page of another site sent, and a Host that is not ours.

    Args:
        headers: the request's.
        trusted: origins of other sites' pages that may call.

    Raises:
        Forbidden: with the reason.
    """
    host = headers.get("Host", "")
    if not is_our_name(host):
        raise Forbidden(f"this is not host {host!r}")
    origin = headers.get("Origin")
    if origin is not None and origin in trusted:
        return
    site = headers.get("Sec-Fetch-Site")
    if site is not None and site not in OURSELVES:
        raise Forbidden(f"a page of another site ({site}) may not call this API")
    if origin is not None and origin.partition("://")[2] != host:
        raise Forbidden(f"a page of {origin} may not call this API")


def is_our_name(host: str) -> bool:
    """Whether a Host header names us: by `localhost`, this machine's name, or an IP address.

    No foreign name server can make any of these point here.
    """
    try:
        name = (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:  # such as a bracket that is not closed
        return False
    own = socket.gethostname().lower()
    if name in ("localhost", own, f"{own}.local"):
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def check_caller(remote: str | None, authorization: str | None, settings: Settings) -> None:
    """Let in who has the token, or comes from a network that needs none.

    Args:
        remote: the caller's IP address.
        authorization: the header of that name.
        settings: what is asked for.

    Raises:
        Unauthorized: a token is needed, and missing or wrong.
        Forbidden: there is no token to have, and the caller's network was not named.
    """
    address = None if remote is None else ipaddress.ip_address(remote.partition("%")[0])
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped:
        address = address.ipv4_mapped
    if address is not None and any(address in network for network in settings.allow_from):
        return
    if settings.token:
        scheme, _, given = (authorization or "").partition(" ")
        if scheme.lower() != "bearer" or not hmac.compare_digest(given.strip().encode(), settings.token.encode()):
            raise Unauthorized("this API wants its token: Authorization: Bearer …")
    elif not settings.allow_open and (address is None or not address.is_loopback):
        raise Forbidden(f"{remote} is in none of the networks that may call")


@web.middleware
async def only_for_us(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Both checks, for every request; and the answer to a trusted page's preflight."""
    settings = request.app[SERVICE].settings
    origin = request.headers.get("Origin", "")
    check_origin(request.headers, settings.cors_origins)
    if origin in settings.cors_origins and request.method == "OPTIONS":
        return web.Response(status=204, headers={"Access-Control-Allow-Origin": origin, **CORS_HEADERS})
    # A browser has no token before it has the page that asks for one; the page tells nothing of the vehicle.
    if not (settings.token and is_documentation(request.path)):
        check_caller(request.remote, request.headers.get("Authorization"), settings)
    return await handler(request)


def is_documentation(path: str) -> bool:
    """Whether a path is the documentation's, which needs no token."""
    return path.rstrip("/") in ("/docs", "/openapi.json") or path.startswith("/docs/")


async def name_the_trusted(request: web.Request, response: web.StreamResponse) -> None:
    """Before an answer goes out: tell the browser that a trusted page may read it."""
    origin = request.headers.get("Origin", "")
    if origin in request.app[SERVICE].settings.cors_origins:
        response.headers.update({"Access-Control-Allow-Origin": origin, **CORS_HEADERS})
