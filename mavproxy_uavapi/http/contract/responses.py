"""Answers: the success envelope, and the body of an error."""

from __future__ import annotations

import json
import math
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, cast

from aiohttp import web

from mavproxy_uavapi.core.errors import TooManyRequests, UavApiError, Unauthorized
from mavproxy_uavapi.http.contract.answers import Failure, Success

Done = Success | web.StreamResponse  # of a verb: it was done, or goes on as a job
MULTI_STATUS = 207  # of an answer for several, of which not all are a success
Handler = Callable[[web.BaseRequest], Awaitable[web.StreamResponse]]


def envelope(system: int | None, result: str) -> Success:
    """What every success begins with; `system` is None without a vehicle."""
    return {"device": "uav", "id": None if system is None else str(system), "result": result}


_encode = json.JSONEncoder(allow_nan=False).encode  # `json.dumps` would make an encoder for each call


def dumps(body: Any) -> str:
    """JSON in which NaN and infinities become null, because JSON does not have them."""
    try:
        return _encode(body)
    except (TypeError, ValueError):  # what `finite` takes besides: rarely, and it costs more than the rest
        return _encode(finite(body))


def finite(value: Any) -> Any:
    """`value` with each float that is not finite replaced by None, at any depth."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value


def reason(error: UavApiError) -> Failure:
    """What an answer says of an error: `detail`, `code`, and what else there is."""
    return cast(Failure, {"detail": error.detail, "code": error.code, **error.extras()})


def success(body: Mapping[str, Any]) -> web.Response:
    """A 200 with a JSON body."""
    return web.json_response(body, dumps=dumps)


def failure(error: UavApiError) -> web.Response:
    """The answer to any UavApiError."""
    response = web.json_response(reason(error), status=error.status, dumps=dumps)
    if isinstance(error, Unauthorized):
        response.headers["WWW-Authenticate"] = "Bearer"
    if isinstance(error, TooManyRequests):
        response.headers["Retry-After"] = str(error.retry_after)
    return response
