"""`packaging/uav-api-compat` in the place of uav-api: what gradysim calls, and gradysim itself."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.ports import free_port

ROOT = Path(__file__).parents[2]
COMPAT = ROOT / "packaging" / "uav-api-compat"
SPAWNS = """
import sys, time, requests
from uav_api.run_api import spawn_with_args
process = spawn_with_args(["--simulated", "--headless", "--port", sys.argv[1], "--sysid", "77", "--speedup", "5"])
while True:
    try:
        answer = requests.get(f"http://localhost:{sys.argv[1]}/telemetry/general", timeout=60)
    except requests.ConnectionError:
        assert process.is_alive()
    else:
        if answer.status_code == 200:
            break
    time.sleep(0.2)
print(answer.json()["id"], answer.json()["result"])
process.terminate()
process.join(60)
print(process.exitcode)
"""
pytestmark = pytest.mark.long


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A Python that finds the distribution, in its own home."""
    path = os.pathsep.join([str(COMPAT), str(ROOT), os.environ.get("PYTHONPATH", "")])
    environ = {**os.environ, "PYTHONPATH": path, "HOME": str(folder), "XDG_STATE_HOME": str(folder)}
    command = [sys.executable, *words]
    return subprocess.run(command, cwd=folder, env=environ, capture_output=True, text=True, timeout=600, check=False)


def test_spawned_api_answers_and_ends_with_its_process(tmp_path: Path) -> None:
    outcome = run(tmp_path, "-c", SPAWNS, str(free_port()))
    assert outcome.stdout.split()[-3:] == ["77", "success", "0"], outcome.stdout + outcome.stderr


def test_wrong_option_is_the_status_of_the_process(tmp_path: Path) -> None:
    outcome = run(tmp_path, "-m", "uav_api.run_api", "--prot", "1")
    assert outcome.returncode == 2
    assert "--prot" in outcome.stderr


@pytest.mark.skipif(importlib.util.find_spec("gradysim") is None, reason="gradysim is not installed (pip install)")
def test_three_drones_of_gradysim_fly_arrive_and_talk(tmp_path: Path) -> None:
    first = free_port()
    outcome = run(tmp_path, str(ROOT / "tests" / "support" / "gradysim_scenario.py"), str(first))
    for number in range(3):
        others = sorted({0, 1, 2} - {number})
        assert f"drone {number} arrived=True heard={others}" in outcome.stdout, outcome.stdout + outcome.stderr
    assert "All 3 drones shut down cleanly" in outcome.stderr
