"""Does what .github/workflows/release.yml says, job by job: each `run:` step, in a clone of the checkout.

    python packaging/rehearse_release.py [ARGS of `make test`]

Checkouts, Pythons and artifacts are clones, virtual environments and folders here. Attesting and publishing are left
out, and said; `gh` is a program that shows its arguments. Of the tests those run that are named (test_packaging.py).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[1]
FEW_TESTS = "tests/rules/test_packaging.py"
PYTHON = "steps.python.outputs.python-path"


class Rehearsal:
    """A machine of GitHub's, as far as it goes here."""

    def __init__(self, folder: Path, tests: str) -> None:
        self._folder = folder
        programs = folder / "programs"
        programs.mkdir()
        (programs / "gh").write_text('#!/bin/sh\necho "gh $*"\nls -l "$@" 2> /dev/null || true\n', encoding="utf-8")
        (programs / "gh").chmod(0o755)
        subprocess.run([sys.executable, "-m", "venv", folder / "python"], check=True)
        version = {}
        exec((ROOT / "mavproxy_uavapi" / "__init__.py").read_text(encoding="utf-8"), version)
        self._env = os.environ | {
            "PATH": os.pathsep.join([str(programs), str(folder / "python" / "bin"), os.environ["PATH"]]),
            "GITHUB_REF_NAME": f"v{version['__version__']}",
            "GITHUB_REPOSITORY": "owner/name",
            "ARGS": tests,
            "CI": "",  # what needs a program that is missing is skipped
        }

    def job(self, name: str, steps: list[dict[str, Any]]) -> None:
        """Do the steps of a job, in a folder of its own."""
        work = self._folder / name
        work.mkdir()
        for step in steps:
            uses, given = step.get("uses", "").partition("@")[0], step.get("with", {})
            print(f"== {name}: {step.get('name') or uses or step['run']}", flush=True)
            if uses == "actions/checkout":
                subprocess.run(["git", "clone", "--quiet", ROOT, work], check=True)
            elif uses == "actions/upload-artifact":
                shutil.copytree(work / given["path"], self._folder / "artifacts" / given["name"])
            elif uses == "actions/download-artifact":
                shutil.copytree(self._folder / "artifacts" / given["name"], work / given["path"])
            elif "run" in step:
                own = {key: self._value(str(value)) for key, value in step.get("env", {}).items()}
                env = {**self._env, **own, "GITHUB_WORKSPACE": str(work)}
                subprocess.run(["bash", "-e", "-o", "pipefail", "-c", step["run"]], cwd=work, env=env, check=True)
            elif uses != "actions/setup-python":
                print(f"   not here: {uses}")

    def _value(self, text: str) -> str:
        return str(self._folder / "python" / "bin" / "python") if PYTHON in text else text


def main() -> int:
    """Do all jobs, in their order; the status of the first step that fails."""
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder:
        rehearsal = Rehearsal(Path(folder), " ".join(sys.argv[1:]) or FEW_TESTS)
        for name, job in workflow["jobs"].items():
            try:
                rehearsal.job(name, job["steps"])
            except subprocess.CalledProcessError as error:
                return int(error.returncode)
    return 0


if __name__ == "__main__":
    sys.exit(main())
