"""Requests in flight: what a test begins, and waits for later."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Protocol

import requests


class PendingCall(Protocol):
    """A request without an answer yet."""

    def is_answered(self) -> bool:
        """Whether the answer is there."""

    def answer(self, timeout: float) -> Any:
        """The answer, which must come within so many s of the rig's clock."""


class ThreadedCall:
    """A request in a thread of its own."""

    def __init__(self, request: Callable[[], requests.Response]) -> None:
        self._request = request
        self._answer: requests.Response | None = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        self._answer = self._request()

    def is_answered(self) -> bool:
        """Whether the answer is there."""
        return not self._thread.is_alive()

    def answer(self, timeout: float) -> requests.Response:
        """The answer, which must come within so many s."""
        self._thread.join(timeout)
        assert self._answer is not None, f"no answer within {timeout} s"
        return self._answer
