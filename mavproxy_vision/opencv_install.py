"""What is wrong with the installed OpenCV, in one line, with the command that mends it.

Four distributions put the same package `cv2` into the same folder, one over the other: whose files stay is chance,
and removing one of them takes the files of the others along. MAVProxy 1.8.75 asks for opencv-python, which needs
libGL; we ask for opencv-python-headless, which does not.
"""

from __future__ import annotations

import importlib
import shlex
import sys
from collections.abc import Sequence
from importlib.metadata import distributions

DISTRIBUTIONS = ("opencv-python", "opencv-contrib-python", "opencv-python-headless", "opencv-contrib-python-headless")
NEEDED = "opencv-python-headless>=4.10.0.84"  # what pyproject.toml asks for


def installed() -> list[str]:
    """The names of the OpenCV distributions in the first folder of sys.path that has any."""
    for folder in sys.path:
        names = [name for name in DISTRIBUTIONS if any(distributions(name=name, path=[folder]))]
        if names:
            return names
    return []


def problem() -> str | None:
    """Why OpenCV cannot be used and what mends it; None where it can be used."""
    fault = _fault()
    if fault is None:
        return None
    names = installed()
    beside = f"; {_in_one_folder(names)}" if len(names) > 1 else ""
    return f"vision needs OpenCV 4.10 or newer, but {fault}{beside}: {_mend(names)}"


def overlap() -> str | None:
    """That more than one OpenCV lies in one folder, though cv2 imports; None where there is one alone."""
    names = installed()
    if len(names) < 2:
        return None
    return f"{_in_one_folder(names)}, either may break the other: {_mend(names)}"


def _fault() -> str | None:
    try:
        cv2 = importlib.import_module("cv2")
    except (
        ImportError,
        AttributeError,
    ) as error:  # AttributeError: its Python files and its library are of two versions
        # cv2 leaves this mark when it fails, and would report a recursion at the next attempt.
        vars(sys).pop("OpenCV_LOADER", None)
        return f"cv2 does not import ({' '.join(str(error).split())})"
    if not hasattr(getattr(cv2, "aruco", None), "ArucoDetector"):
        return f"this is {getattr(cv2, '__version__', 'a cv2 without its library')}"
    return None


def _in_one_folder(names: Sequence[str]) -> str:
    return f"{' and '.join(names)} lie in one folder"


def _mend(names: Sequence[str]) -> str:
    """The command after which there is one OpenCV, whole, in MAVProxy's own Python."""
    pip = f"{shlex.quote(sys.executable)} -m pip"
    removal = f"{pip} uninstall -y {' '.join(names)} && " if names else ""
    return f"{removal}{pip} install '{NEEDED}'"
