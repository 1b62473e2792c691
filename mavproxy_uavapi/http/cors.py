"""CORS headers for pages of other sites that the owner trusts (setting `cors_origins`)."""

from __future__ import annotations

from aiohttp import web

TRUSTED_ORIGIN: web.RequestKey[str] = web.RequestKey("trusted", str)  # the origin of the trusted page that calls
HEADERS = {
    "Access-Control-Allow-Methods": "GET, POST, PUT, DELETE",
    "Access-Control-Allow-Headers": "Authorization, Content-Type, Prefer",
    "Access-Control-Expose-Headers": "Location",
    "Vary": "Origin",
}


def add_cors_headers(request: web.BaseRequest, response: web.StreamResponse) -> None:
    """Tell the browser, in an answer's headers, that the calling page may read it, if that page is trusted."""
    origin = request.get(TRUSTED_ORIGIN)
    if origin is not None:
        response.headers.update({"Access-Control-Allow-Origin": origin, **HEADERS})
