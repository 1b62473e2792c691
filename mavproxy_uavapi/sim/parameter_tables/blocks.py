"""The shape of a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from .names import Former


def numbered(words: str, last: int) -> str:
    """The words with each number from 1 to `last` in place of #."""
    return " ".join(words.replace("#", str(number)) for number in range(1, last + 1))


class Blocks(NamedTuple):
    """NAME=VALUE words, one block for each type that ArduPilot stores, and what 4.6 has instead of some, by name.

    Of a name that is there twice the last value counts.
    """

    int8: str
    int16: str
    int32: str
    real32: str
    former: tuple[tuple[str, Former], ...] = ()

    def with_own(
        self, int8: str, int16: str, int32: str, real32: str, former: Mapping[str, Former] | None = None
    ) -> Blocks:
        """These, and the others of a type, which may have other values."""
        words = (self.int8 + int8, self.int16 + int16, self.int32 + int32, self.real32 + real32)
        return Blocks(*words, (*self.former, *(former or {}).items()))
