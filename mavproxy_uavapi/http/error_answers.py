"""Turns errors into answers, in one place."""

from __future__ import annotations

import logging

from aiohttp import web

from mavproxy_uavapi.core.errors import BadRequest, NotFound, UavApiError, without_frames
from mavproxy_uavapi.http.call import SERVICE
from mavproxy_uavapi.http.caller import client_of
from mavproxy_uavapi.http.responses import Handler, dumps, failure

log = logging.getLogger("uavapi.http")
REFUSALS = (401, 403, 429)  # statuses of refused callers


def of_http_exception(error: web.HTTPException) -> web.Response:
    """The answer to a refusal by aiohttp itself (no such path, wrong method, too large a body), in our format."""
    refusal: UavApiError
    if error.status == 404:
        refusal = NotFound("no such path")
        return failure(refusal)
    refusal = BadRequest(error.reason)
    response = web.json_response({"detail": refusal.detail, "code": refusal.code}, status=error.status, dumps=dumps)
    if "Allow" in error.headers:
        response.headers["Allow"] = error.headers["Allow"]
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
