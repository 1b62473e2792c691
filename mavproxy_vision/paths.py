"""Paths as people write them."""

from __future__ import annotations

from pathlib import Path

from mavproxy_vision.errors import BadSetting


def path_of(text: str, setting: str) -> Path:
    """The path, with `~` and `~somebody` expanded.

    Raises:
        BadSetting: nobody has that name, or no file can.
    """
    if "\0" in text:
        raise BadSetting(f"{setting}: no path can hold a zero byte", setting)
    try:
        return Path(text).expanduser()
    except RuntimeError as error:  # pathlib's word for it
        raise BadSetting(f"{setting}: {text!r}: nobody here has that name, or has a home", setting) from error
