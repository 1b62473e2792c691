"""Gives memory that was freed back to the system, and keeps the garbage collector's pauses short.

The C library keeps what a burst of work has freed: MAVProxy's own start leaves it 80 MB, a flood of connections 15 MB
more. On a small computer that is memory which other programs lack.

The garbage collector stops all threads while it looks at each object: 30 to 70 ms for the 100,000 of MAVProxy and the
modules, which stay anyway. So it is told not to look at them any more.
"""

from __future__ import annotations

import asyncio
import ctypes
import gc

EVERY = 60.0  # s; the first time takes 9 ms, later ones 0.3 ms


def keep_what_is_loaded() -> None:
    """Let the garbage collector pass over all objects that there are now; what unreachable ones hold stays, too.

    Only the first call in a process does so: what a module that is loaded again leaves behind must be found.
    """
    if not gc.get_freeze_count():
        gc.freeze()


async def give_back() -> None:
    """Give freed memory back, again and again; returns at once where the C library is not glibc."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    while trim is not None:
        await asyncio.to_thread(trim, 0)
        await asyncio.sleep(EVERY)
