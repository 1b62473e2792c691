"""Worlds for tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.support.make_world import MakeWorld
from tests.support.virtual_time import FastLoop
from tests.support.world import World


@pytest.fixture
def make_world(
    loop: FastLoop, mpstate: SimpleNamespace, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Iterator[MakeWorld]:
    """See `MakeWorld`."""
    make = MakeWorld(loop, mpstate, lambda: capsys.readouterr().out, tmp_path)
    yield make
    make.close()


@pytest.fixture
def world(make_world: MakeWorld) -> World:
    """A copter that hovers in GUIDED."""
    return make_world()


@pytest.fixture
def on_ground(make_world: MakeWorld) -> World:
    """Armed in GUIDED."""
    return make_world(World.armed)
