"""Makes the wheels and source distributions in dist/: the modules, and what takes uav-api's place.

    make wheels

The same commit gives the same bytes: all files have its date, and no owner. Each wheel is built from its source
distribution, as an installer that finds no wheel does it.
"""

from __future__ import annotations

import argparse
import gzip
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECTS = (ROOT, ROOT / "packaging" / "uav-api-compat")
BUILD = "import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(sys.argv[2]))"


def build(source: Path, kind: str, to: Path, epoch: int) -> Path:
    """Build a `sdist` or a `wheel` of a project's folder; the file."""
    command = [sys.executable, "-c", BUILD, f"build_{kind}", str(to)]
    environment = {**os.environ, "SOURCE_DATE_EPOCH": str(epoch)}
    done = subprocess.run(command, cwd=source, env=environment, check=True, capture_output=True, text=True)
    return to / done.stdout.splitlines()[-1]


def dated(archive: Path, epoch: int, to: Path) -> Path:
    """A source distribution whose files have that date and no owner; the new file."""
    made = to / archive.name
    with (
        tarfile.open(archive) as before,
        made.open("wb") as file,
        gzip.GzipFile("", "wb", fileobj=file, mtime=epoch) as packed,
        tarfile.open(mode="w", fileobj=packed, format=tarfile.PAX_FORMAT) as after,
    ):
        for member in sorted(before.getmembers(), key=lambda one: one.name):
            member.mtime, member.uid, member.gid, member.uname, member.gname = epoch, 0, 0, "", ""
            member.mode, member.pax_headers = 0o755 if member.mode & 0o100 else 0o644, {}
            after.addfile(member, before.extractfile(member) if member.isfile() else None)
    return made


def main() -> int:
    """Make them all; print their names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--to", type=Path, default=ROOT / "dist")
    to = parser.parse_args().to.absolute()
    to.mkdir(parents=True, exist_ok=True)
    os.umask(0o022)
    date = subprocess.run(["git", "log", "-1", "--format=%ct"], cwd=ROOT, check=True, capture_output=True, text=True)
    epoch = int(date.stdout)
    for project in PROJECTS:
        with tempfile.TemporaryDirectory() as directory:
            work = Path(directory)
            source = shutil.copytree(project, work / "source", ignore=left_out(project))
            shutil.copy(ROOT / "LICENSE", source)
            archive = dated(build(source, "sdist", work, epoch), epoch, to)
            with tarfile.open(archive) as packed:
                packed.extractall(work / "unpacked", filter="data")
            (folder,) = (work / "unpacked").iterdir()
            print(archive.name, build(folder, "wheel", to, epoch).name, sep="\n")
    return 0


def left_out(project: Path):  # noqa: ANN201  what shutil wants
    """What is not copied of a folder: what git does not know."""
    listed = ["git", "ls-files", "-z", "--cached", "."]
    names = subprocess.run(listed, cwd=project, check=True, capture_output=True, text=True).stdout.split("\0")
    files = {project / name for name in names if name}
    known = files | {folder for file in files for folder in file.parents}
    return lambda folder, names: {name for name in names if Path(folder, name) not in known}


if __name__ == "__main__":
    sys.exit(main())
