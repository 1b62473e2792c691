"""Answers: the envelope that clients know, and errors by the one tree of `errors.py`."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from aiohttp import web

from mavproxy_uavapi.core.errors import (
    BadRequest,
    NotFound,
    TooManyRequests,
    UavApiError,
    Unauthorized,
    without_frames,
)

log = logging.getLogger("uavapi.http")
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
REFUSED: web.AppKey[Callable[[str, str], None]] = web.AppKey("refused")  # called with address and code
REFUSALS = (401, 403, 429)  # statuses of a caller that is turned away


def envelope(system: int, result: str, **members: Any) -> dict[str, Any]:
    """A success body: device, id (the system id as text), result, and what else there is to say."""
    return {"device": "uav", "id": str(system), "result": result, **members}


def dumps(body: Any) -> str:
    """JSON without NaN and infinities, which are not JSON: they become null."""
    return json.dumps(finite(body), allow_nan=False)


def finite(value: Any) -> Any:
    """`value` with each float that is not finite replaced by None, to any depth."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value


def success(body: Mapping[str, Any]) -> web.Response:
    """A 200 with a JSON body."""
    return web.json_response(body, dumps=dumps)


def failure(error: UavApiError) -> web.Response:
    """The answer to any error of the tree."""
    body = {"detail": error.detail, "code": error.code, **error.extras()}
    response = web.json_response(body, status=error.status, dumps=dumps)
    if isinstance(error, Unauthorized):
        response.headers["WWW-Authenticate"] = "Bearer"
    if isinstance(error, TooManyRequests):
        response.headers["Retry-After"] = str(error.retry_after)
    return response


def of_http_exception(error: web.HTTPException) -> web.Response:
    """What aiohttp itself refuses (no such path, wrong method, too large a body), in our words."""
    ours: UavApiError
    if error.status == 404:
        ours = NotFound("no such path")
        return failure(ours)
    ours = BadRequest(error.reason)
    response = web.json_response({"detail": ours.detail, "code": ours.code}, status=error.status, dumps=dumps)
    if "Allow" in error.headers:
        response.headers["Allow"] = error.headers["Allow"]
    return response


@web.middleware
async def errors_as_answers(request: web.Request, handler: Handler) -> web.StreamResponse:
    """The one place where errors become answers."""
    try:
        return await handler(request)
    except UavApiError as error:
        if error.status in REFUSALS and not error.in_trail:
            request.app[REFUSED](request.remote or "unknown", error.code)
        return failure(without_frames(error))
    except web.HTTPException as error:
        return of_http_exception(error) if error.status >= 400 else error
    except Exception as error:
        log.exception("defect in the answer to %s %s", request.method, request.path)
        return failure(UavApiError(f"a defect of this program: {error!r}"))
