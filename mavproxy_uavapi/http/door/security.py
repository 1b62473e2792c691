"""The door check: who may call. It refuses pages of other sites and foreign host names, and asks for a token if set.

Many commands are GETs, and any web page can make a browser send a GET to a loopback address. A browser says so in
Origin or Sec-Fetch-Site; Host shows a foreign name that was rebound to our address. Over plain HTTP to a LAN address
a browser sends neither with a GET; other headers show it there (`check_page`).
"""

from __future__ import annotations

import asyncio
import hmac
import logging
import math
from collections.abc import Callable, Mapping

from aiohttp import web

from mavproxy_uavapi.core.addresses import is_our_name
from mavproxy_uavapi.core.errors import Forbidden, TooManyRequests, UavApiError, Unauthorized, without_frames
from mavproxy_uavapi.core.streaming import CORS_HEADERS
from mavproxy_uavapi.core.text import escaped
from mavproxy_uavapi.files.tokens import Token, digest_of
from mavproxy_uavapi.http.callers.browser import browsers_header, wants_page
from mavproxy_uavapi.http.callers.call import SERVICE, Service
from mavproxy_uavapi.http.callers.caller import CALLER, Caller, address_of, group_of
from mavproxy_uavapi.http.contract.responses import Handler, failure
from mavproxy_uavapi.http.contract.router import MATCH
from mavproxy_uavapi.http.wire.connection import Connection
from mavproxy_uavapi.settings import ApiSettings

log = logging.getLogger("uavapi.http.door")
OURSELVES = {"same-origin", "none"}  # Sec-Fetch-Site of our own page and of a typed address
DOCUMENTATION = ("/docs", "/openapi.json")
PROXIES_SAY = ("Forwarded", "X-Forwarded-For", "X-Real-IP", "Via")
STRANGERS_RATE = 10.0  # requests/s of one address that fail the door check
READERS_RATE = 120.0  # files/s of the page that one address may read without the token
SHOWN = 120  # characters of a header in an answer
CORS = {  # further headers of an answer to a page of a trusted origin
    "Access-Control-Allow-Methods": "GET, POST, PUT, DELETE",
    "Access-Control-Allow-Headers": "Authorization, Content-Type, Prefer",
    "Access-Control-Expose-Headers": "Location",
    "Vary": "Origin",
}
REFUSED_LATE = 1.0  # s by which the answer is delayed if its address was refused too often


def check_origin(
    headers: Mapping[str, str], trusted: tuple[str, ...] = (), names: tuple[str, ...] = (), *, tokens: bool = False
) -> None:
    """Refuse requests without a token from pages of other sites, or with a Host that is not ours.

    Args:
        headers: the request's headers.
        trusted: origins of other sites' pages that may call.
        names: further names of this host.
        tokens: whether there is a token, which would make any name right.

    Raises:
        Unauthorized: the Host is not ours, and a token would make it right.
        Forbidden: with the reason.
    """
    host = headers.get("Host", "")
    if not is_our_name(host, *names):
        called = f"this is not host {escaped(host)[:SHOWN]!r}" if host else "the request has no header Host"
        sentence = f"{called}: the setting `names` has further names of this machine"
        raise Unauthorized(f"{sentence}, and with the token any name is right") if tokens else Forbidden(sentence)
    origin = headers.get("Origin")
    if origin is not None and origin in trusted:
        return
    site = headers.get("Sec-Fetch-Site")
    if site is not None and site not in OURSELVES:
        raise Forbidden(f"a page of another site ({site}) may not call this API")
    if origin is not None and origin.partition("://")[2] != host:
        raise Forbidden(f"a page of {origin} may not call this API")


def check_page(headers: Mapping[str, str], trusted: tuple[str, ...] = ()) -> None:
    """Refuse a command from a browser that does not name the page, or names one of another site.

    A page can keep its browser from sending a Referer and can choose what it accepts; it cannot send another site's
    Referer, nor change the browser's name. `check_origin` has already judged Origin and Sec-Fetch-Site.

    Args:
        headers: the request's headers.
        trusted: origins of other sites' pages that may call.

    Raises:
        Forbidden: with the reason.
    """
    if "Origin" in headers or "Sec-Fetch-Site" in headers:
        return
    referer = headers.get("Referer")
    if referer is not None:
        page = "/".join(referer.split("/")[:3])
        if page in trusted or page.partition("://")[2] == headers.get("Host"):
            return
        raise Forbidden(f"a page of {page} may not command the vehicle")
    header = browsers_header(headers)
    if header:
        raise Forbidden(
            f"`{escaped(header)[:SHOWN]}` is a browser's header, and no other one names the page that sends this "
            "command: a program sends another, or the token; a browser uses our page, /docs, or https"
        )


def no_token(_credentials: bytes) -> Token | None:
    """The token, if no named token is known: None."""
    return None


def check_caller(
    remote: str | None,
    headers: Mapping[str, str],
    settings: ApiSettings,
    find: Callable[[bytes], Token | None] = no_token,
) -> Caller:
    """The caller, if it has a token or comes from a network that needs none.

    Behind a proxy the peer's address is the proxy's, not the caller's; it gives no access then.

    Args:
        remote: the peer's IP address.
        headers: the request's.
        settings: the access settings.
        find: the named token of what a caller sent.

    Raises:
        Unauthorized: a token is needed, and missing or wrong.
        Forbidden: no token is set, and the caller's network is not in the settings.
    """
    forwarded = any(name in headers for name in PROXIES_SAY)
    authorization = headers.get("Authorization")
    credentials = credentials_of(authorization)
    token = find(credentials) if credentials else None
    has = token is not None or has_token(authorization, settings.token)
    caller = Caller(address_of(remote), has, forwarded, token)
    if caller.has_token or caller.is_in(settings.allow_from):
        return caller
    if has_tokens(settings):
        raise Unauthorized("this API needs its token: Authorization: Bearer …")
    if not settings.allow_open and not caller.is_local:
        raise Forbidden(f"{remote}{' by a proxy' if forwarded else ''} is not in a network that may call")
    return caller


def credentials_of(authorization: str | None) -> bytes:
    """What an Authorization header holds after `Bearer`, which may be any bytes; empty without."""
    scheme, _, credentials = (authorization or "").partition(" ")
    return credentials.strip().encode("utf-8", "surrogateescape") if scheme.lower() == "bearer" else b""


def has_token(authorization: str | None, token: str) -> bool:
    """Whether the Authorization header holds the token of the settings."""
    return bool(token) and hmac.compare_digest(credentials_of(authorization), token.encode())


def has_tokens(settings: ApiSettings) -> bool:
    """Whether there is a token by which one may call."""
    return bool(settings.token or settings.tokens)


def admitted(request: web.BaseRequest, service: Service) -> Caller:
    """The caller, if it may call and its command does not come from a page of another site.

    Raises:
        Unauthorized, Forbidden: it may not, with the reason.
    """
    settings, headers = service.settings, request.headers

    def require_our_site() -> None:
        check_origin(headers, settings.cors_origins, settings.names, tokens=has_tokens(settings))

    try:
        caller = check_caller(
            request.remote, headers, settings, lambda credentials: service.token_of(digest_of(credentials))
        )
    except UavApiError:
        require_our_site()  # that comes first
        raise
    # A page of another site does not have the token, and cannot send that header, whatever name it called us by.
    if not caller.has_token:
        require_our_site()
        route = request[MATCH].route
        if route is not None and route.commands:
            check_page(headers, settings.cors_origins)
    return caller


async def door(request: web.BaseRequest, handler: Handler) -> web.StreamResponse:
    """Check every request before anything else reads it; answer the preflight of a trusted page."""
    service = request[SERVICE]
    settings = service.settings
    connection = Connection.of(request)
    try:
        if CORS_HEADERS in request and request.method == "OPTIONS":
            check_origin(request.headers, settings.cors_origins, settings.names)
            return web.Response(status=204)
        caller = admitted(request, service)
    except (Unauthorized, Forbidden) as error:
        # A browser has no token before it has the page that asks for one; the files show nothing of the vehicle.
        asks_for_token = has_tokens(settings) and is_open(request[MATCH].path, request.headers)
        if not asks_for_token or _wait_of_reader(request):
            return await _refused(request, connection, error)
        return await handler(request)
    if connection is not None:
        connection.judged(True)
    request[CALLER] = caller
    if caller.token is None:
        return await handler(request)
    with service.tokens.in_use(caller.token, lambda: _hang_up(request)):
        return await handler(request)


def _hang_up(request: web.BaseRequest) -> None:
    """Close the connection of a request whose token is in force no more; it ends as if its client had hung up."""
    if request.transport is not None:
        request.transport.abort()


async def _refused(request: web.BaseRequest, connection: Connection | None, error: UavApiError) -> web.StreamResponse:
    """The answer to a request that fails the door check, delayed if that happens often. It ends the connection."""
    service, group = request[SERVICE], group_of(address_of(request.remote))
    service.throttle.log(error.code, f"a request of {group} was refused: {ascii(str(error))[1:-1]}")
    if connection is not None:
        connection.judged(False)
    wait = _wait_of_stranger(request)
    if wait:
        error = TooManyRequests(f"more than {STRANGERS_RATE:g} refused requests a second", math.ceil(wait))
        await asyncio.sleep(REFUSED_LATE)
    service.host.audit.refused(request.remote or "unknown", error.code)
    response = failure(without_frames(error))
    response.force_close()
    return response


def _wait_of_stranger(request: web.BaseRequest) -> float:
    """Count a request that fails the door check; 0, or the seconds to wait if there were too many."""
    return _wait(request, "", STRANGERS_RATE)


def _wait_of_reader(request: web.BaseRequest) -> float:
    """The same for a file that needs no token; the page consists of many."""
    if request[MATCH].path.startswith(DOCUMENTATION):
        return _wait_of_stranger(request)
    return _wait(request, " reads", READERS_RATE)


def _wait(request: web.BaseRequest, what: str, rate: float) -> float:
    service, group = request[SERVICE], group_of(address_of(request.remote))
    return service.strangers.take(f"{group}{what}", rate, service.host.clock())


def is_open(path: str, headers: Mapping[str, str]) -> bool:
    """Whether a path needs no token: the documentation's, and the page's."""
    if path == "/":
        return wants_page(headers.get("Accept", ""))
    return path in DOCUMENTATION or path == "/manual" or path.startswith(("/docs/", "/page/", "/manual/"))


def cors_headers(origin: str) -> dict[str, str]:
    """Headers of an answer that tell the browser that a page of this origin, which is trusted, may read it."""
    return {"Access-Control-Allow-Origin": origin, **CORS}
