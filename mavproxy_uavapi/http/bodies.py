"""Request bodies before they are read: which are refused, and 100-continue."""

from __future__ import annotations

from aiohttp import HttpVersion11, web

from mavproxy_uavapi.core.errors import BadRequest

CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"


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
