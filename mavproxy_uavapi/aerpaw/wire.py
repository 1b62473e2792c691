"""The messages between runners: pickles, as in aerpawlib, but only of types that cannot run code."""

from __future__ import annotations

import io
import pickle
import pickletools
import sys
from collections import OrderedDict, deque
from collections.abc import Callable
from typing import Any

from mavproxy_uavapi.aerpaw import geometry

# The data types of the standard library, numpy and aerpawlib, by their names in a pickle.
PLAIN = {
    "builtins": {"complex", "slice"},
    "datetime": {"date", "datetime", "time", "timedelta", "timezone"},
    "decimal": {"Decimal"},
    "numpy": {"dtype"},
    "numpy.core.multiarray": {"scalar"},
    "numpy._core.multiarray": {"scalar"},
    "_codecs": {"encode"},
}
OURS = {"Coordinate": geometry.Coordinate, "VectorNED": geometry.VectorNED}


def _made_of(kind: type, *parts: type) -> Callable[..., Any]:
    """The type as a function that takes only such data."""

    def make(*data: Any) -> Any:
        if data and not isinstance(data[0], parts):
            raise pickle.UnpicklingError(f"a {kind.__name__} of {type(data[0]).__name__} is not accepted")
        return kind(*data)

    return make


def _array_of(data: Any, dtype: Any, shape: Any, order: Any, axes: Any = None) -> Any:
    """The array of these bytes, as protocol 5 writes it; `axes` says how the axes of another order were turned."""
    import numpy as np  # noqa: PLC0415  only where a peer sends one

    if not isinstance(data, bytes | bytearray):
        raise pickle.UnpicklingError(f"an array of {type(data).__name__} is not accepted")
    array = np.frombuffer(data, dtype)
    return array.reshape(shape, order=order) if axes is None else array.reshape(shape).transpose(axes)


def _empty_array(*_: Any) -> Any:
    """The array that the rest of its pickle fills."""
    import numpy as np  # noqa: PLC0415  only where a peer sends one

    return np.empty(0)


# Opcodes that take a place in the memo, which the unpickler makes as long as that.
PLACES = {"PUT", "BINPUT", "LONG_BINPUT"}

# What stands in for types that take more than a pickle gives them. Of a range, a number of bytes or an array's shape
# a message of a few bytes would make something huge, or never be read.
STAND_INS: dict[tuple[str, str], Callable[..., Any] | None] = {
    ("builtins", "bytearray"): _made_of(bytearray, bytes),
    ("builtins", "frozenset"): _made_of(frozenset, list),
    ("builtins", "set"): _made_of(set, list),
    ("collections", "OrderedDict"): _made_of(OrderedDict, list, tuple),
    ("collections", "deque"): _made_of(deque, list, tuple),
    ("numpy", "ndarray"): None,  # only `_reconstruct` gets it
    ("numpy.core.numeric", "_frombuffer"): _array_of,
    ("numpy._core.numeric", "_frombuffer"): _array_of,
    ("numpy.core.multiarray", "_reconstruct"): _empty_array,
    ("numpy._core.multiarray", "_reconstruct"): _empty_array,
}


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
        if (module, name) in STAND_INS:
            return STAND_INS[module, name]
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
        _require_small(data)
        message = _Unpickler(data, module).load()
    except pickle.UnpicklingError as error:
        raise ValueError(str(error) or "not a pickle") from error
    except Exception as error:  # noqa: BLE001  a damaged pickle ends in any error
        raise ValueError("it is not a pickle, or damaged") from error
    if not isinstance(message, dict):
        raise ValueError(f"{type(message).__name__} is not a message")
    return message


def _require_small(data: bytes) -> None:
    """Raise an error if the unpickler would need more room than the bytes have: 12 of them can take gigabytes.

    A length that goes beyond the end is an error of `genops` itself.
    """
    for opcode, argument, _ in pickletools.genops(data):
        if opcode.name in PLACES and int(argument or 0) > len(data):
            raise pickle.UnpicklingError(f"{opcode.name} is not accepted from the network")


def written(message: dict[str, Any]) -> bytes:
    """Encode a message."""
    return pickle.dumps(message)
