"""What a companion computer needs to fly from the next boot on, as files and commands. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import PurePosixPath

USER = "uavapi"
CONFIG = PurePosixPath("/etc/mavproxy-uavapi/uav.ini")
STATE = PurePosixPath("/var/lib/mavproxy-uavapi")
TOKENS = STATE / "tokens"
UNIT = PurePosixPath("/etc/systemd/system/mavproxy-uavapi.service")
RULE = PurePosixPath("/etc/udev/rules.d/60-mavproxy-uavapi.rules")
EVERYWHERE = "0.0.0.0"

MAKE_USER = ["useradd", "--system", "--home-dir", str(STATE), "--shell", "/usr/sbin/nologin", USER]
RELOAD = ["systemctl", "daemon-reload"]
RELOAD_RULES = ["udevadm", "control", "--reload"]
START = [["systemctl", "enable", UNIT.stem], ["systemctl", "restart", UNIT.stem]]
STOP = ["systemctl", "disable", "--now", UNIT.stem]


@dataclass(frozen=True)
class Companion:
    """The answers to what cannot be known.

    Attributes:
        program: the command that the unit starts, with its path.
        device: a serial port, or a connection as `--master` takes it.
        baud: bit/s of a serial port.
        system: the vehicle's system id.
        on_network: whether other machines may call, with a token.
        usb: vendor and product of the autopilot's USB; None for a UART.
    """

    program: str
    device: str
    baud: int
    system: int
    on_network: bool
    usb: tuple[str, str] | None = None


def settings(companion: Companion) -> str:
    """The INI file."""
    kind, _, address = companion.device.partition(":")
    is_network = bool(address)
    values = {
        "connection_type": kind if is_network else "usb",
        "uav_connection": address if is_network else f"{companion.device},{companion.baud}",
        "sysid": str(companion.system),
    }
    if companion.on_network:
        values |= {"host": EVERYWHERE, "tokens": str(TOKENS)}
    return _filled(_template("uav.ini"), values)


def unit(companion: Companion) -> str:
    """The service. A program below /home is out of its sight unless it may read there."""
    program = companion.program.replace("%", "%%")  # else systemd takes it for its own
    lines = {"ExecStart": f'"{program}" --headless --config {CONFIG}'}
    if program.startswith("/home/"):
        lines["ProtectHome"] = "read-only"
    return re.sub(
        r"(?m)^(ExecStart|ProtectHome)=(.*)$",
        lambda line: f"{line[1]}={lines.get(line[1], line[2])}",
        _template("mavproxy-uavapi.service"),
    )


def rule(usb: tuple[str, str]) -> str:
    """The udev rule: ModemManager talks to every new serial port, and an autopilot does not boot then."""
    vendor, product = usb
    match = f'ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}"'
    return f'SUBSYSTEM=="tty", {match}, ENV{{ID_MM_DEVICE_IGNORE}}="1", SYMLINK+="autopilot"\n'


def files(companion: Companion) -> dict[PurePosixPath, str]:
    """The files, but for that of the tokens."""
    made = {CONFIG: settings(companion), UNIT: unit(companion)}
    return made if companion.usb is None else {**made, RULE: rule(companion.usb)}


def _template(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _filled(text: str, values: Mapping[str, str]) -> str:
    """An INI text with these values in [api], also of keys that were commented out."""
    for key, value in values.items():
        before, after = re.split(rf"(?m)^(?:# )?{key} = .*$", text, maxsplit=1)
        text = f"{before}{key} = {value}{after}"
    return text
