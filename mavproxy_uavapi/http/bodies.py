"""Request bodies: which are refused, 100-continue, the time that they have, and the parameters in them."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Any, TypeVar, cast

from aiohttp import HttpVersion11, web

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.file_text import text_of
from mavproxy_uavapi.core.strict_json import json_of, shown
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.http.requests import Request, parse

T = TypeVar("T")

CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"
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


async def _body(request: web.BaseRequest, form: bool) -> Any:
    if form:
        return dict(await request.post())
    data = await request.read()
    is_utf_8 = request.charset is None or request.charset.lower().replace("-", "") == "utf8"
    return json_of(text_of(data, "the body") if is_utf_8 else data.decode(str(request.charset)), "the body")


async def parameters(request: web.BaseRequest, model: type[Request], body: bool) -> Request:
    """The request's parameters: the query's, overridden by those of the body if the route takes one.

    Raises:
        BadRequest: the body is not a JSON object, or is in no charset that is known.
        Invalid: a value is of the wrong type or out of range.
    """
    values: dict[str, Any] = dict(request.query)
    if not body or not request.can_read_body:
        return parse(model, "query", values)
    form = request.content_type == "application/x-www-form-urlencoded"
    try:
        body_is_here = request.content.is_eof()  # usually, and then no timeout is needed
        members = await (_body(request, form) if body_is_here else in_time(_body(request, form)))
    except (ValueError, LookupError) as error:  # an unknown charset, or other bytes than it says
        charset = f" in the charset {shown(request.charset)}" if request.charset else ""
        raise BadRequest(f"the body is not {'a form' if form else 'text'}{charset}") from error
    if not isinstance(members, dict):
        raise BadRequest("the body is not a JSON object")
    return parse(model, "body", {**values, **cast(dict[str, Any], members)})
