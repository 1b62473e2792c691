"""CORS headers for pages of other sites that the owner trusts (setting `cors_origins`)."""

from __future__ import annotations

HEADERS = {
    "Access-Control-Allow-Methods": "GET, POST, PUT, DELETE",
    "Access-Control-Allow-Headers": "Authorization, Content-Type, Prefer",
    "Access-Control-Expose-Headers": "Location",
    "Vary": "Origin",
}


def cors_headers(origin: str) -> dict[str, str]:
    """Headers of an answer that tell the browser that a page of this origin, which is trusted, may read it."""
    return {"Access-Control-Allow-Origin": origin, **HEADERS}
