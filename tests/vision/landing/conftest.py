"""What the tests of landings share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.support.landing import SMALL, TAG
from tests.support.vision_world import VisionWorld

LOWEST_RETURN = 4.0  # m above home


@pytest.fixture
def flying(make_world: Callable[..., VisionWorld]) -> Callable[..., VisionWorld]:
    """A vehicle some metres above home: `flying(alt=6, sim_tags=…)`."""

    def make(alt: float = 5.0, **settings: Any) -> VisionWorld:
        world = make_world(**{"sim_tags": TAG, **SMALL, **settings})
        world.simulator.parameters.set("RTL_ALT_M", LOWEST_RETURN)  # a climb to 15 m shows nothing, and takes long
        world.start(alt)
        return world

    return make
