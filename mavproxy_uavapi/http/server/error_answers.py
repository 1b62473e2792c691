"""Turns errors into answers, in one place."""

from __future__ import annotations

import logging

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError, LineTooLong

from mavproxy_uavapi.core.errors import BadRequest, NotFound, UavApiError, without_frames
from mavproxy_uavapi.core.text import escaped
from mavproxy_uavapi.http.callers.call import SERVICE
from mavproxy_uavapi.http.callers.caller import client_of
from mavproxy_uavapi.http.contract.responses import Handler, dumps, failure

log = logging.getLogger("uavapi.http")
REFUSALS = (401, 403, 429)  # statuses of refused callers


def of_http_exception(error: web.HTTPException) -> web.Response:
    """The answer to a refusal by aiohttp itself (no such path, wrong method, too large a body), in our format."""
    if error.status == 404:
        return failure(NotFound("no such path"))
    refusal = BadRequest(error.reason)
    if isinstance(error, web.HTTPMethodNotAllowed):
        refusal = BadRequest(f"this path takes {' and '.join(sorted(error.allowed_methods))}, not {error.method}")
    elif isinstance(error, web.HTTPRequestEntityTooLarge):
        refusal = BadRequest(f"the body is too large. {error.text}")
    response = web.json_response({"detail": refusal.detail, "code": refusal.code}, status=error.status, dumps=dumps)
    if "Allow" in error.headers:
        response.headers["Allow"] = error.headers["Allow"]
    return response


class AnswersErrors(web.RequestHandler):
    """aiohttp's protocol, which answers in our format also what is no HTTP."""

    __slots__ = ()

    def handle_error(
        self,
        request: web.BaseRequest,
        status: int = 500,
        exc: BaseException | None = None,
        message: str | None = None,
    ) -> web.StreamResponse:
        """See aiohttp."""
        response = super().handle_error(request, status, exc, message)
        if not isinstance(exc, HttpProcessingError) or not isinstance(response, web.Response):
            return response
        says = "a line of the request is too long: a POST takes parameters in its body"
        if not isinstance(exc, LineTooLong):
            says = f"the request is not HTTP: {escaped((message or exc.message).partition(chr(10))[0])}"
        response.body = dumps({"detail": says, "code": BadRequest.code}).encode()
        response.content_type = "application/json"
        return response


async def errors_as_answers(request: web.BaseRequest, handler: Handler) -> web.StreamResponse:
    """Turn every error into an answer."""
    try:
        return await handler(request)
    except UavApiError as error:
        if error.status in REFUSALS and not error.is_audited:
            request[SERVICE].host.audit.refused(client_of(request), error.code)
        return failure(without_frames(error))
    except web.HTTPException as error:
        return of_http_exception(error) if error.status >= 400 else error
    except Exception as error:
        log.exception("defect in the answer to %s %s", request.method, request.path)
        return failure(UavApiError(f"a defect of this program: {error!r}"))
