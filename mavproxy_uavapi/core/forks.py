"""Keeps MAVProxy's forks apart from our starts of programs.

MAVProxy forks for its map and console. A child that it forks while another thread starts a program inherits the pipe
by which that thread learns that the program runs, and the thread waits for as long as the child lives.
"""

from __future__ import annotations

import os
import threading
from contextlib import AbstractContextManager

_apart = threading.RLock()  # the event loop's thread may start several programs at once
# Registered once per process, because Python cannot remove such a hook. The child's copy belongs to the same thread.
os.register_at_fork(before=_apart.acquire, after_in_parent=_apart.release, after_in_child=_apart.release)


def apart_from_forks() -> AbstractContextManager[object]:
    """Around the start of a program: no other thread forks meanwhile. Any thread."""
    return _apart
