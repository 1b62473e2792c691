"""`aerpawlib.v2.log`: `v1`'s, with the names of v2's loggers."""

from __future__ import annotations

from enum import Enum
from functools import partial

from mavproxy_uavapi.aerpaw import log
from mavproxy_uavapi.aerpaw.log import LogLevel, get_logger

__all__ = ["LogComponent", "LogLevel", "configure_logging", "get_logger", "set_level"]


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


configure_logging = partial(log.configure_logging, root_name=LogComponent.ROOT.value)


def set_level(level: LogLevel | str | int, component: Enum | str = LogComponent.ROOT) -> None:
    """Set the level of a component, by default of all."""
    log.set_level(level, component)
