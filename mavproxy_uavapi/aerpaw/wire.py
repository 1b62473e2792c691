"""What runners send each other: pickles, as aerpawlib has them, but none that runs anything here."""

from __future__ import annotations

import io
import pickle
import sys
from typing import Any

from mavproxy_uavapi.aerpaw import geometry

# Data of the standard library and numpy, and aerpawlib's own, by the name that they have in a pickle.
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
    """Finds data types only, and the classes of the script that runs."""

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
        raise pickle.UnpicklingError(f"{module}.{name} is not taken from the network")


def read(data: bytes, module: str) -> dict[str, Any]:
    """A message.

    Args:
        data: as it came.
        module: of the script; its own classes are taken.

    Raises:
        ValueError: it is none, or holds what is not taken.
    """
    try:
        message = _Unpickler(data, module).load()
    except (pickle.UnpicklingError, EOFError, AttributeError, ImportError, IndexError, KeyError, TypeError) as error:
        raise ValueError(str(error) or "no pickle") from error
    if not isinstance(message, dict):
        raise ValueError(f"{type(message).__name__} is no message")
    return message


def written(message: dict[str, Any]) -> bytes:
    """A message for the network."""
    return pickle.dumps(message)
