"""What the tests of `vision` share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("cv2")

from tests.support.lockstep import Lockstep

STEP = 0.04  # s: as often as telemetry comes; flights differ by centimetres from those of the benchmarks


@pytest.fixture
def lockstep() -> Iterator[Callable[..., Any]]:
    """Makes closed loops; see `tests/support/lockstep.py`."""
    made: list[Any] = []

    def make(**settings: Any) -> Any:
        made.append(Lockstep(step=STEP, **settings))
        return made[-1]

    yield make
    for rig in made:
        rig.close()
