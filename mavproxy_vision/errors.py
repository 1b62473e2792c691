"""The errors of vision and landing, as children of the project's error tree.

UavApiError
|- Aborted (409 aborted)
|  `- LandingFailed     not landed on the tag; `report` says what was tried and what was done instead
|- BadRequest (400 bad_request)
|  `- BadImage          the posted data is not an image
`- Unavailable (503)
   `- NoCamera          503 no_camera: no source is set, or it gives no frames
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mavproxy_uavapi.core.errors import Aborted, BadRequest, Unavailable


class LandingFailed(Aborted):
    """Not landed on the tag.

    Args:
        sentence: why.
        report: returns what was tried and what was done instead; it is complete once the flight is over.
    """

    def __init__(self, sentence: str, report: Callable[[], dict[str, Any]]) -> None:
        super().__init__(sentence)
        self._report = report

    @property
    def report(self) -> dict[str, Any]:
        """What was tried, and what was done instead."""
        return self._report()

    def extras(self) -> dict[str, Any]:
        """`info`: the report."""
        return {"info": self.report}


class BadImage(BadRequest):
    """The posted data is not an image that OpenCV can read."""


class NoCamera(Unavailable):
    """No source is set, or it gives no frames."""

    code = "no_camera"
