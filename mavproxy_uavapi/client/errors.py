"""Makes the server's error, of the same class, from an error answer of the API."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mavproxy_uavapi.core import errors
from mavproxy_uavapi.core.errors import Invalid, Rejected, StateChanged, TimedOut, UavApiError


class Unreachable(errors.Unavailable):
    """Nothing answers at the API's address, or the answer is not the API's."""

    code = "unreachable"


def _tree(base: type[UavApiError]) -> Iterator[type[UavApiError]]:
    yield base
    for child in base.__subclasses__():
        yield from _tree(child)


# A class comes before its children here: if both have the same code, the parent is used.
BY_CODE: dict[str, type[UavApiError]] = {}
for _error in _tree(UavApiError):
    if _error.__module__ == errors.__name__:
        BY_CODE.setdefault(_error.code, _error)


def error_of(status: int, body: Mapping[str, Any]) -> UavApiError:
    """The error for a status and its body; an unknown code gives a UavApiError."""
    detail, kind = body.get("detail"), BY_CODE.get(str(body.get("code")))
    sentence = str(detail) if detail else f"the API answered {status}"
    statustext = body.get("statustext", [])
    if kind is None:
        return UavApiError(f"{sentence} ({status})")
    if issubclass(kind, Invalid):
        return kind(detail if isinstance(detail, list) else sentence)
    if issubclass(kind, Rejected):
        return kind(sentence, body.get("ack"), statustext)
    if issubclass(kind, StateChanged):
        return kind(sentence, body.get("change"), statustext)
    if issubclass(kind, TimedOut):
        return kind(sentence, statustext)
    return kind(sentence)
