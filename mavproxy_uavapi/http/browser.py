"""What tells a browser from a program. Pure."""

from __future__ import annotations

from collections.abc import Mapping

# What a browser accepts for a page, picture, style, script or film; programs ask for JSON or for anything.
BROWSERS_WANT = ("text/html", "application/xhtml", "image/", "text/css", "javascript", "video/", "audio/")


def is_browser(headers: Mapping[str, str]) -> bool:
    """Whether a browser sent this, by its name or by the types that it accepts."""
    name = headers.get("User-Agent", "")
    accepted = headers.get("Accept", "").lower()
    return (name.startswith("Mozilla/") and "PowerShell" not in name) or any(
        kind in accepted for kind in BROWSERS_WANT
    )
