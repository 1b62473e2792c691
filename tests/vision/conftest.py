"""What the tests of `vision` share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("cv2")


@pytest.fixture
def lockstep(helper: Callable[[str], Any]) -> Iterator[Callable[..., Any]]:
    """Makes closed loops; see `lockstep.py`."""
    made: list[Any] = []

    def make(**settings: Any) -> Any:
        made.append(helper("vision/lockstep.py").Lockstep(**settings))
        return made[-1]

    yield make
    for rig in made:
        rig.close()
