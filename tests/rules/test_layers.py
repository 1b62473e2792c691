"""What stands on what, by the syntax tree: a layer knows nothing of those above it, and no import makes a circle.

An import counts anywhere in a file, and by a function, too, if the name is written out: `import_module("...")`.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
UAVAPI, VISION, GRADYS = "mavproxy_uavapi", "mavproxy_vision", "mavproxy_gradys"
CORE, SIMULATOR, EXTENSION = f"{UAVAPI}.core", f"{UAVAPI}.sim", f"{UAVAPI}.http.extension"
STATION = f"{GRADYS}.station"
OTHERS = ("uavapi.py", "vision.py", "gradys.py", "examples/**/*.py", "benchmarks/*.py")
BY_FUNCTION = {"import_module", "__import__"}
# They start the embedded vehicle as a process: the launcher, and benchmarks that compare it with ArduPilot's SITL.
STARTERS = {f"{UAVAPI}.launcher.command_lines", "benchmarks.sim_pair"}
CLIENT, AERPAW, LAUNCHER = f"{UAVAPI}.client", f"{UAVAPI}.aerpaw", f"{UAVAPI}.launcher."
# A program beside a server, which it asks; it has an API and vehicles of its own.
REHEARSAL, COMPANION = f"{UAVAPI}.rehearsal", f"{UAVAPI}.rehearsal.companion"
# What a program at the other end of HTTP shares with the server: no state, no thread, no link.
PURE_NAMES = (
    *("errors", "timeout", "telemetry.flight_modes", "geodesy", "airspace.kml"),
    *("file_text", "strict_json", "terminal", "text"),
)
PURE = [f"{CORE}.{name}" for name in PURE_NAMES]
# The rooms of each package, from the one that stands on no other to the one on top; two may share a floor.
FLOORS = {
    CORE: ("mainloop", "telemetry", "link", "control", "mission airspace", "vehicle", "oversight"),
    f"{UAVAPI}.http": ("contract", "wire", "stream", "callers", "door", "handlers", "server"),
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


@cache
def sources() -> dict[str, ast.Module]:
    """Every module of the three packages, what MAVProxy loads, the examples and the benchmarks; parsed."""
    others = [file for pattern in OTHERS for file in ROOT.glob(pattern)]
    files = modules() | {module_of(file): file for file in others}
    return {name: ast.parse(file.read_text(encoding="utf-8")) for name, file in files.items()}


def texts(tree: ast.AST) -> list[str]:
    """All strings in it."""
    return [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]


def called(function: ast.expr) -> str:
    """The last part of a function's name."""
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def imported(package: str, tree: ast.AST) -> Iterator[str]:
    """What a file of this package imports anywhere in it: at its top, in a function, for its annotations."""
    rooms = package.split(".")
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = rooms[: len(rooms) - node.level + 1] if node.level else []
            base = ".".join([*above, node.module] if node.module else above)
            yield from (
                f"{base}.{alias.name}" if f"{base}.{alias.name}" in modules() else base for alias in node.names
            )
        elif isinstance(node, ast.Call) and called(node.func) in BY_FUNCTION:
            yield from texts(node)


@cache
def imports() -> dict[str, frozenset[str]]:
    """By module, those of ours that it imports; the examples and the benchmarks are modules, too."""
    initial = {name for name, file in modules().items() if file.name == "__init__.py"}
    packages = {name: name if name in initial else name.rpartition(".")[0] for name in sources()}
    return {name: frozenset(imported(packages[name], tree)) & modules().keys() for name, tree in sources().items()}


def packages_of(name: str) -> set[str]:
    """All packages that a module is in."""
    parts = name.split(".")
    return {".".join(parts[:length]) for length in range(1, len(parts))}


def circle(table: Mapping[str, AbstractSet[str]]) -> list[str]:
    """The first circle of these imports; empty if there is none.

    An import runs the packages that the module is in, but for those whose import has begun: the importer's own.
    """
    edges = {
        name: others | (set[str]().union(*map(packages_of, others)) - packages_of(name) - {name})
        for name, others in table.items()
    }
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def namers_of_the_simulator(table: Mapping[str, ast.AST]) -> set[str]:
    """The modules outside of it that have its name in a string, such as a command line."""
    return {name for name, tree in table.items() if not is_in(name, SIMULATOR) and SIMULATOR in " ".join(texts(tree))}


def is_in(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def crossings(package: str, *allowed: str, table: Mapping[str, AbstractSet[str]] | None = None) -> list[str]:
    """The imports of a package that leave it, and go to none of these; `table` is for one of other imports."""
    return [
        f"{name} -> {other}"
        for name, others in sorted((imports() if table is None else table).items())
        for other in sorted(others)
        if is_in(name, package) and not any(is_in(other, one) for one in (package, *allowed))
    ]


def test_no_import_makes_a_circle() -> None:
    assert circle(imports()) == []


def test_a_package_that_is_imported_with_its_module_is_part_of_a_circle() -> None:
    assert set(circle({"a": {"a.b"}, "a.b": {"c"}, "c": {"a.d"}, "a.d": set()})) == {"a", "a.b", "c"}
    assert circle({"a": {"a.b"}, "a.b": {"a.d"}, "c": {"a.d"}, "a.d": set()}) == []


def test_core_imports_nothing_but_core() -> None:
    assert crossings(CORE) == []


def test_uavapi_imports_others_in_its_launcher_and_for_rehearsals_only() -> None:
    assert [line for line in crossings(UAVAPI) if not line.startswith((LAUNCHER, COMPANION))] == []


@pytest.mark.parametrize("package", [VISION, GRADYS])
def test_other_modules_import_core_and_the_extension_only(package: str) -> None:
    assert crossings(package, CORE, EXTENSION) == []


def test_streams_of_the_api_are_no_part_of_the_extension() -> None:
    table = {f"{VISION}.http": {EXTENSION, f"{UAVAPI}.http.stream", f"{CORE}.streaming"}}
    assert crossings(VISION, CORE, EXTENSION, table=table) == [f"{VISION}.http -> {UAVAPI}.http.stream"]


def test_the_station_which_has_no_api_imports_no_extension_either() -> None:
    assert crossings(STATION, GRADYS, CORE) == []


def test_client_imports_pure_core_only() -> None:
    assert crossings(CLIENT, *PURE) == []


def test_aerpaw_host_imports_the_client_and_pure_core_only() -> None:
    assert crossings(AERPAW, CLIENT, *PURE) == []


@pytest.mark.parametrize("package", [CLIENT, AERPAW])
def test_server_knows_nothing_of_its_clients(package: str) -> None:
    users = [name for name in modules() if any(is_in(other, package) for other in imports()[name])]
    assert [name for name in users if not any(is_in(name, one) for one in (CLIENT, AERPAW, REHEARSAL))] == []


def test_nobody_but_rehearsals_and_the_tests_imports_the_simulator() -> None:
    users = [name for name, others in imports().items() if any(is_in(other, SIMULATOR) for other in others)]
    assert [name for name in users if not is_in(name, SIMULATOR) and not is_in(name, REHEARSAL)] == []


def test_two_start_the_simulator_as_a_process() -> None:
    assert namers_of_the_simulator(sources()) == STARTERS


def test_a_name_in_a_string_is_found() -> None:
    tree = ast.parse(f"run(['-m', '{SIMULATOR}'])")
    assert namers_of_the_simulator({f"{VISION}.module": tree, f"{SIMULATOR}.cli": tree}) == {f"{VISION}.module"}


@pytest.mark.parametrize("source", [f"importlib.import_module('{SIMULATOR}')", f"__import__('{SIMULATOR}')"])
def test_an_import_by_a_function_is_an_import(source: str) -> None:
    assert list(imported(VISION, ast.parse(source))) == [SIMULATOR]


@pytest.mark.parametrize("package", FLOORS)
def test_rooms_stand_on_those_below_them(package: str) -> None:
    floors = FLOORS[package]
    wrong = [
        f"{name} -> {other}"
        for name, others in sorted(imports().items())
        for other in sorted(others)
        for below, lower in enumerate(floors)
        for upper in floors[below + 1 :]
        if any(is_in(name, f"{package}.{room}") for room in lower.split())
        if any(is_in(other, f"{package}.{room}") for room in upper.split())
    ]
    assert wrong == []


def test_the_rules_look_at_every_module() -> None:
    assert {UAVAPI, VISION, GRADYS, CORE, EXTENSION, SIMULATOR} <= modules().keys()
    assert f"{CORE}.errors" in imports()[f"{UAVAPI}.http.contract.responses"]
