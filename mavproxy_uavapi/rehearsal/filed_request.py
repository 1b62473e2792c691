"""A request of the API as a file: a track, or JSON with path, body and, for a camera, settings of `vision`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.strict_json import json_of

TRACKS = (".track", ".tuple")
FLY_TRACK = "/mission/fly-track"
JSON = ".json"


class FiledRequest(NamedTuple):
    """What is asked by POST.

    Attributes:
        path: of the API, without the prefix of a vehicle.
        body: its parameters.
        vision: settings of the module vision meanwhile.
    """

    path: str
    body: dict[str, Any]
    vision: dict[str, Any]


def request_in(file: Path) -> FiledRequest | None:
    """The request that a file is; None for another file.

    Raises:
        OSError: it cannot be read.
    """
    if file.suffix in TRACKS:
        return FiledRequest(FLY_TRACK, {"track": file.read_text(encoding="utf-8", errors="replace")}, {})
    if file.suffix != JSON:
        return None
    try:
        value = json_of(file.read_text(encoding="utf-8", errors="replace"), file.name)
    except UavApiError:  # the vehicle refuses it as a mission
        return None
    path, body, vision = (value.get(name) for name in FiledRequest._fields) if isinstance(value, dict) else [None] * 3
    if not isinstance(path, str):
        return None
    return FiledRequest(path, body or {}, vision or {})
