"""The folder for state that outlives a program, by the XDG base directory specification."""

from __future__ import annotations

import os
from pathlib import Path


def state_directory() -> Path:
    """`$XDG_STATE_HOME/mavproxy-uavapi`, by default under `~/.local/state`; a relative path is ignored."""
    named = os.environ.get("XDG_STATE_HOME", "")
    base = Path(named) if os.path.isabs(named) else Path.home() / ".local" / "state"
    return base / "mavproxy-uavapi"
