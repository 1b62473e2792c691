"""Request bodies: which are refused, 100-continue, the time that they have, and the parameters in them."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Collection, Iterable
from typing import Any, TypeVar, cast
from urllib.parse import parse_qsl

from aiohttp import HttpVersion11, web

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.file_text import text_of
from mavproxy_uavapi.core.strict_json import json_of, shown
from mavproxy_uavapi.core.text import escaped
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.http.contract.parsing import parse
from mavproxy_uavapi.http.contract.requests import CallOptions, Request
from mavproxy_uavapi.http.contract.route import FORM, WITH_BODY, Route

T = TypeVar("T")

CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"
MOST_FIELDS = 1000  # of a form
BODY_TIMEOUT = 10.0  # s from the headers to the end of the body


async def invite(request: web.BaseRequest) -> None:
    """Refuse a compressed body, because a small one may hold a very large one; answer 100-continue if it is expected.

    Raises:
        BadRequest: the client has gone.
        HTTPUnsupportedMediaType: it is compressed.
        HTTPExpectationFailed: the client expects something other than 100-continue.
    """
    encoding = request.headers.get("Content-Encoding", "identity").strip().lower()
    if encoding != "identity":
        raise web.HTTPUnsupportedMediaType(reason="compressed bodies are not accepted")
    expected = request.headers.get("Expect")
    if expected is None:
        return
    if expected.strip().lower() != "100-continue":
        raise web.HTTPExpectationFailed(reason="only 100-continue can be expected")
    if request.version >= HttpVersion11 and request.can_read_body:
        try:
            await request.writer.write(CONTINUE)
        except ConnectionError as error:
            raise BadRequest("the client hung up before its body was requested") from error
        request.writer.output_size = 0  # the answer's first byte is still to come


async def in_time(body: Awaitable[T]) -> T:
    """The body, when it has arrived.

    Raises:
        BadRequest: it did not arrive within BODY_TIMEOUT, or the client hung up.
    """
    try:
        return await wait_with_timeout(BODY_TIMEOUT, body)
    except asyncio.TimeoutError as error:
        raise BadRequest(f"the body did not arrive within {BODY_TIMEOUT:g} s") from error
    except ConnectionError as error:
        raise BadRequest("the client hung up before its body had arrived") from error


def options_of(request: web.BaseRequest, route: Route) -> CallOptions:
    """What the query says besides the parameters.

    Raises:
        Invalid: an option has no such value, or is there twice.
    """
    known = route.options.model_fields
    given = [(name, value) for name, value in request.query.items() if name in known]
    return parse(route.options, "query", _once("query", given))


async def parameters(request: web.BaseRequest, route: Route) -> Request:
    """The request's parameters, of its query and its body. A body that the action reads itself is left to it.

    Raises:
        BadRequest: it has a body that the route does not take, or one that cannot be read.
        Invalid: a name that the route does not have, or twice; a value of the wrong type or out of range.
    """
    options = route.options.model_fields
    query = _once("query", [(name, value) for name, value in request.query.items() if name not in options])
    members = await _members(request, route)
    for name in query.keys() & members.keys():
        raise Invalid("it is in the query and in the body", "query", name)
    source = "body" if request.method in WITH_BODY else "query"
    return parse(route.model, source, {**query, **members}, query=query, options=options)


def _once(source: str, pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """The values by name, each of which is there once."""
    values: dict[str, Any] = {}
    for name, value in pairs:
        if name in values:
            raise Invalid("it is there twice", source, name)
        values[name] = value
    return values


async def _members(request: web.BaseRequest, route: Route) -> dict[str, Any]:
    """The parameters in the body."""
    if not request.can_read_body:
        return {}
    types = route.body_types(request.method)
    if route.raw and types:
        _require_type(request, types)
        return {}
    if not types and request.content_length:
        raise BadRequest(f"a {request.method} of {route.path} takes no body")
    body = request.read()
    data = await (body if request.content.is_eof() else in_time(body))  # it is here usually, and needs no timeout
    if not data.strip():
        return {}
    if not types:
        raise BadRequest(f"a {request.method} of {route.path} takes no body")
    _require_type(request, types)
    text = _text(data, request.charset)
    if request.content_type == FORM:
        return _form(text, request.charset or "utf-8")
    return _object(text)


def _require_type(request: web.BaseRequest, types: Collection[str]) -> None:
    """Refuse a body that says to be of another type; one that says nothing is taken for what the route takes."""
    given = escaped(request.headers.get("Content-Type", "").strip())[:100]
    if given and request.content_type not in types:
        raise BadRequest(f"the body is {given}, but {request.path} takes {' or '.join(types)} (header Content-Type)")


def _text(data: bytes, charset: str | None) -> str:
    if charset is None:
        return text_of(data, "the body")
    try:
        text = data.decode(charset).removeprefix("\ufeff")
        text.encode()  # some charsets can spell half of a surrogate pair
        return text
    except (LookupError, UnicodeError) as error:
        raise BadRequest(f"the body is not text in the charset {shown(charset)} (header Content-Type)") from error


def _form(text: str, charset: str) -> dict[str, str]:
    if text.lstrip()[:1] in ("{", "["):
        raise BadRequest(
            "the body is JSON, but its Content-Type says that it is a form: send `Content-Type: application/json`"
        )
    try:
        pairs = parse_qsl(text.rstrip(), True, True, charset, "strict", MOST_FIELDS)
        "".join(name + value for name, value in pairs).encode()  # as above
    except ValueError as error:
        raise BadRequest(
            f"the body is not a form of at most {MOST_FIELDS} fields NAME=VALUE with & between"
        ) from error
    return _once("body", pairs)


def _object(text: str) -> dict[str, Any]:
    try:
        members = json_of(text, "the body")
    except Invalid as error:
        error.set_source("body")
        raise
    if not isinstance(members, dict):
        raise BadRequest("the body is not a JSON object")
    return cast(dict[str, Any], members)
