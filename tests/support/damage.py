"""Damages a file as editors, programs and attackers do. Pure, but for its dice."""

from __future__ import annotations

import json
import random
import re

WORDS = (
    b"9" * 401, b"-" + b"9" * 401, b"1e999", b"NaN", b"Infinity", b"null", b"true", b"{}", b"[]", b'""', b"0", b"-1",
    b"1.5", b"1,5", b"0x10", b'"\\ud800"', b"\\u0000", b"\x00", b"\xff", b"\xef\xbb\xbf", b"\xc3\xa9", b"\r",
    b"\r\n", b"\n", b"\t", b"\x1b[2J", b"<a>", b"</a>", b"<!DOCTYPE a>", b"&a;", b"<![CDATA[", b"]]>", b"#",
    b"@include x", b"%YAML:1.0", b"---", b"&a", b"*a", b"!!python/object:os.system", b"!!opencv-matrix", b"? ", b": ",
    b"[api]", b"=", b"sha256:", b"fly:1,2", b"QGC WPL 110\n", b'"type"', b'"kind"', b'"items"', b'"command"',
    b'"polygon"', b'"features"', b'"limits"', b"Exclusion",
)  # fmt: skip
LARGEST = 200_000  # bytes
NUMBER = re.compile(rb"-?[0-9]+(?:\.[0-9]+)?")
ENCODINGS = ("utf-16", "utf-16-le", "utf-8-sig", "utf-32", "cp1252", "utf-7")


def damaged(data: bytes, dice: random.Random) -> bytes:
    """The file with some damage."""
    for _ in range(dice.choice((1, 1, 2, 3, 8))):
        data = dice.choice((_cut, _put, _number, _member, _repeat, _recoded, _flip, _nested))(data, dice)[:LARGEST]
    return data


def _cut(data: bytes, dice: random.Random) -> bytes:
    start, end = sorted(dice.randrange(len(data) + 1) for _ in range(2))
    return data[:start] + data[end:]


def _put(data: bytes, dice: random.Random) -> bytes:
    at = dice.randrange(len(data) + 1)
    return data[:at] + dice.choice(WORDS) + data[at:]


def _number(data: bytes, dice: random.Random) -> bytes:
    numbers = list(NUMBER.finditer(data))
    if not numbers:
        return data
    match = dice.choice(numbers)
    return data[: match.start()] + dice.choice(WORDS) + data[match.end() :]


def _member(data: bytes, dice: random.Random) -> bytes:
    """A JSON value anywhere in it by another; other files as they are."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return data
    places = list(_places(value))
    if not places:
        return data
    holder, key = dice.choice(places)
    other = dice.choice((None, True, 0, -1, 1e300, "", "x", [], {}, [[]], 10**20, *(h[k] for h, k in places[:20])))
    if dice.random() < 0.3:
        del holder[key]
    else:
        holder[key] = other
    try:
        return json.dumps(value).encode()
    except (ValueError, RecursionError):  # it holds itself now
        return data


def _places(value: object) -> list[tuple[object, object]]:
    found: list[tuple[object, object]] = []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in list(items):
        found += [(value, key), *_places(inner)]
    return found


def _repeat(data: bytes, dice: random.Random) -> bytes:
    start, end = sorted(dice.randrange(len(data) + 1) for _ in range(2))
    return data[:end] + data[start:end] * dice.choice((1, 2, 50)) + data[end:]


def _recoded(data: bytes, dice: random.Random) -> bytes:
    return data.decode(errors="replace").encode(dice.choice(ENCODINGS), "replace")


def _flip(data: bytes, dice: random.Random) -> bytes:
    if not data:
        return data
    at = dice.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << dice.randrange(8)]) + data[at + 1 :]


def _nested(data: bytes, dice: random.Random) -> bytes:
    opening, closing = dice.choice(((b"[", b"]"), (b'{"a":', b"}"), (b"<a>", b"</a>"), (b"(", b")"), (b"- ", b"")))
    depth, at = dice.choice((1, 30, 1000)), dice.randrange(len(data) + 1)
    return data[:at] + opening * depth + data[at:] + closing * depth
