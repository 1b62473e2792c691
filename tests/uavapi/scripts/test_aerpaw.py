"""Which scripts are aerpawlib's."""

from __future__ import annotations

import pytest

from mavproxy_uavapi.scripts.aerpaw import needs_host

RUNS_ITSELF = b"from aerpawlib.v1.util import Coordinate\nif __name__ == '__main__':\n    print(Coordinate(1, 2))\n"


@pytest.mark.parametrize(
    ("source", "needs"),
    [
        (b"from aerpawlib.v1.runner import BasicRunner\n", True),
        (b"import aerpawlib.vehicle as v\n", True),
        (b"'about'\nimport os, aerpawlib\n", True),
        (RUNS_ITSELF, False),
        (b"from aerpawlibrary import Drone\n", False),
        (b"# from aerpawlib.v1 import Drone\nimport requests\n", False),
        (b"from .aerpawlib import Drone\n", False),
        (b"from aerpawlib import (\n", False),
        (b"\x00\xff", False),
        (b"", False),
    ],
)
def test_script_that_only_defines_a_runner_needs_a_host(source: bytes, needs: bool) -> None:
    assert needs_host(source) is needs
