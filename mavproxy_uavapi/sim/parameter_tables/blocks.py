"""The shape of a table."""

from __future__ import annotations

from typing import NamedTuple

from .names import Former


class Blocks(NamedTuple):
    """NAME=VALUE words, one block for each type that ArduPilot stores, and what 4.6 has instead of some, by name."""

    int8: str
    int16: str
    int32: str
    real32: str
    former: tuple[tuple[str, Former], ...] = ()
