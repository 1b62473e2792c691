"""The settings of the module `uavapi`, and the sections of the INI file that it reads."""

from __future__ import annotations

import ipaddress
import re
import sys
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from typing import Any

from mavproxy_uavapi.core.addresses import is_loopback, local_url_of, url_of
from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.ini_file import IniFile
from mavproxy_uavapi.core.logs import components
from mavproxy_uavapi.core.settings import DEFAULT, ModuleSettings, setting
from mavproxy_uavapi.core.state_directory import state_directory
from mavproxy_uavapi.core.values import is_unset, words
from mavproxy_uavapi.files import tile_store, tokens

Network = ipaddress.IPv4Network | ipaddress.IPv6Network

# The sections of the original service and the launcher. A key may stand in any of them, as there.
SECTIONS = ("api", "mode", "udp", "simulated", "logs")
# Keys in them that are not settings of the module, with the reason; each is reported in a line.
_LAUNCHERS = (
    *("simulated", "count", "vehicles", "spacing", "ardupilot_path", "location", "speedup", "battery", "firmware"),
    *("replay", "headless", "mavlink_streamrate", "root_dir", "terminal"),
)
NOT_OURS: dict[str, str] = {
    "uav_connection": "MAVProxy has the link (--master)",
    "connection_type": "MAVProxy has the link (--master)",
    "gradys_gs": "the module gradys reads it from here (`module load gradys`, with this file as its config)",
    "vehicle": "the vehicle's heartbeat gives its type",
    "udp": "there is no HTTP/3",
    "gs_connection": "MAVProxy forwards to ground stations (--out)",
    **dict.fromkeys(_LAUNCHERS, "`mavproxy-uavapi --config` starts simulated vehicles"),
}
# Settings for which an API must listen again: its address, its vehicle, and the access.
ACCESS = ("token", "tokens", "allow_from", "allow_scripts_from", "allow_open", "cors_origins", "names")
LISTENING = ("host", "port", "sysid", "ports", "certfile", "keyfile", *ACCESS)
# What a caller of the API may set. Everything else is set at the prompt only: who may call and what callers may do,
# limits that hold for callers, folders, files and programs, where vehicles may fly, and what the prompt shows.
# A new setting is the prompt's unless it is named here.
SETTABLE = frozenset(
    (
        "link_timeout",
        "max_age",
        "on_disconnect",
        "on_lease_end",
        "on_conflict",
        "on_script_exit",
        "script_grace",
        "debug",
    )
)
OFF = "off"  # in place of a folder
ON_SCRIPT_EXIT = ("nothing", "hold", "land", "rtl")


@dataclass(frozen=True)
class ApiSettings:
    """A snapshot of the settings, each with its row of the table: what it means, and in which unit.

    Texts, files and folders are empty for none.
    """

    local_rate: float  # as `max_rate`, on the loopback: no limit (0) unless that was set
    host: str = setting(str, "127.0.0.1", "address to listen on", tab="API")
    port: int = setting(int, 8000, "TCP port to listen on", range=(1, 65535), increment=1)
    sysid: int = setting(int, 0, "vehicle to fly; 0 is MAVProxy's current one", range=(0, 255), increment=1)
    ports: Mapping[int, int] = setting(str, "", "further ports, a vehicle at each: 8001:1,8002:2")
    link_timeout: float = setting(float, 5.0, "s without heartbeat until the link is lost", range=(1, 60))
    max_age: float = setting(float, 5.0, "s after which telemetry is stale", range=(0.1, 3600))
    on_disconnect: str = setting(
        str, "continue", "action when the client of a waiting call disconnects", choice=["continue", "hold"]
    )
    on_lease_end: str = setting(str, "hold", "when a client's lease ends", choice=["hold", "land", "rtl"])
    envelope: str = setting(str, "", "where vehicles may fly: a file, or `vehicle`")
    separation: float = setting(float, 0.0, "m that vehicles keep from each other; 0: none", range=(0, 1000))
    on_conflict: str = setting(
        str, "refuse", "action for a command that comes too near another vehicle", choice=["refuse", "wait"]
    )
    allow_from: tuple[Network, ...] = setting(str, "", "networks that may call without a token", tab="Access")
    allow_scripts_from: tuple[Network, ...] = setting(str, "", "networks among these that may run scripts, too")
    allow_open: bool = setting(bool, False, "let everybody call without a token")
    read_only: bool = setting(bool, False, "let callers watch only; the prompt goes on as ever")
    allow_raw: bool = setting(bool, False, "let callers send any MAVLink message (/message)")
    cors_origins: tuple[str, ...] = setting(str, "", "origins of web pages that may call")
    names: tuple[str, ...] = setting(str, "", "names of this machine that callers use, such as raspberrypi.lan")
    certfile: str = setting(str, "", "TLS certificate (PEM)")
    keyfile: str = setting(str, "", "TLS key (PEM)")
    max_jobs: int = setting(int, 64, "verbs in flight at once for one vehicle", range=(1, 10000), tab="Limits")
    max_connections: int = setting(int, 200, "connections open at once", range=(32, 900))
    max_rate: float = setting(float, 500.0, "requests/s of one caller", range=(1, 100000))
    log_console: frozenset[str] = setting(str, "", "components that log to the console", tab="Logs")  # COPTER, API …
    log_path: str = setting(str, "", "log file, or its folder")
    debug: frozenset[str] = setting(str, "", "components that log in detail")
    vehicle_logs: str = setting(str, "~/uav_logs", "folder of downloaded vehicle logs")
    # Empty for `off`.
    flights: str = setting(str, str(state_directory() / "flights"), "folder of recorded flights; off: none")
    flights_quota: int = setting(int, 5000, "MB of all flights; the oldest go", range=(1, 10_000_000))
    tiles: str = setting(str, "", "map of the page: an MBTiles file or a folder z/x/y.png")
    tile_source: str = setting(str, "", "where the page's browser fetches tiles: https://…/{z}/{x}/{y}.png")
    tile_licence: str = setting(str, "", "whose they are; the page shows it")
    scripts_path: str = setting(str, "~/uav_scripts", "folder of the uploaded scripts", tab="Scripts")
    script_logs: str = setting(str, "~/uav_scripts/logs", "folder of their logs")
    python_path: str = setting(str, sys.executable, "what runs .py scripts")
    script_grace: float = setting(float, 10.0, "s from Ctrl-C to the kill", range=(0, 3600))
    script_size: int = setting(int, 1024, "kB of one script", range=(1, 100000))
    script_quota: int = setting(int, 50, "MB of all scripts", range=(1, 100000))
    on_script_exit: str = setting(str, "hold", "when a script dies in flight", choice=list(ON_SCRIPT_EXIT))
    rehearse: str = setting(
        str,
        "off",
        "scripts, missions, tracks and vision's missions that were not rehearsed: fly, are warned of, or refused",
        choice=["off", "warn", "require"],
    )
    token: str = setting(str, "", "what clients must send as a bearer token", tab="Access")
    tokens: str = setting(str, "", "a file with the tokens of operators, a role each")

    @property
    def url(self) -> str:
        """The API's own address."""
        return url_of(self.host, self.port, tls=bool(self.certfile))

    @property
    def local_url(self) -> str:
        """The API's URL on this machine."""
        return local_url_of(self.host, self.port, tls=bool(self.certfile))

    @property
    def listening(self) -> Mapping[int, int]:
        """All TCP ports with the system id of the vehicle at the root of each; 0 for that of `sysid`."""
        return {self.port: 0, **self.ports}

    @property
    def is_local(self) -> bool:
        """Whether only this machine can call."""
        return is_loopback(self.host)

    def listens_as(self, other: ApiSettings) -> bool:
        """Whether a running API with the settings `other` can change to these without listening again."""
        return all(getattr(self, name) == getattr(other, name) for name in LISTENING)

    def check(self) -> None:
        """Refuse combinations that let everybody fly the vehicle, or that cannot work.

        Raises:
            SettingError: with the reason.
        """
        if not self.is_local and not (self.token or self.tokens or self.allow_from or self.allow_open):
            raise SettingError(
                f"host = {self.host}: everybody on that network could fly the vehicle; set a token or tokens, or "
                "name the networks that may call without one (allow_from), or set allow_open on purpose",
                "host",
            )
        if bool(self.certfile) != bool(self.keyfile):
            raise SettingError("TLS needs both certfile and keyfile")


def address(text: str) -> str:
    """The text, if it is an address to listen on.

    Raises:
        SettingError: it is the name of another host, or not a name.
    """
    if text != "localhost":
        try:
            ipaddress.ip_address(text)
        except ValueError as error:
            raise SettingError(f"{text!r} is not an IP address") from error
    return text


def ports(text: str) -> Mapping[int, int]:
    """`8001:1,8002:2` -> {8001: 1, 8002: 2}: TCP ports, and the system id of the vehicle at each.

    Raises:
        SettingError: the text has another form, or a number is out of range.
    """
    systems: dict[int, int] = {}
    for word in words(text):
        port, _, system = word.partition(":")
        if not (port.isdecimal() and system.isdecimal() and 0 < int(port) < 65536 and 0 < int(system) < 256):
            raise SettingError(f"{word!r} is not a port and system id such as 8001:2")
        if int(port) in systems:
            raise SettingError(f"port {port} is named twice")
        systems[int(port)] = int(system)
    return systems


def networks(text: str) -> tuple[Network, ...]:
    """The networks in a list.

    Raises:
        SettingError: a word is not a network.
    """
    return tuple(network(word) for word in words(text))


def network(text: str) -> Network:
    """A network, or one address.

    Raises:
        SettingError: it is neither of them.
    """
    try:
        return ipaddress.ip_network(text, strict=False)
    except ValueError as error:
        raise SettingError(f"{text!r} is not a network such as 192.168.1.0/24") from error


def host_names(text: str) -> tuple[str, ...]:
    """The host names in a list.

    Raises:
        SettingError: a word is not a name such as raspberrypi.lan.
    """
    names = words(text)
    for name in names:
        if not re.fullmatch(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*", name):
            raise SettingError(f"{name!r} is not a host name such as raspberrypi.lan, without a port")
    return names


def log_components(text: str) -> frozenset[str]:
    """The log components in a list.

    Raises:
        SettingError: a name is not a component.
    """
    try:
        return frozenset(components(text))
    except ValueError as error:
        raise SettingError(str(error)) from error


class ApiModuleSettings(ModuleSettings[ApiSettings]):
    """The settings of the loaded module; they stand in the original service's sections of an INI file."""

    module, snapshot_class = "uavapi", ApiSettings
    secrets = frozenset({"token"})
    parsers = {
        "host": address,
        "tokens": lambda text: "" if is_unset(text) else text,
        "flights": lambda text: "" if text == OFF else text,
        "ports": ports,
        "allow_from": networks,
        "allow_scripts_from": networks,
        "cors_origins": words,
        "names": host_names,
        "log_console": log_components,
        "debug": log_components,
    }

    def make(self, values: Mapping[str, Any], origins: Mapping[str, str]) -> ApiSettings:
        """The snapshot; a rate that the user sets also applies to this machine."""
        is_set = origins.get("max_rate", DEFAULT) != DEFAULT
        return ApiSettings(**values, local_rate=values["max_rate"] if is_set else 0.0)

    def check(self, settings: ApiSettings, changed: Set[str]) -> None:
        """As `ApiSettings.check`; a file that is named must be readable."""
        settings.check()
        if "envelope" in changed:
            from mavproxy_uavapi.files import envelope_file  # noqa: PLC0415  the launcher starts in half the time

            envelope_file.check(settings.envelope)
        if "tiles" in changed:
            tile_store.check(settings.tiles)
        tile_store.origin_of(settings.tile_source)
        if "tokens" in changed:
            tokens.check(settings.tokens)

    def settings_in(self, ini: IniFile) -> Iterator[tuple[str, str]]:
        """The settings among the keys of the original service's sections; a note reports each other key.

        Raises:
            SettingError: a key is unknown.
        """
        names = self.names()
        for section in SECTIONS:
            for key, text in ini.section(section).items():
                if key in names:
                    yield key, text
                elif key not in NOT_OURS:
                    raise ini.no_key(section, key, [*names, *NOT_OURS])
                elif not is_unset(text):
                    self.notes.append(f"{ini.file}: {key} is ignored here, {NOT_OURS[key]}")
