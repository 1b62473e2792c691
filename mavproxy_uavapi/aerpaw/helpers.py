"""`aerpawlib.v1.helpers`: waits and checks."""

from __future__ import annotations

import asyncio
import math
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

from mavproxy_uavapi.aerpaw.constants import (
    MAX_POSITION_TOLERANCE_M,
    MIN_POSITION_TOLERANCE_M,
    POLLING_DELAY_S,
)
from mavproxy_uavapi.aerpaw.exceptions import InvalidToleranceError

T = TypeVar("T")


async def wait_for_condition(
    condition: Callable[[], bool],
    timeout: float | None = None,
    poll_interval: float = POLLING_DELAY_S,
    timeout_message: str = "Operation timed out",
) -> bool:
    """Wait until `condition` holds.

    Raises:
        TimeoutError: it did not hold within `timeout` s.
    """
    began = time.monotonic()
    while not condition():
        if timeout is not None and time.monotonic() - began > timeout:
            raise TimeoutError(timeout_message)
        await asyncio.sleep(poll_interval)
    return True


async def wait_for_value_change(
    getter: Callable[[], T],
    target_value: T,
    timeout: float | None = None,
    poll_interval: float = POLLING_DELAY_S,
    timeout_message: str = "Timeout waiting for value change",
) -> T:
    """Wait until `getter` returns `target_value`; returns it.

    Raises:
        TimeoutError: it did not within `timeout` s.
    """
    await wait_for_condition(lambda: getter() == target_value, timeout, poll_interval, timeout_message)
    return getter()


def validate_tolerance(tolerance: float, param_name: str = "tolerance") -> float:
    """Check a tolerance (m) and return it.

    Raises:
        ValueError: it is not finite, too small, or too large.
    """
    if not math.isfinite(tolerance):
        raise ValueError(f"{param_name} must be a finite number, got {tolerance}")
    if not MIN_POSITION_TOLERANCE_M <= tolerance <= MAX_POSITION_TOLERANCE_M:
        raise InvalidToleranceError(tolerance, MIN_POSITION_TOLERANCE_M, MAX_POSITION_TOLERANCE_M, param_name)
    return tolerance


def normalize_heading(heading: float) -> float:
    """The heading from 0 to less than 360 degrees."""
    return heading % 360


def heading_difference(heading1: float, heading2: float) -> float:
    """Degrees between two headings, the shorter way round."""
    return abs((heading1 - heading2 + 180) % 360 - 180)


class ThreadSafeValue:
    """A value that several threads read and write."""

    def __init__(self, initial_value: Any = None) -> None:
        self._value = initial_value
        self._lock = threading.Lock()

    def get(self) -> Any:
        """The value."""
        with self._lock:
            return self._value

    def set(self, value: Any) -> None:
        """Replace the value."""
        with self._lock:
            self._value = value

    def compare_and_set(self, expected: Any, new_value: Any) -> bool:
        """Replace the value if it equals `expected`; returns whether it did."""
        with self._lock:
            is_expected = bool(self._value == expected)
            if is_expected:
                self._value = new_value
            return is_expected
