"""Access checks of the station, and the headers that restrict what a browser does with its answers."""

from __future__ import annotations

import hmac
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware

from mavproxy_uavapi.core.addresses import is_our_name

# Only our own files run or load: a device's name stays text, whatever it contains.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}


async def add_headers(_request: web.Request, response: web.StreamResponse) -> None:
    """Add HEADERS to every answer; an aiohttp signal, so that streams have them, too."""
    response.headers.update(HEADERS)


def same_site(public_name: str) -> Middleware:
    """Refuse requests from pages of other sites, and to a foreign host name, which may be rebound to our address.

    Args:
        public_name: a further name by which this machine is reached; empty for none.
    """

    @web.middleware
    async def check(request: web.Request, handler: Handler) -> web.StreamResponse:
        if not is_our_name(request.host, public_name):
            return web.json_response({"detail": "this is not that host; see --public-name"}, status=403)
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != request.host:
            return web.json_response({"detail": "a page of another site may not call"}, status=403)
        return await handler(request)

    return check


def require_token(token: str) -> Middleware:
    """Refuse a POST without that bearer token; an empty token allows all."""

    @web.middleware
    async def check(request: web.Request, handler: Handler) -> web.StreamResponse:
        sent = request.headers.get("Authorization", "").removeprefix("Bearer ")
        if request.method == "POST" and token and not hmac.compare_digest(sent.encode(), token.encode()):
            return web.json_response({"detail": "a bearer token is needed"}, status=401)
        return await handler(request)

    return check
