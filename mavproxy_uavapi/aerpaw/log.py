"""`aerpawlib.v1.log`: loggers by component."""

from __future__ import annotations

import logging
import sys
from enum import Enum

FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"


class LogLevel(Enum):
    """The levels of `logging`."""

    DEBUG = logging.DEBUG
    INFO = logging.INFO
    WARNING = logging.WARNING
    ERROR = logging.ERROR
    CRITICAL = logging.CRITICAL

    @classmethod
    def from_string(cls, level: str) -> LogLevel:
        """The level of that name, in capitals or not; `warn` is WARNING.

        Raises:
            KeyError: there is no such level.
        """
        name = level.upper()
        return cls["WARNING" if name == "WARN" else name]


class LogComponent(str, Enum):
    """The names of the loggers."""

    ROOT = "aerpawlib.v1"
    VEHICLE = "aerpawlib.v1.vehicle"
    DRONE = "aerpawlib.v1.vehicle.drone"
    ROVER = "aerpawlib.v1.vehicle.rover"
    SAFETY = "aerpawlib.v1.safety"
    RUNNER = "aerpawlib.v1.runner"
    TELEMETRY = "aerpawlib.v1.telemetry"
    COMMAND = "aerpawlib.v1.command"
    NAVIGATION = "aerpawlib.v1.navigation"
    CONNECTION = "aerpawlib.v1.connection"
    GEOFENCE = "aerpawlib.v1.geofence"
    ZMQ = "aerpawlib.v1.zmq"
    AERPAW = "aerpawlib.v1.aerpaw"
    OEO = "aerpawlib.v1.oeo"
    EXTERNAL = "aerpawlib.v1.external"
    USER = "aerpawlib.v1.user"
    SITL = "aerpawlib.sitl"


class ColoredFormatter(logging.Formatter):
    """A formatter; there are no colours."""

    def __init__(self, fmt: str | None = None, datefmt: str | None = None, use_colors: bool = True) -> None:
        super().__init__(fmt or FORMAT, datefmt)


def get_logger(component: Enum | str = LogComponent.ROOT) -> logging.Logger:
    """The logger of a component."""
    return logging.getLogger(component.value if isinstance(component, Enum) else component)


def configure_logging(
    level: LogLevel | str | int = LogLevel.INFO,
    *,
    format_str: str | None = None,
    use_colors: bool = True,
    log_file: str | None = None,
    root_name: str = "aerpawlib.v1",
) -> None:
    """Make the loggers below `root_name` write to stderr, and to `log_file` if there is one. There are no colours."""
    root = logging.getLogger(root_name)
    handlers: list[logging.Handler] = [logging.StreamHandler(sys.stderr)]
    if log_file:
        handlers.append(logging.FileHandler(log_file, encoding="utf-8"))
    for handler in handlers:
        handler.setFormatter(logging.Formatter(format_str or FORMAT))
    root.handlers = handlers
    root.propagate = False
    set_level(level, root_name)


def set_level(level: LogLevel | str | int, component: Enum | str | None = None) -> None:
    """Set the level of a component; None means all."""
    number = level.value if isinstance(level, LogLevel) else level.upper() if isinstance(level, str) else level
    get_logger(component or LogComponent.ROOT).setLevel(number)
