from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from tests.support.virtual_time import FastLoop
from tests.support.world import World

NOON = 1_778_500_800.0  # s since 1970


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "flights"


@pytest.fixture
def world(
    loop: FastLoop,
    mpstate: SimpleNamespace,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[World]:
    """A copter that is ready to arm, and an API that records its flights."""
    monkeypatch.setattr(time, "time", lambda: NOON + loop.time())
    world = World({"flights": str(folder)}, loop=loop, mpstate=mpstate)
    world.screen = lambda: capsys.readouterr().out
    world.boot()
    world.go_live()
    loop.set_default_executor(AtOnce())
    world.recording = loop.create_task(world.service.flights.run())
    yield world
    world.recording.cancel()
    loop.run(asyncio.wait({world.recording}))
    world.close()
