"""The project of examples/tested as its user tests it: several workers, each with vehicles of its own."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

EXAMPLE = Path(__file__).parents[2] / "examples" / "tested"
BAD = """
import pytest

@pytest.mark.uav(location="CMAC", envelope="mast.geojson")
def test_bad(uav):
    uav.run("patrol.py")
"""
MAST = """{"type": "FeatureCollection", "features": [{"type": "Feature",
"properties": {"kind": "exclusion", "name": "mast", "radius": 6},
"geometry": {"type": "Point", "coordinates": [149.165230, -35.363141]}}]}"""


def test_example_project_passes_on_several_workers_and_a_mast_in_the_way_fails_it(tmp_path: Path) -> None:
    project = shutil.copytree(EXAMPLE, tmp_path / "project")
    (project / "test_bad.py").write_text(BAD)
    (project / "mast.geojson").write_text(MAST)
    command = [sys.executable, "-m", "pytest", "-p", "mavproxy_uavapi.testing", "-n", "3"]
    done = subprocess.run(command, cwd=project, check=False, capture_output=True, text=True)
    assert (done.returncode, "1 failed, 6 passed" in done.stdout) == (1, True), done.stdout + done.stderr
    assert "was refused" in done.stdout and "mast" in done.stdout
