"""`aerpawlib.structured_log`: the log of `--structured-log`, one line of JSON per event."""

from __future__ import annotations

import json
import time
from typing import Any, TextIO


class StructuredEventLogger:
    """Writes events with their time (s since 1970) to an open file, at once."""

    def __init__(self, output: TextIO) -> None:
        self._output = output

    def log_event(self, event_type: str, **members: Any) -> None:
        """Write an event."""
        self._output.write(json.dumps({"timestamp": time.time(), "event": event_type, **members}) + "\n")
        self._output.flush()

    def close(self) -> None:
        """Close the file."""
        self._output.close()
