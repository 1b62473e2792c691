"""The log of `--structured-log`: one line of JSON per event."""

from __future__ import annotations

import json
import time
from pathlib import Path
from types import TracebackType
from typing import Any


class EventLog:
    """Writes events with their time (s since 1970) to a file at once; an existing file is overwritten."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", encoding="utf-8")

    def log_event(self, event: str, **members: Any) -> None:
        """Write an event."""
        self._file.write(json.dumps({"timestamp": time.time(), "event": event, **members}) + "\n")
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> EventLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()
