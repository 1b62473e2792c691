"""How many of a vehicle's messages never arrive, by their sequence numbers. Pure: the clock is an argument."""

from __future__ import annotations

import math

NUMBERS = 256  # sequence numbers of MAVLink, which then begin anew
REORDER = NUMBERS // 2  # a step back of less than this is a message out of order, not a loss
SILENT = 1.0  # s of silence after which a step back is none: more messages are lost than their numbers tell


def is_before(earlier: int, later: int) -> bool:
    """Whether one sequence number comes before another, as far as they tell."""
    return 0 < (later - earlier) % NUMBERS < REORDER


class PacketLoss:
    """The messages of one component.

    Attributes:
        received, lost: how many arrived, each once, and how many did not.
    """

    def __init__(self) -> None:
        self.received = self.lost = 0
        self._newest: int | None = None
        self._heard_at = -math.inf
        self._missing: dict[int, float] = {}  # numbers that were skipped, and when (s)

    @property
    def share(self) -> float:
        """The share that never arrived, 0 to 1."""
        sent = self.received + self.lost
        return self.lost / sent if sent else 0.0

    def has_any_since(self, at: float) -> bool:
        """Whether messages are missing, as what arrived after `at` (s) shows."""
        return any(noticed_at >= at for noticed_at in self._missing.values())

    def count(self, number: int, now: float) -> None:
        """Take the sequence number of a message that arrived at `now` (s)."""
        if self._newest is not None:
            step = (number - self._newest) % NUMBERS
            is_next = is_before(self._newest, number)
            if not is_next and self._missing.pop(number, None) is not None:
                self.lost, self.received = self.lost - 1, self.received + 1
                return  # it was late
            if not is_next and not (step and now - self._heard_at > SILENT):
                return  # a second copy
            self.lost += step - 1
            self._missing.update(((number - back) % NUMBERS, now) for back in range(1, step))
        self._newest, self._heard_at = number, now
        self._missing.pop(number, None)
        self.received += 1

    def begin_anew(self) -> None:
        """After a reboot the numbers begin anew, and whatever the missing messages showed is over."""
        self._missing.clear()
        self._newest = None
