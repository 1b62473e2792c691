"""Makes one file of everything, for a machine without a network: MAVProxy, the modules, the launcher, the station.

    make bundle ARGS="--python 3.13 --machine aarch64"

The file is a PEX. It needs nothing but that Python. The first run unpacks it; it is a virtual environment
from then on. It holds the wheels of requirements/lean.txt, by their hashes, without what no field needs: MAVProxy's
globe, source maps, the editor of Swagger. With --ardupilot it holds what ArduPilot's tree documents of parameters,
with --manual the manual.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from packaging import tags

ROOT = Path(__file__).parents[1]
LOCK, WITHOUT = ROOT / "requirements" / "lean.txt", ROOT / "requirements" / "without.in"
ROOTS = ("mavproxy-uavapi[vision,mqtt]", "pillow")  # requirements/lean.in says why
LEFT_OUT = ("MAVProxy/modules/mavproxy_cesium/", "swagger_ui/static/swagger-editor")
# Debian 12, the oldest with Python 3.11, has glibc 2.36.
GLIBC = [*(f"manylinux_2_{minor}" for minor in range(28, 4, -1)), "manylinux2014", "manylinux2010", "manylinux1"]
DOCUMENTED = {"ArduCopter": "Copter.xml", "ArduPlane": "Plane.xml", "Rover": "Rover.xml"}  # ArduPilot's name: ours
UNDATED = (1980, 1, 1, 0, 0, 0)
PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]


def fetch(python: str, machine: str, to: Path) -> None:
    """Download the locked wheels for a Python and a machine."""
    platforms = [f"--platform={one}_{machine}" for one in GLIBC]
    options = ["--no-deps", "--require-hashes", "--only-binary=:all:", f"--python-version={python}", *platforms]
    subprocess.run([*PIP, "download", "--quiet", *options, "-r", str(LOCK), "-d", str(to)], check=True)


def slim(wheel: Path, to: Path) -> Path:
    """Copy a wheel into the folder `to` without what is left out; the copy.

    Its scripts lie where PEX looks for them: MAVProxy's wheel writes its name in small letters there.
    """
    copy = to / wheel.name
    with zipfile.ZipFile(wheel) as before, zipfile.ZipFile(copy, "w", zipfile.ZIP_DEFLATED) as after:
        names = [one for one in before.namelist() if not (one.startswith(LEFT_OUT) or one.endswith((".map", "/")))]
        (metadata,) = (one for one in names if one.endswith(".dist-info/METADATA") and one.count("/") == 1)
        fields = dict(line.split(": ", 1) for line in before.read(metadata).decode().splitlines()[:9] if ": " in line)
        small, right = (
            metadata.replace(".dist-info/METADATA", ".data/"),
            f"{fields['Name']}-{fields['Version']}.data/",
        )
        for one in names:
            content = before.read(one)
            if one.endswith(".dist-info/RECORD"):
                rows = [row for row in content.decode().splitlines() if row.split(",")[0] in names]
                content = "\n".join(rows).replace(small, right).encode()
            entry = zipfile.ZipInfo(one.replace(small, right), UNDATED)
            entry.external_attr = before.getinfo(one).external_attr
            after.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return copy


def documented(tree: Path) -> dict[str, bytes]:
    """What an ArduPilot tree documents of parameters, by the tree's own tool: our wheel's files."""
    tool = [sys.executable, str(tree.absolute() / "Tools/autotest/param_metadata/param_parse.py"), "--format", "xml"]
    files = {}
    for vehicle, file in DOCUMENTED.items():
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([*tool, "--vehicle", vehicle], cwd=folder, check=True, stdout=subprocess.DEVNULL)
            files[f"mavproxy_uavapi/files/parameter_docs/{file}"] = (Path(folder) / "apm.pdef.xml").read_bytes()
    return files


def add(files: Mapping[str, bytes], wheel: Path) -> None:
    """Add files to our wheel, by their names in it."""
    with zipfile.ZipFile(wheel) as before:
        contents = {name: before.read(name) for name in before.namelist()}
    (record,) = (name for name in contents if name.endswith(".dist-info/RECORD"))
    contents |= files
    contents[record] += "".join(f"{name},,\n" for name in files).encode()
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as after:
        for name, content in contents.items():
            after.writestr(zipfile.ZipInfo(name, UNDATED), content, zipfile.ZIP_DEFLATED)


def platform(python: str, machine: str) -> str:
    """What PEX has to know of a Python on another machine, as JSON: the tags of its wheels, the values of markers."""
    version, abi = tuple(map(int, python.split("."))), "cp" + python.replace(".", "")
    platforms = [f"{one}_{machine}" for one in (*GLIBC, "linux")]
    fitting = [*tags.cpython_tags(version, [abi], platforms), *tags.compatible_tags(version, abi, platforms)]
    markers = {
        "implementation_name": "cpython",
        "implementation_version": f"{python}.0",
        "os_name": "posix",
        "platform_machine": machine,
        "platform_python_implementation": "CPython",
        "platform_system": "Linux",
        "python_full_version": f"{python}.0",
        "python_version": python,
        "sys_platform": "linux",
    }
    return json.dumps({"marker_environment": markers, "compatible_tags": [str(one) for one in fitting]})


def build(python: str, machine: str, to: Path, more: Mapping[str, bytes]) -> Path:
    """Make the bundle, with further files of our wheel; its path."""
    work = ROOT / "build" / "bundle"
    shutil.rmtree(work, ignore_errors=True)
    fetched, wheels = work / "fetched", work / "wheels"
    wheels.mkdir(parents=True)
    fetch(python, machine, fetched)
    subprocess.run([*PIP, "wheel", "--quiet", "--no-deps", "-w", str(fetched), str(ROOT)], check=True)
    for wheel in fetched.glob("*.whl"):
        slim(wheel, wheels)
    (own,) = wheels.glob("mavproxy_uavapi-*.whl")
    add(more, own)
    bundle = to / f"mavproxy-uavapi-{own.name.split('-')[1]}-py{python.replace('.', '')}-linux-{machine}.pex"
    to.mkdir(exist_ok=True)
    lines = WITHOUT.read_text(encoding="ascii").splitlines()
    excluded = [f"--exclude={line}" for line in lines if line and not line.startswith("#")]
    target = [f"--complete-platform={platform(python, machine)}", f"--python-shebang=/usr/bin/env python{python}"]
    options = ["--venv=prepend", "--console-script=mavproxy-uavapi", f"--pre-resolved-dists={wheels}"]
    subprocess.run([sys.executable, "-m", "pex", *ROOTS, *options, *excluded, *target, "-o", str(bundle)], check=True)
    shutil.rmtree(work)
    return bundle


def main() -> None:
    """Make it, and say how large it is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    own = f"{sys.version_info.major}.{sys.version_info.minor}"
    parser.add_argument("--python", default=own, help="the version that runs it (by default this one's, %(default)s)")
    parser.add_argument("--machine", default="x86_64", choices=["x86_64", "aarch64"])
    parser.add_argument("--to", type=Path, default=ROOT / "dist", help="the folder (by default dist/)")
    parser.add_argument("--ardupilot", type=Path, help="a tree of it, for the documentation of parameters")
    parser.add_argument("--manual", type=Path, help="manual.zip, to be served at /manual (`make docs`)")
    options = parser.parse_args()
    more = documented(options.ardupilot) if options.ardupilot else {}
    if options.manual:
        more["mavproxy_uavapi/manual.zip"] = options.manual.read_bytes()
    bundle = build(options.python, options.machine, options.to, more)
    digest = hashlib.sha256(bundle.read_bytes()).hexdigest()
    print(f"{bundle}: {bundle.stat().st_size / 1e6:.0f} MB, SHA-256 {digest}")


if __name__ == "__main__":
    main()
