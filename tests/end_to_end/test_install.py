"""Installing and uninstalling leave MAVProxy healthy."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LIST = (
    "import importlib.util as u; print([n for n in ('uavapi','vision','gradys','mavproxy_uavapi')"
    " if u.find_spec(n)], bool(u.find_spec('MAVProxy.modules.mavproxy_link')))"
)


@pytest.fixture
def python(tmp_path: Path) -> Path:
    """A Python of its own that sees the packages of this one, but not our project's installation in it."""
    venv.create(tmp_path / "venv", with_pip=False)
    python = tmp_path / "venv" / "bin" / "python"
    site = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    visible = tmp_path / "visible"
    visible.mkdir()
    for entry in Path(sysconfig.get_path("purelib")).iterdir():
        if "mavproxy_uavapi" not in entry.name and entry.suffix != ".pth":
            (visible / entry.name).symlink_to(entry)
    Path(site, "visible.pth").write_text(f"{visible}\n", encoding="utf-8")
    return python


def pip(python: Path, *arguments: str) -> None:
    done = subprocess.run(
        [python, "-m", "pip", "--disable-pip-version-check", *arguments],
        check=False,
        capture_output=True,
        text=True,
        cwd=python.parent,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def importable(python: Path) -> str:
    return subprocess.run(
        [python, "-c", LIST], check=True, capture_output=True, text=True, cwd=python.parent
    ).stdout.strip()


@pytest.mark.parametrize("editable", [False, True], ids=["install", "editable"])
def test_install_and_uninstall_leave_mavproxy_healthy(python, harness, tmp_path, editable):
    assert importable(python) == "[] True"
    pip(python, "install", "--no-deps", "--no-build-isolation", *(["-e"] if editable else []), str(ROOT))
    assert importable(python) == "['uavapi', 'vision', 'gradys', 'mavproxy_uavapi'] True"
    assert loads(python, harness, tmp_path / "with", "Loaded module uavapi")
    pip(python, "uninstall", "--yes", "mavproxy-uavapi")
    assert importable(python) == "[] True"
    assert loads(python, harness, tmp_path / "without", "Failed to load module")
    assert not list(Path(sysconfig.get_path("purelib"), "MAVProxy").rglob("*uavapi*"))


def loads(python: Path, harness, directory: Path, answer: str) -> bool:
    """Whether a MAVProxy of that Python starts, and answers `module load uavapi` so."""
    directory.mkdir()
    rig = harness.Rig(directory, harness.free_port())
    try:
        instance = harness.start_embedded(rig)
        command = harness.mavproxy_command(instance)
        rig.mavproxy = rig.start("mavproxy", [str(python), *command[1:]])
        rig.mavproxy.says("Detected vehicle")
        return answer in rig.mavproxy.ask(f'module load uavapi:{{"port":{rig.port}}}', answer)
    finally:
        rig.stop()


def test_the_console_script_is_installed():
    script = Path(sysconfig.get_path("scripts"), "mavproxy-uavapi")
    done = subprocess.run([sys.executable, script, "--help"], check=True, capture_output=True, text=True)
    assert "--simulated" in done.stdout
