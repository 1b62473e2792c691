"""The module's settings: MPSettings at the prompt, an INI file -> one frozen snapshot handed inward."""

from __future__ import annotations

import configparser
import difflib
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from MAVProxy.modules.lib.mp_settings import MPSetting, MPSettings

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.forwarding.readings import Quantity, parse_quantities
from mavproxy_gradys.forwarding.sink_address import SinkAddress, sink_addresses
from mavproxy_gradys.net.addresses import StationAddress, check_ip, stations
from mavproxy_gradys.net.http_client import tls_context
from mavproxy_uavapi.settings import UNSET, SettingError

SECTION = "gradys"
SECRETS = {"token", "sink"}


@dataclass(frozen=True)
class Settings:
    """A snapshot of the settings.

    Attributes:
        gs: ground stations that are told where the vehicles are.
        ip: HOST or HOST:PORT at which stations reach our API; empty for what is found out.
        period: s between updates.
        max_age: s after which a position or a message is too old to be told as new.
        timeout: s for an answer.
        token: bearer token for stations and HTTP sinks; empty for none.
        ca_file: certificates that TLS is checked by; empty for the system's.
        sink: where readings go.
        quantities: what is sampled.
        spool: file in which readings are kept until they are acknowledged.
        spool_mb: its largest size (MB of readings); beyond it the oldest are dropped.
        spool_hours: age (h) after which readings are dropped.
    """

    gs: tuple[StationAddress, ...]
    ip: str
    period: float
    max_age: float
    timeout: float
    token: str
    ca_file: str
    sink: tuple[SinkAddress, ...]
    quantities: tuple[Quantity, ...]
    spool: Path
    spool_mb: float
    spool_hours: float


def default_spool() -> str:
    """Where readings are kept when nothing else is said: the user's state directory (XDG base directories)."""
    state = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    return f"{state}/mavproxy-uavapi/gradys.db"


def table() -> list[Any]:
    """The settings with their types, defaults and ranges, as MAVProxy knows them."""
    return [
        MPSetting("gs", str, "", "ground stations, HOST:PORT by comma", tab="Gradys"),
        MPSetting("ip", str, "", "HOST[:PORT] at which they reach our API; empty: found out"),
        MPSetting("period", float, 1.0, "s between updates", range=(0.1, 3600)),
        MPSetting("max_age", float, 5.0, "s after which a position is not told any more", range=(0.1, 3600)),
        MPSetting("timeout", float, 3.0, "s for an answer", range=(0.1, 60)),
        MPSetting("token", str, "", "bearer token for stations and HTTP sinks"),
        MPSetting("ca_file", str, "", "certificates that TLS is checked by; empty: the system's"),
        MPSetting(
            "sink", str, "", "where readings go, by comma: http(s)://HOST/PATH[#ack=status], mqtt(s)://HOST/TOPIC"
        ),
        MPSetting("quantities", str, "position@1", "what is sampled while there is a sink"),
        MPSetting("spool", str, default_spool(), "file that keeps readings until they are acknowledged"),
        MPSetting("spool_mb", float, 64.0, "MB of readings kept; beyond it the oldest go", range=(0.1, 100_000)),
        MPSetting("spool_hours", float, 72.0, "h after which readings are dropped", range=(0.01, 100_000)),
    ]


class ModuleSettings:
    """The settings of the loaded module: validated, whichever way they come in."""

    def __init__(self, given: dict[str, Any] | None = None) -> None:
        """Take `given` settings; those of an INI file that it names as `config` yield to the others.

        Raises:
            SettingError: as `set` and `load`.
        """
        self.mp = MPSettings(table())
        given = dict(given or {})
        config = given.pop("config", None)
        if config is not None:
            self.load(Path(config).expanduser())
        for name, value in given.items():
            self.set(name, value)

    def load(self, file: Path) -> None:
        """Read an INI file: section [gradys] has the settings by their names, and [api] the station as gradys_gs.

        Other sections belong to others.

        Raises:
            SettingError: it cannot be read, or [gradys] has a key or a value that means nothing.
        """
        parser = configparser.ConfigParser(interpolation=None)
        try:
            with file.open(encoding="utf-8") as stream:
                parser.read_file(stream)
        except OSError as error:
            raise SettingError(f"{file}: {error.strerror}") from error
        except (configparser.Error, UnicodeDecodeError) as error:
            raise SettingError(f"{file}: {' '.join(str(error).split())}") from error
        station = parser.get("api", "gradys_gs", fallback="")
        if station not in UNSET:
            self.set("gs", station)
        if not parser.has_section(SECTION):
            return
        for name, value in parser[SECTION].items():
            if name not in self.mp.list():
                raise SettingError(f"{file}: no key {name!r} in [{SECTION}]")
            if value not in UNSET:
                self.set(name, value)

    def set(self, name: str, value: Any) -> None:
        """Set one.

        Raises:
            SettingError: unknown, of the wrong type, or out of range.
        """
        if name not in self.mp.list():
            near = difflib.get_close_matches(name, self.mp.list(), n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(self.mp.list())}"
            raise SettingError(f"no setting {name!r}; {hint}")
        if isinstance(value, str) and value in UNSET:
            value = ""
        check(name, value)
        if not self.mp.set(name, value):
            setting = self.mp.get_setting(name)
            limits = f" from {setting.range[0]:g} to {setting.range[1]:g}" if setting.range else ""
            raise SettingError(f"{name} = {value!r}: it takes a {setting.type.__name__}{limits}")

    def snapshot(self) -> Settings:
        """The settings as they are now."""
        values = {name: self.mp.get(name) for name in self.mp.list()}
        values["gs"] = tuple(stations(values["gs"]))
        values["sink"] = tuple(sink_addresses(values["sink"]))
        values["quantities"] = tuple(parse_quantities(values["quantities"]))
        values["ca_file"] = os.path.expanduser(values["ca_file"])
        values["spool"] = Path(values["spool"] or default_spool()).expanduser()
        return Settings(**values)

    def shown(self, name: str) -> str:
        """A setting's value as the prompt may show it: no passwords."""
        value = str(self.mp.get(name))
        if name == "token":
            return "(set)" if value else ""
        return ",".join(map(str, sink_addresses(value))) if name == "sink" else value


def check(name: str, value: Any) -> None:
    """Refuse a value that could not work.

    Raises:
        SettingError: with the reason.
    """
    text = str(value)
    if name == "gs":
        stations(text)
    elif name == "ip":
        check_ip(text)
    elif name == "sink":
        sink_addresses(text)
    elif name == "quantities":
        parse_quantities(text)
    elif name == "spool" and not text.isprintable():
        raise SettingError("spool: it takes a file's name in printable letters")
    elif name == "token" and not (text.isascii() and (text.isprintable() or not text)):
        raise SettingError("token: it takes printable ASCII")
    elif name == "ca_file" and text:
        try:
            tls_context(str(Path(text).expanduser()))
        except NotDelivered as error:
            raise SettingError(str(error)) from error
    elif text.strip().lower().lstrip("+-") in ("nan", "inf", "infinity") or (
        isinstance(value, float) and not math.isfinite(value)
    ):
        raise SettingError(f"{name} = {value!r}: it takes a finite number")
