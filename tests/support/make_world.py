"""Makes worlds for a test, and ends them with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.support.virtual_time import FastLoop
from tests.support.world import World


class MakeWorld:
    """See `__call__`.

    Attributes:
        worlds: those that were made.
    """

    def __init__(self, loop: FastLoop, mpstate: SimpleNamespace, screen: Callable[[], str], directory: Path) -> None:
        self.worlds: list[World] = []
        self._loop, self._mpstate, self._screen, self._directory = loop, mpstate, screen, directory
        loop.set_default_executor(AtOnce())

    def __call__(
        self,
        stage: Callable[[World], object] = World.flying,
        camera: Mapping[str, Any] | None = None,
        vehicle: str = "copter",
        **settings: Any,
    ) -> World:
        """A world; nobody knows of it while `stage` brings its vehicle to where a test begins.

        With settings for a `camera` it has vision, or the test is skipped where there is no OpenCV.
        """
        if camera is not None:
            pytest.importorskip("cv2")
        world = World(settings, vehicle, self._loop, self._mpstate)
        self.worlds.append(world)
        world.screen, world.directory = self._screen, self._directory
        if camera is not None:
            world.mount_camera(camera)
        stage(world)
        if camera is not None:
            world.listen()
            world.open_eye()
        world.go_live()
        return world

    def close(self) -> None:
        """End them."""
        for world in self.worlds:
            world.close()
