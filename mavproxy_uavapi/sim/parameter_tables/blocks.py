"""The shape of a table."""

from __future__ import annotations

from typing import NamedTuple


class Blocks(NamedTuple):
    """NAME=VALUE words, one block for each type that ArduPilot stores."""

    int8: str
    int16: str
    int32: str
    real32: str
