"""A tmux server of the test's own, and runs in a folder of its own. All of it in real time: these are processes."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mavproxy_uavapi.scripts import runs


@pytest.fixture
def own_tmux(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """tmux with a server that nobody else uses."""
    monkeypatch.setenv("TMUX_TMPDIR", str(tmp_path_factory.mktemp("tmux")))
    monkeypatch.delenv("TMUX", raising=False)
    yield
    subprocess.run(["tmux", "kill-server"], check=False, capture_output=True)


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[..., runs.Run]:
    """`make_run(text)`: a run of a shell script with that text, not yet started."""

    def make(text: str = "exit 0", script: str = "a.sh", **changed: Any) -> runs.Run:
        path = tmp_path / script
        path.write_text(text, encoding="utf-8")
        defaults: dict[str, Any] = {
            "command": ["bash", str(path), *changed.pop("args", [])],
            "cwd": tmp_path,
            "port": 8000,
            "grace": 5.0,
            "environment": {"PATH": "/usr/bin:/bin", "GIVEN": "yes"},
        }
        return runs.create(tmp_path / "logs", script, [], changed.pop("sysid", 1), **{**defaults, **changed})

    return make
