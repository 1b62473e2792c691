"""Planes on the ground and in the air. The figures of their tests are those of ArduPilot's SITL."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from mavproxy_uavapi.sim import Options
from tests.support.simulated import ACCEPTED
from tests.support.simulated_plane import GUIDED, TAKEOFF
from tests.uavapi.sim.conftest import Ground


@pytest.fixture
def on_runway(new_ground: type[Ground]) -> Callable[..., Any]:
    """Puts a plane on the ground, ready to arm: `on_runway(wind=Wind(8.0, 0.0))`."""

    def put(**options: Any) -> Any:
        ground = new_ground(Options(vehicle="plane", **options))
        ground.run(6.0)
        ground.heard.clear()
        return ground

    return put


@pytest.fixture
def plane(on_runway: Callable[..., Any]) -> Any:
    """A plane on the ground, ready to arm."""
    return on_runway()


@pytest.fixture
def flying(plane: Any) -> Any:
    """A plane that circles in GUIDED at 50 m, 200 m ahead of where it stood."""
    assert plane.mode(TAKEOFF) == ACCEPTED
    assert plane.arm() == ACCEPTED
    plane.run(40.0)
    assert plane.mode(GUIDED) == ACCEPTED
    plane.run(1.0)
    plane.heard.clear()
    return plane
