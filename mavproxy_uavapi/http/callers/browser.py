"""What tells a browser from a program. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping

# Every browser says on which platform it runs; Qt and QGIS call themselves Mozilla without it.
BROWSERS_NAME = re.compile(r"Mozilla/[0-9.]+ \(")
PROGRAMS_NAMES = ("PowerShell/", "WinHttp.WinHttpRequest")  # which have the rest of a browser's name
# What a browser accepts for a page, picture, style, script or film; programs ask for JSON or for anything.
BROWSERS_WANT = ("text/html", "application/xhtml", "image/", "text/css", "javascript", "video/", "audio/")
JAVA_WANTS = "text/html, image/gif, image/jpeg, *"  # by default, and so old versions of MATLAB do


def browsers_header(headers: Mapping[str, str]) -> str:
    """The header by which a browser sent this, as `Name: value`; empty if a program did."""
    name, accepted = headers.get("User-Agent", ""), headers.get("Accept", "")
    if BROWSERS_NAME.match(name) and not any(program in name for program in PROGRAMS_NAMES):
        return f"User-Agent: {name}"
    if any(kind in accepted.lower() for kind in BROWSERS_WANT) and not accepted.startswith(JAVA_WANTS):
        return f"Accept: {accepted}"
    return ""


def wants_page(accept: str) -> bool:
    """Whether an Accept header is that of a browser that opens a page; programs get at `/` what they always got."""
    return "text/html" in accept
