"""The locked requirements: whole, lean, and the same for all who use them."""

from __future__ import annotations

import importlib.metadata
import re
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

Asked = dict[str, list[Requirement]]
FOLDER = Path(__file__).parents[2] / "requirements"
PYTHONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
MACHINES = ("x86_64", "aarch64")
NO_PART_OF_A_LOCK = re.compile(r"^(?!#| |[a-z0-9])", re.MULTILINE)  # options: an index, a link, another file


def locked(name: str) -> list[Requirement]:
    """The lines of a lock, each with one version."""
    text = (FOLDER / name).read_text(encoding="utf-8")
    return [Requirement(line.rstrip(" \\")) for line in text.splitlines() if line and line[0].isalnum()]


def listed(name: str) -> list[Requirement]:
    """The lines of an input file."""
    lines = (line.partition("#")[0].strip() for line in (FOLDER / name).read_text(encoding="utf-8").splitlines())
    return [Requirement(line) for line in lines if line]


def environment(python: str, machine: str) -> dict[str, str]:
    """What markers ask of that Python on that machine."""
    return {
        "python_version": python,
        "python_full_version": f"{python}.9",
        "platform_machine": machine,
        "sys_platform": "linux",
        "platform_system": "Linux",
        "os_name": "posix",
        "platform_python_implementation": "CPython",
        "implementation_name": "cpython",
        "extra": "",
    }


def versions(name: str, where: dict[str, str] | None = None) -> dict[str, str]:
    """What a lock installs there, here without an environment."""
    pins: dict[str, str] = {}
    for line in locked(name):
        if line.marker is None or line.marker.evaluate(where):
            (pin,) = line.specifier
            key = canonicalize_name(line.name)
            assert pin.operator == "==" and key not in pins
            pins[key] = pin.version
    return pins


def unmet(requested: list[Requirement], pins: dict[str, str], where: dict[str, str] | None = None) -> list[str]:
    """Which of the requirements those versions do not meet."""
    return [
        str(line)
        for line in requested
        if (line.marker is None or line.marker.evaluate(where or {"extra": ""}))
        and not (
            (version := pins.get(canonicalize_name(line.name))) and line.specifier.contains(version, prereleases=True)
        )
    ]


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize(("name", "extras"), [("lean.txt", ("vision", "mqtt")), ("dev.txt", ("dev",))])
def test_a_lock_meets_what_the_project_asks_for(name, extras, python, machine, asked_for: Asked):
    where = environment(python, machine)
    requested = [line for extra in ("", *extras) for line in asked_for[extra]]
    assert unmet(requested + listed("lean.in"), versions(name, where), where) == []


@pytest.mark.parametrize("name", ["lean.txt", "dev.txt"])
def test_a_lock_has_what_its_packages_ask_for_but_what_is_left_out(name):
    without = {line.name for line in listed("without.in")}
    pins = versions(name)
    for package in pins:
        requested = [Requirement(line) for line in importlib.metadata.requires(package) or []]
        assert unmet([line for line in requested if line.name not in without], pins) == [], package


def test_what_is_left_out_is_in_no_lock_and_still_required_by_mavproxy():
    without = {line.name for line in listed("without.in")}
    requested = {Requirement(line).name for line in importlib.metadata.requires("mavproxy") or []}
    assert without <= requested
    for name in ("lean.txt", "dev.txt"):
        assert not without & {line.name for line in locked(name)}


def test_the_lean_lock_has_no_tools_of_tests_and_linters(asked_for: Asked):
    tools = {line.name for extra in ("test", "lint") for line in asked_for[extra]}
    tools -= {line.name for extra in ("vision", "mqtt", "aerpaw", "fleet") for line in asked_for[extra]} | {
        "setuptools"
    }
    assert {"pytest", "ruff"} <= tools
    assert not tools & {line.name for line in locked("lean.txt")}


def test_tests_and_linters_change_no_version_of_the_lean_lock():
    assert {str(line) for line in locked("lean.txt")} <= {str(line) for line in locked("dev.txt")}


@pytest.mark.parametrize("name", ["lean.txt", "dev.txt"])
def test_a_lock_has_hashes_and_names_no_index(name):
    text = (FOLDER / name).read_text(encoding="utf-8")
    assert not NO_PART_OF_A_LOCK.search(text.rstrip("\n")) and "://" not in text
    for block in re.split(r"^(?=[a-z0-9])", text, flags=re.MULTILINE)[1:]:
        assert re.search(r"--hash=sha256:[0-9a-f]{64}\b", block), block
