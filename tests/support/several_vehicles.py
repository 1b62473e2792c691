"""Several embedded vehicles behind one MAVProxy, as real processes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tests.support.ports import free_port
from tests.support.processes import Rig, eventually, load, mavproxy_command, start_embedded


@contextlib.contextmanager
def several_vehicles(
    directory: Path,
    systems: Sequence[int],
    *,
    speedup: float,
    arguments: Sequence[str] = (),
    homes: Sequence[str] = (),
    **settings: Any,
) -> Iterator[tuple[Rig, dict[int, Rig]]]:
    """A MAVProxy with `uavapi`, and its vehicles by system id, each with its control connection.

    Args:
        directory: for their files.
        systems: the system ids.
        speedup: of each vehicle.
        arguments: of MAVProxy.
        homes: `--home` of each vehicle; empty for one home.
        settings: of `uavapi`.
    """
    rig, vehicles = Rig(directory, free_port()), {}
    try:
        instances = []
        for number, system in enumerate(systems):
            folder = directory / f"vehicle-{system}"
            folder.mkdir()
            vehicles[system] = Rig(folder, 0)
            home = [f"--home={homes[number]}"] if homes else []
            instances.append(start_embedded(vehicles[system], f"--sysid={system}", *home, speedup=speedup))
        command = mavproxy_command(instances, *arguments, load(rig.port, **settings))
        rig.mavproxy = rig.start("mavproxy", command)
        rig.wait_until_up()
        eventually(lambda: set(systems) <= set(listed(rig)), what="all vehicles in the list")
        yield rig, vehicles
    finally:
        for started in (rig, *vehicles.values()):
            started.stop()


def listed(rig: Rig) -> dict[int, dict[str, Any]]:
    """What `GET /vehicles` says of each vehicle, by its system id."""
    return {vehicle["id"]: vehicle for vehicle in rig.ok(rig.get("/vehicles"))["vehicles"]}
