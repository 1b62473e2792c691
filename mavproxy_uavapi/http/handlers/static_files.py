"""Answers with files that a browser shows: their headers, and 304 for what it has already."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from aiohttp import web

# No page of ours sends forms, is framed, or loads from another server; each adds what it needs.
CLOSED = "default-src 'none'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"


def headers(policy: str) -> dict[str, str]:
    """The headers of a page and its files; `policy` is what its Content-Security-Policy adds to CLOSED."""
    return {
        "Content-Security-Policy": f"{CLOSED}; {policy}",
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "same-origin",  # its own calls must say which page they come from (`security.check_page`)
        "Cache-Control": "no-cache",  # asked again each time
    }


def answer(request: web.BaseRequest, body: bytes, kind: str, head: Mapping[str, str]) -> web.Response:
    """The file, or 304 if the browser has it already; `kind` is its content type."""
    said = body + head.get("Content-Security-Policy", "").encode()  # a page that may do something else is another one
    tagged = {**head, "ETag": f'"{hashlib.sha256(said).hexdigest()[:32]}"'}
    if request.headers.get("If-None-Match") == tagged["ETag"]:
        return web.Response(status=304, headers=tagged)
    charset = None if kind.startswith("image/") and kind != "image/svg+xml" else "utf-8"
    return web.Response(body=body, content_type=kind, charset=charset, headers=tagged)
