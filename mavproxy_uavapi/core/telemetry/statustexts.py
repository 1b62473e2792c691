"""What an autopilot says in words: STATUSTEXT, whole or in chunks. Pure: the clock is an argument."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

KEPT = 200
CHUNK = 50  # characters of a full chunk
CHUNK_TIMEOUT = 2.0  # s after which the missing chunks of a text count as lost


@dataclass(frozen=True)
class StatusText:
    """What the autopilot said: when it arrived (s), MAV_SEVERITY, text."""

    at: float
    severity: int
    text: str


@dataclass
class ChunkedText:
    """A text of more than 50 characters, which comes in chunks: MAV_SEVERITY, and when the newest came (s)."""

    severity: int
    heard_at: float = 0.0
    _chunks: dict[int, str] = field(default_factory=dict)

    def add(self, number: int, text: str, now: float) -> None:
        """Take chunk `number`, from 0."""
        self._chunks[number], self.heard_at = text, now

    @property
    def is_complete(self) -> bool:
        """Whether its last chunk, the one that is not full, is here; a chunk before it may be lost."""
        return len(self._chunks[max(self._chunks)]) < CHUNK

    def __str__(self) -> str:
        """The chunks that arrived, with … in place of lost ones."""
        numbers = sorted(self._chunks)
        gaps = [n for n, before in zip(numbers, [-1, *numbers], strict=False) if n > before + 1]
        return "".join(("…" if n in gaps else "") + self._chunks[n] for n in numbers)


class StatusTexts:
    """The newest texts of one autopilot, oldest first."""

    def __init__(self) -> None:
        self._texts: deque[StatusText] = deque(maxlen=KEPT)
        self._chunked: dict[int, ChunkedText] = {}  # by their ids, which come again

    def __iter__(self) -> Iterator[StatusText]:
        return iter(self._texts)

    @property
    def newest(self) -> StatusText | None:
        """The newest text; None before the first."""
        return self._texts[-1] if self._texts else None

    def since(self, at: float) -> list[str]:
        """What was said since `at` (s)."""
        return [text.text for text in self._texts if text.at >= at]

    def after(self, last: StatusText | None) -> list[StatusText]:
        """The texts after `last`; all if that is forgotten."""
        texts: list[StatusText] = []
        for text in reversed(self._texts):
            if text is last:
                break
            texts.append(text)
        return texts[::-1]

    def take(self, message: Any, now: float) -> None:
        """Take a STATUSTEXT that arrived at `now` (s)."""
        if not message.id:
            self._texts.append(StatusText(now, message.severity, message.text))
            return
        text = self._chunked.setdefault(message.id, ChunkedText(message.severity))
        text.add(message.chunk_seq, message.text, now)
        if text.is_complete:
            self._say(message.id, now)

    def give_up_late_chunks(self, now: float) -> None:
        """Say the texts whose missing chunks have not come in time, with what has."""
        for number in [n for n, text in self._chunked.items() if now - text.heard_at > CHUNK_TIMEOUT]:
            self._say(number, now)

    def forget_chunks(self) -> None:
        """After a reboot the rest of a text does not come."""
        self._chunked.clear()

    def _say(self, number: int, now: float) -> None:
        text = self._chunked.pop(number)
        self._texts.append(StatusText(now, text.severity, str(text)))
