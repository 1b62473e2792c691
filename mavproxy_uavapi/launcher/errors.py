"""The launcher's errors; their text is the one line that the user reads."""

from __future__ import annotations


class LaunchError(Exception):
    """Something did not start, or ended on its own."""

    status = 1


class OptionError(LaunchError):
    """An option on the command line or in the INI file is wrong; nothing was started."""

    status = 2
