"""Logs by component: which of them go to MAVProxy's console and to the file, and in which detail.

The components are those of the original service: COPTER (alias VEHICLE), API, GRADYS_GS, SCRIPT. Warnings and
errors always show in the console.
"""

from __future__ import annotations

import logging
import logging.handlers
import queue
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.rotating_file import RotatingFile
from mavproxy_uavapi.core.text import line_of
from mavproxy_uavapi.core.values import words

try:
    import readline
except ImportError:  # without it there is no typed line to restore
    readline = None  # type: ignore[assignment]

# Component -> its loggers.
COMPONENTS = {
    "COPTER": ("uavapi.copter",),
    "API": ("uavapi.http", "uavapi.audit"),
    "GRADYS_GS": ("gradys",),
    "SCRIPT": ("uavapi.script",),
}
ALIASES = {"VEHICLE": "COPTER", "UVICORN": "API"}
NAMES = (*COMPONENTS, *ALIASES)
ROOTS = ("uavapi", "gradys")
FILE_BYTES = 5_000_000
FILES_KEPT = 3
FORMAT = "%(asctime)s %(component)s %(levelname)s %(message)s"


def component_of(logger: str) -> str:
    """The component of a logger; API for a logger of none."""
    for component, names in COMPONENTS.items():
        if any(logger == name or logger.startswith(name + ".") for name in names):
            return component
    return "API"


def components(text: str) -> tuple[str, ...]:
    """Component names, by comma or space, in any case, aliases resolved, without duplicates.

    Raises:
        ValueError: no such component.
    """
    named = [ALIASES.get(word.upper(), word.upper()) for word in words(text)]
    unknown = [word for word in named if word not in COMPONENTS]
    if unknown:
        raise ValueError(f"no log component {unknown[0]}; there are {', '.join(NAMES)}")
    return tuple(dict.fromkeys(named))


class _Named(logging.Filter):
    """Gives each record its component. With `shown`, only those components and warnings pass."""

    def __init__(self, shown: frozenset[str] | None = None) -> None:
        super().__init__()
        self._components = shown

    def filter(self, record: logging.LogRecord) -> bool:
        component = component_of(record.name)
        record.__dict__["component"] = component
        return self._components is None or record.levelno >= logging.WARNING or component in self._components


class _Console(logging.Handler):
    """Hands each line to MAVProxy's main loop."""

    def __init__(self, say: Callable[[str], None]) -> None:
        super().__init__()
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        self._say(self.format(record))


class _Formatter(logging.Formatter):
    """Makes one line of each record, even if a client put line breaks into it; a traceback keeps its lines."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802  logging's own name
        return line_of(super().formatMessage(record))

    def formatException(self, ei: Any) -> str:  # noqa: N802  logging's own name
        return "\n".join(map(line_of, super().formatException(ei).split("\n")))


class Logs:
    """The handlers in force, from `open` to `close`.

    Args:
        say: puts a line on MAVProxy's console; callable from any thread.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._handlers: list[logging.Handler] = []
        self._listener: logging.handlers.QueueListener | None = None

    def open(self, console: frozenset[str], debug: frozenset[str], path: str, system: int) -> None:
        """Begin to log.

        Args:
            console: components that log to the console too.
            debug: components that log in detail.
            path: the log file, or the folder for `uav_<system>.log`; empty for none.
            system: the vehicle's system id.

        Raises:
            OSError: the file cannot be written; the handlers stay as they were.
        """
        file = self._file(path, system) if path else None
        self.close()
        console_handler = _Console(self._say)
        console_handler.addFilter(_Named(console))
        console_handler.setFormatter(_Formatter("%(component)s: %(message)s"))
        self._handlers = [console_handler]
        if file is not None:
            self._handlers.append(self._to_file(file))
        for root in ROOTS:
            logger = logging.getLogger(root)
            logger.setLevel(logging.INFO)
            logger.propagate = False
            for handler in self._handlers:
                logger.addHandler(handler)
        for component, names in COMPONENTS.items():
            for name in names:
                logging.getLogger(name).setLevel(logging.DEBUG if component in debug else logging.INFO)

    def _file(self, path: str, system: int) -> RotatingFile:
        return RotatingFile(log_file(path, system), FILE_BYTES, FILES_KEPT, lambda text: self._say(f"API: {text}"))

    def _to_file(self, writer: logging.Handler) -> logging.Handler:
        """A handler that only queues; a thread of its own writes, so that a slow disk delays no other thread."""
        writer.setFormatter(logging.Formatter(FORMAT))
        records: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
        handler = logging.handlers.QueueHandler(records)
        handler.setFormatter(_Formatter())
        handler.addFilter(_Named())
        self._listener = logging.handlers.QueueListener(records, writer)
        self._listener.start()
        return handler

    def close(self) -> None:
        """Write what is queued, and remove the handlers."""
        for root in ROOTS:
            logger = logging.getLogger(root)
            for handler in self._handlers:
                logger.removeHandler(handler)
            logger.propagate = True
        if self._listener is not None:
            self._listener.stop()
            for writer in self._listener.handlers:
                writer.close()
            self._listener = None
        self._handlers = []


def log_file(path: str, system: int) -> Path:
    """The log file for `path`: the path itself, or `uav_<system>.log` in it if it is a folder."""
    location = Path(path).expanduser()
    if location.is_dir() or not (location.suffix or location.exists()):
        location.mkdir(parents=True, exist_ok=True)
        return location / f"uav_{system}.log"
    location.parent.mkdir(parents=True, exist_ok=True)
    return location


def print_above_prompt(text: str, prompt: str) -> None:
    """Print a line and restore the prompt with what is being typed. Main loop only.

    MAVProxy's own prints leave the cursor behind the text; in a terminal a line of ours does not.
    """
    text = "\n".join(map(line_of, text.split("\n")))  # a traceback has several lines
    if readline is None or not sys.stdout.isatty():
        print(text)
        return
    sys.stdout.write(f"\r\x1b[K{text}\n{prompt}{readline.get_line_buffer()}")
    sys.stdout.flush()
