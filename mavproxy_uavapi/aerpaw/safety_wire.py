"""`aerpawlib.v1.safety.wire_format`: the messages of the safety checker, JSON that is compressed by zlib."""

from __future__ import annotations

import json
import zlib
from typing import Any

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.file_text import text_of
from mavproxy_uavapi.core.strict_json import json_of

LARGEST = 1024 * 1024  # bytes of a message


def serialize_msg(raw_json: str) -> bytes:
    """Encode a text."""
    return zlib.compress(raw_json.encode())


def serialize_request(request_function: str, params: list[Any]) -> bytes:
    """Encode a request."""
    return serialize_msg(json.dumps({"request_function": request_function, "params": params}))


def serialize_response(request_function: str, *, result: bool, message: str = "") -> bytes:
    """Encode a response."""
    return serialize_msg(json.dumps({"request_function": request_function, "result": result, "message": message}))


def deserialize_msg(compressed_msg: bytes) -> dict[str, Any]:
    """Decode a message.

    Raises:
        ValueError: it is malformed.
    """
    inflate = zlib.decompressobj()
    try:
        text = inflate.decompress(compressed_msg, LARGEST)
    except zlib.error as error:
        raise ValueError("Failed to decompress message") from error
    if not inflate.eof:
        raise ValueError(f"it is incomplete, or larger than {LARGEST} bytes")
    try:
        message = json_of(text_of(text, "a message"), "a message")
    except UavApiError as error:
        raise ValueError(str(error)) from error
    if not isinstance(message, dict):
        raise ValueError(f"{message!r} is not a message")
    return message
