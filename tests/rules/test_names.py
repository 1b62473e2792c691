"""A class name is one class in the three packages: a name leads to one place. The exceptions have a reason."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from tests.support.sources import classes

# Folders with names of their own: aerpawlib's, the client's, and the embedded vehicle's, which shares no code.
WORLDS = ("aerpaw/v2", "aerpaw", "client", "sim/copter", "sim/plane", "sim/rover", "sim")
REASONS = {
    "aerpawlib calls it so, and scripts import it": "Attitude Battery Drone Rover Vehicle BasicRunner DummyVehicle"
    " ExternalProcess LogComponent Runner SafetyCheckerClient StateMachine ZmqStateMachine",
    "the embedded vehicles have it once for each type": "AutoSubmode Demand GuidedSubmode Mode"
    " NavigatingMode Navigator PilotMode",
    "ArduPilot has a mode of that name for several types": "Auto Guided Loiter Rtl SmartRtl",
    "a mode of ArduPilot, and the request in the API's description": "Takeoff",
    "the public name of the client, and the frame of the embedded vehicle": "Ned",
}


def world_of(file: str) -> str:
    return next((world for world in WORLDS if file.startswith(f"mavproxy_uavapi/{world}/")), "")


def worlds(definitions: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """By class name, the world of each definition; they are files and names."""
    found = defaultdict(list)
    for file, name in definitions:
        found[name].append(world_of(file))
    return found


def repeated(definitions: Iterable[tuple[str, str]], listed: set[str]) -> dict[str, list[str]]:
    """The names with several classes, but for those listed that have one in each world."""
    return {
        name: where
        for name, where in worlds(definitions).items()
        if len(where) > 1 and not (name in listed and len(where) == len(set(where)))
    }


def listed() -> set[str]:
    return set(" ".join(REASONS.values()).split())


def test_a_class_name_is_one_class() -> None:
    assert repeated(classes(), listed()) == {}


def test_the_list_names_nothing_that_is_one_class() -> None:
    assert {name for name, where in worlds(classes()).items() if len(where) > 1} >= listed()


def test_two_classes_of_a_name_are_found() -> None:
    plane, rover, core = (
        f"mavproxy_uavapi/{name}.py" for name in ("sim/plane/modes", "sim/rover/modes", "core/host")
    )
    assert repeated([(plane, "Auto"), (core, "Auto")], set()) == {"Auto": ["sim/plane", ""]}
    assert repeated([(plane, "Auto"), (rover, "Auto")], {"Auto"}) == {}
    assert repeated([(plane, "Auto"), (plane, "Auto")], {"Auto"}) == {"Auto": ["sim/plane", "sim/plane"]}
