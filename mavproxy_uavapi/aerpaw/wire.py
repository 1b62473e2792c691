"""The messages between runners: pickles, as in aerpawlib, but only of types that cannot run code."""

from __future__ import annotations

import io
import pickle
import sys
from typing import Any

from mavproxy_uavapi.aerpaw import geometry

# The data types of the standard library, numpy and aerpawlib, by their names in a pickle.
PLAIN = {
    "builtins": {"bytearray", "complex", "frozenset", "range", "set", "slice"},
    "collections": {"OrderedDict", "deque"},
    "datetime": {"date", "datetime", "time", "timedelta", "timezone"},
    "decimal": {"Decimal"},
    "numpy": {"dtype", "ndarray"},
    "numpy.core.multiarray": {"_reconstruct", "scalar"},
    "numpy._core.multiarray": {"_reconstruct", "scalar"},
    "_codecs": {"encode"},
}
OURS = {"Coordinate": geometry.Coordinate, "VectorNED": geometry.VectorNED}


class _Unpickler(pickle.Unpickler):
    """Allows only data types, and the classes of the running script."""

    def __init__(self, data: bytes, module: str) -> None:
        super().__init__(io.BytesIO(data))
        self._module = module

    def find_class(self, module: str, name: str) -> Any:
        if module.startswith("aerpawlib.") and name in OURS:
            return OURS[name]
        if name in PLAIN.get(module, ()):
            return super().find_class(module, name)
        one = getattr(sys.modules.get(module), name, None) if module == self._module else None
        if isinstance(one, type) and one.__module__ == module:
            return one
        raise pickle.UnpicklingError(f"{module}.{name} is not accepted from the network")


def read(data: bytes, module: str) -> dict[str, Any]:
    """Decode a message.

    Args:
        data: the received bytes.
        module: the script's module; its own classes are accepted.

    Raises:
        ValueError: it is not a message, or has a type that is not accepted.
    """
    try:
        message = _Unpickler(data, module).load()
    except (pickle.UnpicklingError, EOFError, AttributeError, ImportError, IndexError, KeyError, TypeError) as error:
        raise ValueError(str(error) or "not a pickle") from error
    if not isinstance(message, dict):
        raise ValueError(f"{type(message).__name__} is not a message")
    return message


def written(message: dict[str, Any]) -> bytes:
    """Encode a message."""
    return pickle.dumps(message)
