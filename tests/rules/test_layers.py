"""What stands on what, by the syntax tree: a layer knows nothing of those above it, and no import makes a circle."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
UAVAPI, VISION, GRADYS = "mavproxy_uavapi", "mavproxy_vision", "mavproxy_gradys"
CORE, SIMULATOR, EXTENSION = f"{UAVAPI}.core", f"{UAVAPI}.sim", f"{UAVAPI}.http.extension"
STATION = f"{GRADYS}.station"
CLIENT, AERPAW, LAUNCHER = f"{UAVAPI}.client", f"{UAVAPI}.aerpaw", f"{UAVAPI}.launcher."
# What a program at the other end of HTTP shares with the server: no state, no thread, no link.
PURE = [f"{CORE}.{name}" for name in ("errors", "timeout", "mavlink.flight_modes", "geodesy", "envelope.kml")]
# The rooms of each package, from the one that stands on no other to the one on top.
FLOORS = {
    CORE: ("envelope", "mainloop", "mavlink", "vehicle"),
    VISION: ("geometry", "apriltag", "camera", "tracking", "landing"),
}


def module_of(file: Path) -> str:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def modules() -> dict[str, Path]:
    """Every module of the three packages."""
    files = [file for package in (UAVAPI, VISION, GRADYS) for file in (ROOT / package).rglob("*.py")]
    return {module_of(file): file for file in files}


def imported(name: str, file: Path) -> Iterator[str]:
    """The modules of ours that a file imports anywhere in it: at its top, in a function, for its annotations."""
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*above, node.module] if node.module else above)
            yield from (
                f"{base}.{alias.name}" if f"{base}.{alias.name}" in modules() else base for alias in node.names
            )


@cache
def imports() -> dict[str, frozenset[str]]:
    """By module, those of ours that it imports."""
    return {name: frozenset(imported(name, file)) & modules().keys() for name, file in modules().items()}


def is_in(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def crossings(package: str, *allowed: str) -> list[str]:
    """The imports of a package that leave it, and go to none of these."""
    return [
        f"{name} -> {other}"
        for name, others in sorted(imports().items())
        for other in sorted(others)
        if is_in(name, package) and not any(is_in(other, one) for one in (package, *allowed))
    ]


def test_no_import_makes_a_circle() -> None:
    try:
        TopologicalSorter(imports()).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_core_imports_nothing_but_core() -> None:
    assert crossings(CORE) == []


def test_uavapi_imports_the_other_modules_in_its_launcher_only() -> None:
    assert [line for line in crossings(UAVAPI) if not line.startswith(LAUNCHER)] == []


@pytest.mark.parametrize("package", [VISION, GRADYS])
def test_other_modules_import_core_and_the_extension_only(package: str) -> None:
    assert crossings(package, CORE, EXTENSION) == []


def test_the_station_which_has_no_api_imports_no_extension_either() -> None:
    assert crossings(STATION, GRADYS, CORE) == []


def test_client_imports_pure_core_only() -> None:
    assert crossings(CLIENT, *PURE) == []


def test_aerpaw_host_imports_the_client_and_pure_core_only() -> None:
    assert crossings(AERPAW, CLIENT, *PURE) == []


@pytest.mark.parametrize("package", [CLIENT, AERPAW])
def test_server_knows_nothing_of_its_clients(package: str) -> None:
    users = [name for name, others in imports().items() if any(is_in(other, package) for other in others)]
    assert [name for name in users if not (is_in(name, CLIENT) or is_in(name, AERPAW))] == []


def test_nobody_imports_the_simulator() -> None:
    users = [name for name, others in imports().items() if any(is_in(other, SIMULATOR) for other in others)]
    assert [name for name in users if not is_in(name, SIMULATOR)] == []


@pytest.mark.parametrize("package", FLOORS)
def test_rooms_stand_on_those_below_them(package: str) -> None:
    floors = FLOORS[package]
    wrong = [
        f"{name} -> {other}"
        for name, others in sorted(imports().items())
        for other in sorted(others)
        for below, lower in enumerate(floors)
        for upper in floors[below + 1 :]
        if is_in(name, f"{package}.{lower}") and is_in(other, f"{package}.{upper}")
    ]
    assert wrong == []


def test_the_rules_look_at_every_module() -> None:
    assert {UAVAPI, VISION, GRADYS, CORE, EXTENSION, SIMULATOR} <= modules().keys()
    assert f"{CORE}.errors" in imports()[f"{UAVAPI}.http.responses"]
