"""The types of vehicle, by the name that `--vehicle` gives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
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
from .plane.vtol.commands import QuadPlaneCommands
from .plane.vtol.quadplane import SimulatedQuadPlane
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
    messages: Mapping[str, Callable[[Any, Any], None]] = field(default_factory=dict)


def _landing_target(copter: SimulatedCopter, message: Any) -> None:
    copter.precland.hear(message, copter.now)


KINDS: Mapping[str, Kind] = {
    "copter": Kind(
        SimulatedCopter,
        CopterCommands,
        copter_parameters.BLOCKS,
        {
            "SET_POSITION_TARGET_LOCAL_NED": copter_setpoints.apply_local,
            "SET_POSITION_TARGET_GLOBAL_INT": copter_setpoints.apply_global,
            "LANDING_TARGET": _landing_target,
        },
    ),
    "plane": Kind(
        SimulatedPlane,
        PlaneCommands,
        plane_parameters.BLOCKS,
        {
            "SET_POSITION_TARGET_LOCAL_NED": plane_setpoints.apply_local,
            "SET_POSITION_TARGET_GLOBAL_INT": plane_setpoints.apply_global,
        },
    ),
    "quadplane": Kind(
        SimulatedQuadPlane,
        QuadPlaneCommands,
        quadplane_parameters.BLOCKS,
        {
            "SET_POSITION_TARGET_LOCAL_NED": plane_setpoints.apply_local,
            "SET_POSITION_TARGET_GLOBAL_INT": plane_setpoints.apply_global,
        },
    ),
    "rover": Kind(
        SimulatedRover,
        RoverCommands,
        rover_parameters.BLOCKS,
        {
            "SET_POSITION_TARGET_LOCAL_NED": rover_setpoints.apply_local,
            "SET_POSITION_TARGET_GLOBAL_INT": rover_setpoints.apply_global,
        },
    ),
}
