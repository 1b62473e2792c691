"""`aerpawlib.v2.log`: `v1`'s, with the names of v2's loggers."""

from __future__ import annotations

from enum import Enum
from typing import Any

from mavproxy_uavapi.aerpaw import log
from mavproxy_uavapi.aerpaw.log import LogLevel


class LogComponent(str, Enum):
    """The names of the loggers."""

    ROOT = "aerpawlib.v2"
    VEHICLE = "aerpawlib.v2.vehicle"
    DRONE = "aerpawlib.v2.vehicle.drone"
    ROVER = "aerpawlib.v2.vehicle.rover"
    SAFETY = "aerpawlib.v2.safety"
    RUNNER = "aerpawlib.v2.runner"
    AERPAW = "aerpawlib.v2.aerpaw"
    ZMQ = "aerpawlib.v2.zmq"


def configure_logging(level: LogLevel | str | int = LogLevel.INFO, **options: Any) -> None:
    """As `v1`'s."""
    log.configure_logging(level, **{"root_name": LogComponent.ROOT.value, **options})


def set_level(level: LogLevel | str | int, component: Enum | str = LogComponent.ROOT) -> None:
    """Set the level of a component, by default of all."""
    log.set_level(level, component)
