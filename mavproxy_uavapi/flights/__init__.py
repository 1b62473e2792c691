"""The records of flights: a file each, with all that was seen and commanded, to take home."""

from __future__ import annotations

from pathlib import Path

from mavproxy_uavapi.core.state_directory import state_directory


def default_folder() -> Path:
    """Where the flights are kept unless the setting `flights` says otherwise."""
    return state_directory() / "flights"
