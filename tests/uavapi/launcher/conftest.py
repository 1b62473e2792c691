"""What the tests of the launcher share."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def own_directories(tmp_path, monkeypatch):
    """Nothing of the user's is read or written."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("ARDUPILOT_LOCATIONS", str(tmp_path / "locations.txt"))
    monkeypatch.delenv("UAVAPI_TOKEN", raising=False)
