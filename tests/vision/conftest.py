"""What the tests of `vision` share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("cv2")

from tests.support.vision_world import VisionWorld

STEP = 0.04  # s: as often as telemetry comes; flights differ by centimetres from those of the benchmarks


@pytest.fixture
def make_world() -> Iterator[Callable[..., VisionWorld]]:
    """Makes closed loops; see `tests/support/vision_world.py`."""
    made: list[VisionWorld] = []

    def make(**settings: Any) -> VisionWorld:
        made.append(VisionWorld(step=STEP, **settings))
        return made[-1]

    yield make
    for world in made:
        world.close()
