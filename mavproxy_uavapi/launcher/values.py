"""Text from the command line or an INI file -> a value; a ValueError says what is expected."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from contextlib import suppress

from mavproxy_uavapi.core import logs
from mavproxy_uavapi.core.values import words

VEHICLES = ("copter", "plane", "quadplane", "rover")
_MODULE = re.compile(r"([A-Za-z_]\w*)(?::(\{.*\}))?", re.DOTALL)


def _whole(low: int, high: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        if not text.strip().isascii() or not text.strip().isdigit() or not low <= int(text) <= high:
            raise ValueError(f"expected a whole number from {low} to {high}")
        return int(text)

    return whole


def _number(expected: str, fits: Callable[[float], bool]) -> Callable[[str], float]:
    def number(text: str) -> float:
        with suppress(ValueError):
            value = float(text)
            if math.isfinite(value) and fits(value):
                return value
        raise ValueError(f"expected {expected}")

    return number


port = _whole(1, 65535)  # TCP
system_id = count = _whole(1, 255)
stream_rate = _whole(1, 500)  # Hz, as MAVProxy's setting `streamrate` takes it
distance = _number("a number of metres", lambda value: value >= 0)
factor = _number("a number above 0", lambda value: value > 0)


def vehicles(text: str) -> tuple[tuple[str, int], ...]:
    """`copter:8,rover:2` -> (("copter", 8), ("rover", 2)); a type alone is one vehicle."""
    types = [word.partition(":") for word in words(text)]
    return tuple((one_of(*VEHICLES)(kind), count(number) if colon else 1) for kind, colon, number in types)


def components(text: str) -> tuple[str, ...]:
    """Log components, by their names here or in the original service, without duplicates."""
    try:
        return logs.components(text)
    except ValueError as error:
        raise ValueError(f"expected some of {', '.join(logs.NAMES)}") from error


def host_port(text: str) -> str:
    """`HOST:PORT` with a port from 1 to 65535."""
    host, _, number = text.strip().rpartition(":")
    if not host or re.search(r"[\s/]", host):
        raise ValueError("expected HOST:PORT")
    port(number)
    return text.strip()


def modules(text: str) -> tuple[str, ...]:
    """One MAVProxy module, `NAME` or `NAME:{"key":value}`, or several names with commas between."""
    names = (text,) if "{" in text else tuple(part for part in text.split(",") if part)
    matches = [_MODULE.fullmatch(name) for name in names]
    if not matches or None in matches:
        raise ValueError('expected NAME or NAME:{"key":value}')
    return tuple(
        f"{match[1]}:{one_word(json.loads(match[2]))}" if match[2] else match[1] for match in matches if match
    )


def one_word(settings: Mapping[str, object]) -> str:
    """JSON that MAVProxy does not split: it splits `--cmd` at `;`, and a command at white space."""
    text = json.dumps(settings, separators=(",", ":"))
    return text.replace(" ", r"\u0020").replace(";", r"\u003b")


def one_of(*choices: str) -> Callable[[str], str]:
    """A converter that accepts only these words."""

    def choice(text: str) -> str:
        if text.strip() not in choices:
            raise ValueError(f"expected {', '.join(choices[:-1])} or {choices[-1]}")
        return text.strip()

    return choice
