"""The tests mirror the packages: `tests/core/test_audit.py` tests `mavproxy_uavapi/core/audit.py`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]
AREAS = {
    "core": "mavproxy_uavapi/core",
    "uavapi": "mavproxy_uavapi",
    "vision": "mavproxy_vision",
    "gradys": "mavproxy_gradys",
}
# What tests several modules together; each says in its first line what it is about.
TOGETHER = {
    "uavapi/http/test_named_tokens.py": "tokens in the whole API",
    "uavapi/http/test_strict_door.py": "all routes",
    "uavapi/module/test_listening.py": "a part of module.py",
    "uavapi/module/test_loading.py": "a part of module.py",
    "uavapi/module/test_module_settings.py": "a part of module.py",
    "uavapi/module/test_unloading.py": "a part of module.py",
    "uavapi/rehearsal/test_what_the_api_sees.py": "each fault of the simulator, by the API",
    "uavapi/sim/copter/test_guided_items.py": "a message, in each mode of the copter",
    "uavapi/sim/copter/test_pause.py": "a command, in each mode of the copter",
    "uavapi/sim/copter/test_targets.py": "two messages, in each mode of the copter",
    "uavapi/sim/test_nonsense.py": "everything that a ground station may send",
    "uavapi/sim/test_nonsense_types.py": "the same for the other types",
    "vision/landing/test_endings.py": "flights by ends",
    "vision/landing/test_envelope.py": "landings on a tag that leaves the envelope",
    "vision/landing/test_failures.py": "what goes wrong in a landing",
    "vision/landing/test_moving_pads.py": "landings on pads that move",
}


def strays(tests: Iterable[str]) -> set[str]:
    """The tests, by their path in `tests`, without a module or a folder of their name."""
    return {test for test in tests if not any(path.exists() for path in places_of(Path(test)))}


def places_of(test: Path) -> list[Path]:
    area, *folders = test.parent.parts
    folder, name = ROOT.joinpath(AREAS[area], *folders), test.stem.removeprefix("test_")
    return [folder / file for file in (f"{name}.py", f"__{name}__.py", f"{name}.js", name)]


def test_each_test_has_its_module() -> None:
    tests = [file for area in AREAS for file in (ROOT / "tests" / area).rglob("test_*.py")]
    found = strays(file.relative_to(ROOT / "tests").as_posix() for file in tests)
    assert sorted(found - TOGETHER.keys()) == [], "name it after the module that it tests, or add it to TOGETHER"
    assert sorted(TOGETHER.keys() - found) == [], "TOGETHER need not have it"


def test_a_test_without_a_module_is_found() -> None:
    assert strays(["core/test_audit.py", "core/test_nothing.py"]) == {"core/test_nothing.py"}
