"""MAVLink's wire format between the simulator and the host, in no more time than a long flight can afford."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mavproxy_uavapi.sim import Simulator

FRAME = 12  # bytes of a frame of MAVLink 2 besides its payload
LENGTH = 1  # where the payload's length is
# A third of all messages: the host keeps them for clients that ask for one by its name.
READ_BY_NOBODY = {"RAW_IMU", "SCALED_PRESSURE", "POWER_STATUS", "MEMINFO", "SERVO_OUTPUT_RAW", "SIMSTATE", "AHRS"}
READ_BY_NOBODY |= {"VIBRATION"}


def attentive_link(simulator: Simulator) -> Any:
    """A link whose streams have what the host reads."""
    link = simulator.open_link("test")
    groups = link._groups.items()
    link._groups = {group: tuple(name for name in names if name not in READ_BY_NOBODY) for group, names in groups}
    link.restart()
    return link


def frames(data: bytes) -> Iterator[bytearray]:
    """The frames of MAVLink 2, without signatures: a parser finds them by a look at each byte."""
    at = 0
    while at < len(data):
        end = at + FRAME + data[at + LENGTH]
        yield bytearray(data[at:end])
        at = end
