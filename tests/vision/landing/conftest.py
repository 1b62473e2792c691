"""What the tests of landings share."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.landing import SMALL, TAG

LOWEST_RETURN = 4.0  # m above home


@pytest.fixture
def flying(lockstep: Any) -> Any:
    """A vehicle some metres above home: `flying(alt=6, sim_tags=…)`."""

    def make(alt: float = 5.0, **settings: Any) -> Any:
        rig = lockstep(**{"sim_tags": TAG, **SMALL, **settings})
        rig.simulator.parameters.set("RTL_ALT_M", LOWEST_RETURN)  # a climb to 15 m shows nothing, and takes long
        rig.start(alt)
        return rig

    return make
