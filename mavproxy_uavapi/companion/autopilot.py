"""Where the autopilot is, and which vehicle it flies. Blocking: it opens the port."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from pymavlink import mavutil

from mavproxy_uavapi.core.telemetry.flight_modes import kind_of

BAUDS = (921600, 57600, 115200)  # of TELEM ports, the likeliest first; USB takes any
HEARD_WITHIN = 3.0  # s; an autopilot sends a heartbeat each second
BY_ID, UART = Path("/dev/serial/by-id"), Path("/dev/serial0")
SYSFS = Path("/sys/class/tty")


class Autopilot(NamedTuple):
    """What was heard.

    Attributes:
        device: a path, or a connection as `--master` takes it, such as `udpin:0.0.0.0:14550`.
        baud: bit/s at which it was heard; 0 for a network.
        system: its system id.
        kind: `copter`, `plane`, `rover` or `other`.
    """

    device: str
    baud: int
    system: int
    kind: str


def ports(by_id: Path = BY_ID, uart: Path = UART) -> list[str]:
    """The serial ports at which an autopilot may be, the likeliest first: USB, then the UART."""
    names = sorted(by_id.iterdir(), key=_likelihood) if by_id.is_dir() else []
    return [str(port) for port in [*names, *([uart] if uart.exists() else [])]]


def _likelihood(port: Path) -> tuple[bool, bool, str]:
    """An autopilot's second interface, if00 aside, speaks SLCAN."""
    known = any(word in port.name.lower() for word in ("ardupilot", "px4", "fmu", "cube", "pixhawk", "holybro"))
    return not known, not port.name.endswith("if00"), port.name


def hear(device: str, bauds: Iterable[int] = BAUDS, seconds: float = HEARD_WITHIN) -> Autopilot | None:
    """The autopilot at a port; None if nothing is heard at any of these rates.

    Raises:
        OSError: the port cannot be opened.
    """
    is_network = ":" in device
    if Path(device).exists() and not Path(device).is_char_device():
        raise OSError("it is no serial port")  # pymavlink would read it as a log
    for baud in (0,) if is_network else bauds:
        link = mavutil.mavlink_connection(device, baud=baud or 115200, source_system=255)
        try:
            heartbeat = _heartbeat(link, time.monotonic() + seconds)
        finally:
            link.close()
        if heartbeat is not None:
            return Autopilot(device, baud, heartbeat.get_srcSystem(), kind_of(heartbeat.type))
    return None


def _heartbeat(link: mavutil.mavfile, until: float) -> mavutil.mavlink.MAVLink_heartbeat_message | None:
    while (left := until - time.monotonic()) > 0:
        message = link.recv_match(type="HEARTBEAT", blocking=True, timeout=left)
        if message is not None and message.autopilot != mavutil.mavlink.MAV_AUTOPILOT_INVALID:
            return message
    return None


def usb_ids(device: str, sysfs: Path = SYSFS) -> tuple[str, str] | None:
    """Vendor and product of the USB device behind a port, four hexadecimal digits each; None for a UART."""
    tty = sysfs / Path(device).resolve().name / "device"
    for folder in [tty.resolve(), *tty.resolve().parents]:
        vendor, product = folder / "idVendor", folder / "idProduct"
        if vendor.is_file() and product.is_file():
            return vendor.read_text().strip(), product.read_text().strip()
    return None
