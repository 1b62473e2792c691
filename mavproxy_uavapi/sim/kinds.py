"""The types of vehicle, by the name that `--vehicle` gives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from .commands import Commands
from .copter import setpoints as copter_setpoints
from .copter.commands import CopterCommands
from .copter.copter import SimulatedCopter
from .parameter_tables import copter as copter_parameters
from .parameter_tables import plane as plane_parameters
from .parameter_tables import quadplane as quadplane_parameters
from .parameter_tables import rover as rover_parameters
from .parameter_tables.blocks import Blocks
from .plane import setpoints as plane_setpoints
from .plane.commands import PlaneCommands
from .plane.plane import SimulatedPlane
from .plane.vtol.quadplane import QuadPlaneCommands, SimulatedQuadPlane
from .rover import setpoints as rover_setpoints
from .rover.commands import RoverCommands
from .rover.rover import SimulatedRover


@dataclass(frozen=True)
class Kind:
    """What one type of vehicle is made of.

    vehicle and commands are classes; messages has what the type takes beyond what all take, by MAVLink name.
    """

    vehicle: Any
    commands: Callable[..., Commands[Any]]
    parameters: Blocks
    messages: Mapping[str, Callable[[Any, Any], None]]


def _landing_target(copter: SimulatedCopter, message: Any) -> None:
    copter.precland.hear(message, copter.now)


def _setpoints(reader: ModuleType) -> dict[str, Callable[[Any, Any], None]]:
    return {
        "SET_POSITION_TARGET_LOCAL_NED": reader.apply_local,
        "SET_POSITION_TARGET_GLOBAL_INT": reader.apply_global,
    }


OF_COPTER = {**_setpoints(copter_setpoints), "LANDING_TARGET": _landing_target}
OF_PLANE, OF_ROVER = _setpoints(plane_setpoints), _setpoints(rover_setpoints)
KINDS: Mapping[str, Kind] = {
    "copter": Kind(SimulatedCopter, CopterCommands, copter_parameters.BLOCKS, OF_COPTER),
    "plane": Kind(SimulatedPlane, PlaneCommands, plane_parameters.BLOCKS, OF_PLANE),
    "quadplane": Kind(SimulatedQuadPlane, QuadPlaneCommands, quadplane_parameters.BLOCKS, OF_PLANE),
    "rover": Kind(SimulatedRover, RoverCommands, rover_parameters.BLOCKS, OF_ROVER),
}
