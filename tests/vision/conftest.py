"""What the tests of `vision` share."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cv2")


def _lockstep() -> Any:
    name = "vision_lockstep"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name("lockstep.py"))
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    return sys.modules[name]


@pytest.fixture
def lockstep() -> Iterator[Callable[..., Any]]:
    """Makes closed loops; see `lockstep.py`."""
    made: list[Any] = []

    def make(**settings: Any) -> Any:
        made.append(_lockstep().Lockstep(**settings))
        return made[-1]

    yield make
    for rig in made:
        rig.close()
