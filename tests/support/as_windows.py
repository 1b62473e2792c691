"""Runs a module of ours on a Python that lacks what Windows lacks: `python as_windows.py MODULE [ARGUMENT …]`.

It shows that nothing on the module's way needs POSIX. What Windows does otherwise, it does not show.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import runpy
import signal
import socket
import sys
import time
from importlib.abc import MetaPathFinder
from pathlib import Path

import psutil  # noqa: F401

# What has other ways there is imported before.
import asyncio.unix_events  # isort: skip
import logging.handlers  # noqa: F401
import multiprocessing.pool  # noqa: F401
import subprocess  # noqa: F401
import tempfile  # noqa: F401
import uuid  # noqa: F401

MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "termios", "tty"}
OF_OS = {
    "fork",
    "register_at_fork",
    "waitid",
    "pidfd_open",
    "killpg",
    "setsid",
    "getsid",
    "getpgid",
    "geteuid",
    "getuid",
}
OF_OS |= {"chown", "fchmod", "mkfifo", "statvfs", "nice", "sched_getaffinity", "sched_setaffinity"}
OF_OS |= {"O_NONBLOCK", "O_CLOEXEC", "O_NOFOLLOW", "O_DIRECTORY", "WNOHANG"}
SIGNALS = ("SIGHUP", "SIGKILL", "SIGCHLD", "SIGUSR1", "SIGUSR2", "SIGSTOP", "SIGCONT", "SIGTTOU", "SIGQUIT")


class Refusal(MetaPathFinder):
    """Finds none of those modules."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def unlike_posix() -> None:
    """Take away what Windows has not."""
    for name in MODULES:
        sys.modules.pop(name, None)
    sys.meta_path.insert(0, Refusal())
    for holder, names in ((os, OF_OS), (signal, SIGNALS), (socket, ("SO_REUSEPORT",)), (time, ("tzset",))):
        for name in names:
            with contextlib.suppress(AttributeError):
                delattr(holder, name)

    def refuse(*_: object) -> None:
        raise NotImplementedError

    asyncio.unix_events._UnixSelectorEventLoop.add_signal_handler = refuse  # type: ignore[assignment,attr-defined]


if __name__ == "__main__":
    unlike_posix()
    sys.argv = sys.argv[1:]
    sys.path[0] = str(Path(__file__).parents[2])
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
