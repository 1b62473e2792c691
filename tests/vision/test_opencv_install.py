"""What `module load vision` says of an OpenCV that is missing, broken, old, or there twice."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import vision
from mavproxy_vision import opencv_install

LIBRARY_MISSING = "raise ImportError('libGL.so.1: cannot open shared object file')\n"
INSTALL = f"{shlex.quote(sys.executable)} -m pip install 'opencv-python-headless>=4.10.0.84'"
NEEDS = "vision needs OpenCV 4.10 or newer, but "
LOAD = "import mavproxy_vision.module"


def remove(*distributions: str) -> str:
    """The first half of the command that mends."""
    return f"{shlex.quote(sys.executable)} -m pip uninstall -y {' '.join(distributions)} && "


def folder_with(folder: Path, cv2: str | None, *distributions: str) -> Path:
    """A folder of sys.path with that `cv2/__init__.py`, which those distributions say they installed."""
    folder.mkdir()
    if cv2 is not None:
        (folder / "cv2").mkdir()
        (folder / "cv2" / "__init__.py").write_text(cv2, encoding="utf-8")
    for name in distributions:
        info = folder / f"{name.replace('-', '_')}-5.0.0.93.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 5.0.0.93\n", encoding="utf-8")
    return folder


def import_error(folder: Path, code: str = LOAD) -> str:
    """The text of the ImportError that a Python gives which finds its cv2 in `folder`; it printed nothing else."""
    done = subprocess.run(
        [sys.executable, "-c", f"try:\n    {code}\nexcept ImportError as error:\n    print(error)"],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{Path(__file__).parents[2]}"},
        timeout=60,
    )
    assert done.stderr == ""
    return done.stdout.removesuffix("\n")


def test_the_installed_opencv_has_no_problem() -> None:
    assert opencv_install.problem() is None


def test_without_opencv_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)  # as if there were none
    monkeypatch.setattr(sys, "path", [])
    output = opencv_install.problem()
    assert output is not None
    assert output.startswith(f"{NEEDS}cv2 does not import (") and "\n" not in output
    assert output.endswith(f"): {INSTALL}")


@pytest.mark.parametrize(
    ("cv2", "fault"),
    [
        (LIBRARY_MISSING, "cv2 does not import (libGL.so.1: cannot open shared object file)"),
        ("import cv2.dnn\ncv2.dnn.DictValue\n", "cv2 does not import ({})"),
        ("raise ImportError('two\\nlines')\n", "cv2 does not import (two lines)"),
        ("", "this is a cv2 without its library"),
        ("__version__ = '4.6.0'\n", "this is 4.6.0"),
    ],
    ids=["no libGL", "files of two versions", "an error of two lines", "left by an uninstall", "old"],
)
def test_an_opencv_that_does_not_serve_is_one_line_with_what_mends_it(tmp_path: Path, cv2: str, fault: str) -> None:
    two = folder_with(tmp_path / "two", cv2, "opencv-python", "opencv-python-headless")
    (two / "cv2" / "dnn.py").touch()
    fault = fault.format("module 'cv2.dnn' has no attribute 'DictValue'")
    beside = "opencv-python and opencv-python-headless lie in one folder"
    assert (
        import_error(two) == f"{NEEDS}{fault}; {beside}: {remove('opencv-python', 'opencv-python-headless')}{INSTALL}"
    )
    one = folder_with(tmp_path / "one", cv2, "opencv-python")
    (one / "cv2" / "dnn.py").touch()
    assert import_error(one) == f"{NEEDS}{fault}: {remove('opencv-python')}{INSTALL}"


def test_a_second_attempt_reports_the_same_as_the_first(tmp_path: Path) -> None:
    """OpenCV's loader marks `sys` while it runs, leaves the mark when it fails, and refuses to run twice."""
    loader = f"""\
import sys
if hasattr(sys, "OpenCV_LOADER"):
    raise ImportError("recursion is detected")
sys.OpenCV_LOADER = True
{LIBRARY_MISSING}"""
    folder = folder_with(tmp_path / "site", loader, "opencv-python")
    code = f"try:\n        {LOAD}\n    except ImportError:\n        {LOAD}"
    assert import_error(folder, code) == import_error(folder)
    assert "libGL" in import_error(folder, code)


def test_two_in_one_folder_are_a_line_where_cv2_imports(
    tmp_path: Path, mpstate: SimpleNamespace, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folder_with(tmp_path / "site", None, "opencv-python", "opencv-python-headless")
    monkeypatch.syspath_prepend(folder)
    vision.init(mpstate).unload()
    assert capsys.readouterr().out == (
        "vision: opencv-python and opencv-python-headless lie in one folder, either may break the other: "
        f"{remove('opencv-python', 'opencv-python-headless')}{INSTALL}\n"
    )


def test_one_in_each_of_two_folders_is_not_reported(
    tmp_path: Path, mpstate: SimpleNamespace, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second one is the system's, say, which a virtual environment with --system-site-packages sees, too."""
    monkeypatch.syspath_prepend(folder_with(tmp_path / "system", None, "opencv-python"))
    monkeypatch.syspath_prepend(folder_with(tmp_path / "own", None, "opencv-python-headless"))
    vision.init(mpstate).unload()
    assert capsys.readouterr().out == ""


def test_what_is_to_be_installed_is_what_the_project_asks_for(asked_for: dict[str, list[Any]]) -> None:
    assert opencv_install.NEEDED in map(str, asked_for["vision"])
