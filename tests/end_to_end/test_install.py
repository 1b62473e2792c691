"""Installing and uninstalling leave MAVProxy healthy."""

from __future__ import annotations

import re
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Iterable
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.support.ports import free_port

ROOT = Path(__file__).parents[2]
OURS = re.compile(r"mavproxy_uavapi|\.pth$")
LIST = (
    "import importlib.util as u; print([n for n in ('uavapi','vision','gradys','mavproxy_uavapi')"
    " if u.find_spec(n)], bool(u.find_spec('MAVProxy.modules.mavproxy_link')))"
)


@pytest.fixture
def python(tmp_path: Path) -> Path:
    """A Python of its own that sees the packages of this one, but not our project's installation in it."""
    site = Path(sysconfig.get_path("purelib"))
    return python_with(tmp_path, [path for path in site.iterdir() if not OURS.search(path.name)])


@pytest.fixture
def lean_python(tmp_path: Path) -> Path:
    """A Python with our project and what requirements/lean.txt lists, and nothing else."""
    lines = (ROOT / "requirements" / "lean.txt").read_text(encoding="utf-8").splitlines()
    pinned = [Requirement(line.rstrip(" \\")) for line in lines if line[:1].isalnum()]
    packages = {
        Path(str(package.locate_file(file.parts[0])))
        for package in (distribution(line.name) for line in pinned if line.marker is None or line.marker.evaluate())
        for file in package.files or []
        if file.parts[0] != ".."  # a script
    }
    return python_with(tmp_path, packages, ROOT)


def python_with(directory: Path, packages: Iterable[Path], *folders: Path) -> Path:
    """A Python that finds those files of site-packages, and what is in those folders."""
    venv.create(directory / "venv", with_pip=False)
    python = directory / "venv" / "bin" / "python"
    site = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    visible = directory / "visible"
    visible.mkdir()
    for package in packages:
        (visible / package.name).symlink_to(package)
    Path(site, "visible.pth").write_text("".join(f"{path}\n" for path in (visible, *folders)), encoding="utf-8")
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


@pytest.mark.long
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
    rig = harness.Rig(directory, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=2)
        command = harness.mavproxy_command(instance)
        rig.mavproxy = rig.start("mavproxy", [str(python), *command[1:]])
        rig.mavproxy.says("Detected vehicle")
        return answer in rig.mavproxy.ask(f'module load uavapi:{{"port":{rig.port}}}', answer)
    finally:
        rig.stop()


def test_mavproxy_and_all_three_modules_start_with_the_lean_set_alone(lean_python, harness, tmp_path):
    seen = "import importlib.util as u; print([n for n in ('pytest','vtk','matplotlib') if u.find_spec(n)])"
    assert subprocess.run([lean_python, "-c", seen], check=True, capture_output=True, text=True).stdout == "[]\n"
    subprocess.run([lean_python, "-c", "import requests, mavproxy_uavapi.client"], check=True)  # as scripts do
    rig = harness.Rig(tmp_path, free_port())
    try:
        instance = harness.start_embedded(rig, speedup=2)
        loads = [harness.load(rig.port), '--cmd=module load vision:{"source":"sim"}', "--cmd=module load gradys"]
        rig.mavproxy = rig.start(
            "mavproxy", [str(lean_python), *harness.mavproxy_command(instance, *loads, logs=True)[1:]]
        )
        rig.wait_until_up()
        assert rig.get("/docs").status_code == 200
        harness.eventually(lambda: rig.ok(rig.get("/vision/status"))["info"]["camera"] == "ok", what="a picture")
        printed = rig.mavproxy.ask("module list", "wp:")
        assert all(f"{name}: " in printed for name in ("uavapi", "vision", "gradys", "adsb", "terrain"))
        assert "Failed to load" not in rig.mavproxy.output() and "lie in one folder" not in rig.mavproxy.output()
    finally:
        rig.stop()


def test_the_console_script_is_installed():
    script = Path(sysconfig.get_path("scripts"), "mavproxy-uavapi")
    done = subprocess.run([sys.executable, script, "--help"], check=True, capture_output=True, text=True)
    assert "--simulated" in done.stdout
