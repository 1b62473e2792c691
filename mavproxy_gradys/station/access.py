"""Who may call the station, and what a browser may make of its answers."""

from __future__ import annotations

import hmac
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware

# Nothing but our own files runs or loads: what a device is called is text, whatever it holds.
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
    """Put HEADERS on every answer; a signal of aiohttp's, so that streams have them too."""
    response.headers.update(HEADERS)


@web.middleware
async def from_here(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Refuse what a page of another site sends."""
    origin = request.headers.get("Origin")
    if origin is not None and urlsplit(origin).netloc != request.host:
        return web.json_response({"detail": "a page of another site may not call"}, status=403)
    return await handler(request)


def only_with_token(token: str) -> Middleware:
    """Refuse a POST without that bearer token; all may post when it is empty."""

    @web.middleware
    async def check(request: web.Request, handler: Handler) -> web.StreamResponse:
        sent = request.headers.get("Authorization", "").removeprefix("Bearer ")
        if request.method == "POST" and token and not hmac.compare_digest(sent.encode(), token.encode()):
            return web.json_response({"detail": "a bearer token is needed"}, status=401)
        return await handler(request)

    return check
