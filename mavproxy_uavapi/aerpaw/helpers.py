"""`aerpawlib.v1.helpers`: waits and checks."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable

from mavproxy_uavapi.aerpaw.constants import (
    MAX_POSITION_TOLERANCE_M,
    MIN_POSITION_TOLERANCE_M,
    POLLING_DELAY_S,
)
from mavproxy_uavapi.aerpaw.exceptions import InvalidToleranceError


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
