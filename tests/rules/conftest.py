"""Worlds for tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.support.world import World


@pytest.fixture
def make_world(
    loop: Any, mpstate: Any, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Iterator[Callable[..., World]]:
    """Makes a world of which nobody knows yet; `stage` brings its vehicle to where a test begins.

    With settings for a `camera` it has vision, or the test is skipped where there is no OpenCV.
    """
    worlds: list[World] = []
    loop.set_default_executor(AtOnce())

    def make(
        stage: Callable[[World], None] = World.flying,
        camera: dict[str, Any] | None = None,
        vehicle: str = "copter",
        **settings: Any,
    ) -> World:
        if camera is not None:
            pytest.importorskip("cv2")
        world = World(loop, mpstate, settings, vehicle)
        worlds.append(world)
        world.screen, world.directory = lambda: capsys.readouterr().out, tmp_path
        if camera is not None:
            world.mount_camera(camera)
        stage(world)
        world.go_live()
        return world

    make.worlds = worlds
    yield make
    for world in worlds:
        world.close()
        world.host.bridge._calls.close()


@pytest.fixture
def world(make_world: Any) -> Any:
    """A copter that hovers in GUIDED."""
    return make_world()


@pytest.fixture
def on_ground(make_world: Any) -> Any:
    """Armed in GUIDED."""
    return make_world(lambda world: world.armed())
