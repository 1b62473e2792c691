"""The settings of the module `gradys`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding.quantities import Quantity, parse_quantities
from mavproxy_gradys.forwarding.readings import UAV
from mavproxy_gradys.forwarding.sink_address import SinkAddress, sink_addresses
from mavproxy_gradys.net.addresses import StationAddress, checked_ip, split_url, stations
from mavproxy_gradys.net.http_client import tls_context
from mavproxy_gradys.net.topics import checked_filter
from mavproxy_uavapi.core.addresses import masked
from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.core.settings import ModuleSettings, setting
from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.core.text import escaped
from mavproxy_uavapi.core.values import path_of

HEARD_TOPIC = "fleet/+/position"  # the default filter of `hear`
DEVICE = re.compile(r"[A-Za-z0-9._-]{1,60}")


def default_spool() -> str:
    """The default path of the spool."""
    return str(state_directory() / "gradys.db")


@dataclass(frozen=True)
class GradysSettings:
    """A snapshot of the settings, each with its row of the table: what it means, and in which unit.

    `token`, `ca_file`, `ip` and `hear` are empty for none.
    """

    gs: tuple[StationAddress, ...] = setting(str, "", "ground stations, HOST:PORT by comma", tab="Gradys")
    ip: str = setting(str, "", "HOST[:PORT] at which they reach our API; empty: found out")
    period: float = setting(float, 1.0, "s between updates", range=(0.1, 3600))
    max_age: float = setting(float, 5.0, "s after which a position is no longer sent", range=(0.1, 3600))
    timeout: float = setting(float, 3.0, "s for an answer", range=(0.1, 60))
    token: str = setting(str, "", "bearer token for stations and HTTP sinks")
    ca_file: str = setting(str, "", "certificates that TLS is checked by; empty: the system's")
    sink: tuple[SinkAddress, ...] = setting(
        str, "", "where readings go, by comma: http(s)://HOST/PATH[#ack=status], mqtt(s)://HOST/TOPIC[#ack=station]"
    )
    device: str = setting(str, UAV, "how device names begin: `uav` makes uav-7; unique to a companion")
    hear: str = setting(str, "", "broker with the positions of other MAVProxys: mqtt(s)://HOST[/TOPIC]")
    quantities: tuple[Quantity, ...] = setting(str, "position@1", "what is sampled while there is a sink")
    spool: Path = setting(str, default_spool(), "file that keeps readings until they are acknowledged")
    spool_mb: float = setting(float, 64.0, "MB of readings kept; beyond it the oldest go", range=(0.1, 100_000))
    spool_hours: float = setting(float, 72.0, "h after which readings are dropped", range=(0.01, 100_000))


def header_value(text: str) -> str:
    """The text, if it is valid in an HTTP header.

    Raises:
        SettingError: it is not.
    """
    if not (text.isascii() and (text.isprintable() or not text)):
        raise SettingError("it takes printable ASCII")
    return text


def device_name(text: str) -> str:
    """The beginning of device names, checked; it is a part of topics, too.

    Raises:
        SettingError: it has other letters than a device name may have.
    """
    if not DEVICE.fullmatch(text):
        raise SettingError("it takes 1 to 60 of the letters A-Z a-z 0-9 . _ -")
    return text


def broker(text: str) -> str:
    """The address of a broker and its topic filter, checked; empty for none.

    Raises:
        SettingError: it is malformed.
    """
    if text:
        split_url(text, ("mqtt", "mqtts"))
        topic = unquote(text.partition("://")[2].partition("/")[2])
        checked_filter(topic or HEARD_TOPIC)
    return text


def spool_path(text: str) -> Path:
    """The spool's file; empty for the default.

    Raises:
        SettingError: it is not a valid file name.
    """
    if not text.isprintable():
        raise SettingError("it takes a file's name in printable letters")
    return path_of(text or default_spool())


class GradysModuleSettings(ModuleSettings[GradysSettings]):
    """The settings of the loaded module; [api] of an INI file may also have the station, as `gradys_gs`."""

    module, snapshot_class = "gradys", GradysSettings
    secrets = frozenset({"token", "sink", "hear"})
    parsers = {
        "gs": stations,
        "ip": checked_ip,
        "token": header_value,
        "ca_file": lambda text: str(path_of(text)) if text else "",
        "sink": sink_addresses,
        "device": device_name,
        "hear": broker,
        "quantities": parse_quantities,
        "spool": spool_path,
    }

    def check_source(self, name: str, value: Any, in_file: bool) -> None:
        """Refuse commands that are not in an INI file: a prompt may be open to more people than the machine is.

        Raises:
            SettingError: another source has one.
        """
        if name == "quantities" and not in_file:
            commands = [quantity.name for quantity in parse_quantities(value) if quantity.command]
            if commands:
                raise SettingError(f"quantities: {', '.join(commands)}: only an INI file may have exec:", name)

    def check(self, settings: GradysSettings, changed: Set[str]) -> None:
        """Refuse certificates that cannot check TLS.

        Raises:
            SettingError: the file is missing, or is not a certificate file.
        """
        if "ca_file" in changed and settings.ca_file:
            try:
                tls_context(settings.ca_file)
            except NotDelivered as error:
                raise SettingError(str(error), "ca_file") from error

    def settings_in(self, ini: IniFile) -> Iterator[tuple[str, str]]:
        """The station of the original service's section, and our own section, which wins."""
        station = ini.section("api").get("gradys_gs")
        if station is not None:
            yield "gs", station
        yield from super().settings_in(ini)

    def shown(self, name: str) -> str:
        """As any setting; sinks and brokers without their passwords."""
        if name == "hear":
            return escaped(masked(self.snapshot().hear))
        return ",".join(map(str, self.snapshot().sink)) if name == "sink" else super().shown(name)
