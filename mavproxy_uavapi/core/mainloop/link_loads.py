"""How full MAVProxy's serial links are. Everything here runs in MAVProxy's main loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

FULL = 0.8  # share of its capacity from which a link counts as full
BITS_PER_BYTE = 10  # with start and stop bit
SPAN = 2.0  # s over which bytes are counted


class LinkLoads:
    """Counts the bytes of each serial link."""

    def __init__(self) -> None:
        self._from: dict[int, tuple[float, int]] = {}  # when the count began (s), and at how many bytes, by link
        self._full: dict[int, bool] = {}

    def any_is_full(self, masters: Sequence[Any], now: float) -> bool:
        """Whether one of them has no room for what can wait.

        Args:
            masters: MAVProxy's links; those with a baud rate count.
            now: s.
        """
        present = {id(master): master for master in masters if _baud_rate(master)}
        self._full = {link: full for link, full in self._full.items() if link in present}
        for link, master in present.items():
            count = master.mav.total_bytes_received + master.mav.total_bytes_sent
            at, before = self._from.setdefault(link, (now, count))
            if now - at >= SPAN:
                self._full[link] = (count - before) / (now - at) >= FULL * _baud_rate(master) / BITS_PER_BYTE
                self._from[link] = now, count
        return any(self._full.values())


def _baud_rate(master: Any) -> int:
    """Bits per second; 0 for a link that is not serial."""
    rate = getattr(getattr(master, "port", None), "baudrate", 0)
    return rate if isinstance(rate, int) else 0
