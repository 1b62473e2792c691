"""Options -> the command lines of the processes, with their files and input lines (pure).

A token never appears here: the modules read it from the environment variable UAVAPI_TOKEN.
"""

from __future__ import annotations

import configparser
import io
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from mavproxy_uavapi.core.addresses import local_url_of
from mavproxy_uavapi.core.settings import DEFAULT
from mavproxy_uavapi.core.values import is_unset
from mavproxy_uavapi.launcher.fleet import SimulatedVehicle, kinds
from mavproxy_uavapi.launcher.options import RunOptions
from mavproxy_uavapi.launcher.values import one_word
from mavproxy_uavapi.settings import ApiModuleSettings

# With these variables run_in_terminal_window.sh puts the vehicle into a window, a tmux server or a screen that is not
# our child. Without them it runs in the background, where we can end it.
WINDOW_VARIABLES = ("DISPLAY", "SITL_RITW_TERMINAL", "TMUX", "STY", "ZELLIJ")
ARDUPILOT_VEHICLES = {"copter": "ArduCopter", "plane": "ArduPlane", "quadplane": "ArduPlane", "rover": "Rover"}
BINARIES = {"copter": "arducopter", "plane": "arduplane", "quadplane": "arduplane", "rover": "ardurover"}

# SITL opens its port only after it has read its parameters; MAVProxy tries once a second.
SITL_RETRIES = 30
DECKS = 9  # offset from a copter's TCP port of the UDP port on which it hears rovers


def mavproxy_command(
    options: RunOptions,
    program: Sequence[str],
    run_dir: Path,
    vehicles: Sequence[SimulatedVehicle],
    config: Path | None,
) -> list[str]:
    """MAVProxy's command line.

    Args:
        options: the user's options; `headless` already says whether there is a prompt.
        program: the command that starts MAVProxy.
        run_dir: the directory for its telemetry log and parameters.
        vehicles: the simulated vehicles; empty for a real one.
        config: the file with the API settings that have no keyword argument.
    """
    command = [
        *program,
        *(f"--master={link}" for link in masters(options, vehicles)),
        f"--target-system={options.sysid}",
        f"--logfile={run_dir / 'mav.tlog'}",
    ]
    if vehicles and options.ardupilot_path is not None:
        # As sim_vehicle.py does it: `rc` at the prompt reaches SITL on this port.
        command += [f"--retries={SITL_RETRIES}", f"--sitl=127.0.0.1:{5501 + 10 * vehicles[0].instance}"]
    if options.headless:
        # Without this MAVProxy quits when its stdin ends.
        command.append("--daemon")
    if options.mavlink_streamrate is not None:
        command.append(f"--streamrate={options.mavlink_streamrate}")
    command += [f"--out={address}" for address in options.gs_connection]
    command += [f"--cmd={load}" for load in module_loads(options, config)]
    return command + list(options.mavproxy_args)


def masters(options: RunOptions, vehicles: Sequence[SimulatedVehicle]) -> list[str]:
    """The links to the vehicles in MAVProxy's notation."""
    if vehicles:
        return [f"tcp:127.0.0.1:{base_port(vehicle)}" for vehicle in vehicles]
    if options.connection_type == "usb":
        return [options.uav_connection]
    return [f"{options.connection_type}:{options.uav_connection}"]


def base_port(vehicle: SimulatedVehicle) -> int:
    """The TCP port of a simulated vehicle, as SITL counts them."""
    return 5760 + 10 * vehicle.instance


def module_loads(options: RunOptions, config: Path | None) -> list[str]:
    """One `module load` command per module; keywords that the user gave for our modules (`--module NAME:{…}`) win."""
    settings: dict[str, object] = {"host": options.host, "port": options.port, "sysid": options.sysid}
    names = ApiModuleSettings.names()
    settings["origins"] = {
        **dict.fromkeys(settings, DEFAULT),
        **{name: origin for name, origin in options.origins.items() if name in names},
    }
    if config is not None:
        settings["config"] = str(config)
    if options.replay is not None:
        settings |= {"read_only": True, "flights": "off"}
    by_module = {"uavapi": settings, "gradys": gradys_keywords(options)}
    if options.vision_config is not None:
        by_module["vision"] = {"config": options.vision_config}
    others = []
    for module in options.module:
        name, _, keywords = module.partition(":")
        if by_module.get(name):
            by_module[name].update(json.loads(keywords or "{}"))
        else:
            others.append(f"module load {module}")
    return [module_load(name, keywords) for name, keywords in by_module.items() if keywords] + others


def gradys_keywords(options: RunOptions) -> dict[str, object]:
    """The settings with which the module `gradys` is loaded; empty if the user set none."""
    keywords: dict[str, object] = {}
    if options.gradys_config is not None:
        keywords["config"] = options.gradys_config
    if options.gradys_gs is not None:
        keywords["gs"] = options.gradys_gs
        if "gradys_gs" in options.origins:
            keywords["origins"] = {"gs": options.origins["gradys_gs"]}
    return keywords


def module_load(name: str, settings: Mapping[str, object]) -> str:
    """`module load NAME:{…}`, safe from MAVProxy's splitting."""
    return f"module load {name}:{one_word(settings)}"


def settings_file(options: RunOptions) -> str | None:
    """The INI text with the settings that the `uavapi` module takes only from a file; None if the user set none."""
    parser = configparser.ConfigParser(interpolation=None)
    for section, names in {
        "api": ("scripts_path", "python_path", "certfile", "keyfile"),
        "logs": ("log_console", "log_path", "debug", "script_logs"),
    }.items():
        texts = {name: _ini_text(getattr(options, name)) for name in names if getattr(options, name)}
        if section == "api":
            texts.update(options.further)
        if texts:
            parser[section] = texts
    if not parser.sections():
        return None
    text = io.StringIO()
    parser.write(text)
    return text.getvalue()


def _ini_text(value: str | tuple[str, ...]) -> str:
    return f"[{', '.join(value)}]" if isinstance(value, tuple) else value


def embedded_command(
    options: RunOptions, vehicle: SimulatedVehicle, others: Sequence[SimulatedVehicle] = ()
) -> list[str]:
    """The command line of the embedded vehicle among others, or of what plays a record in its place."""
    if options.replay is not None:
        port, speedup = f"--port={base_port(vehicle)}", f"--speedup={options.speedup:g}"
        return [sys.executable, "-m", "mavproxy_uavapi.flights.replay_feed", options.replay, port, speedup]
    return [
        sys.executable,
        "-m",
        "mavproxy_uavapi.sim",
        *([] if vehicle.kind == "copter" else [f"--vehicle={vehicle.kind}"]),
        f"--instance={vehicle.instance}",
        f"--sysid={vehicle.sysid}",
        f"--speedup={options.speedup:g}",
        f"--home={vehicle.home}",
        *([f"--battery={options.battery:g}"] if options.battery else []),
        *([f"--firmware={options.firmware}"] if options.firmware else []),
        *decks(vehicle, others),
        *options.vehicle_args,
    ]


def decks(vehicle: SimulatedVehicle, others: Sequence[SimulatedVehicle]) -> list[str]:
    """The options by which each copter stands on each rover on which it has landed."""
    if vehicle.kind == "rover":
        return [f"--udp=127.0.0.1:{base_port(one) + DECKS}" for one in others if one.kind == "copter"]
    copter_of_rovers = vehicle.kind == "copter" and any(one.kind == "rover" for one in others)
    return [f"--decks={base_port(vehicle) + DECKS}"] if copter_of_rovers else []


def sim_vehicle_command(options: RunOptions, python: str, vehicle: SimulatedVehicle, use_dir: Path) -> list[str]:
    """The command line of ArduPilot's sim_vehicle.py, for the vehicle alone.

    We start MAVProxy ourselves (`--no-mavproxy`): it keeps the terminal, and its arguments do not pass through
    sim_vehicle.py, which splits them at spaces and `=`.
    """
    assert options.ardupilot_path is not None
    return [
        python,
        str(sim_vehicle(options.ardupilot_path)),
        f"--vehicle={ARDUPILOT_VEHICLES[vehicle.kind]}",
        *(["--frame=quadplane"] if vehicle.kind == "quadplane" else []),
        f"--instance={vehicle.instance}",
        f"--sysid={vehicle.sysid}",
        f"--speedup={options.speedup:.0f}",
        f"--custom-location={vehicle.home}",
        f"--use-dir={use_dir}",
        "--no-rebuild",
        "--no-mavproxy",
    ]


def sim_vehicle(ardupilot_path: str) -> Path:
    """The path of the script in a copy of ArduPilot."""
    return Path(ardupilot_path, "Tools", "autotest", "sim_vehicle.py")


def sitl_binary(ardupilot_path: str, kind: str) -> Path:
    """The program that sim_vehicle.py starts for a type of vehicle."""
    return Path(ardupilot_path, "build", "sitl", "bin", BINARIES[kind])


def api_url(options: RunOptions) -> str:
    """The API's URL on this machine; keywords of the module may have the certificate, too."""
    settings = {"certfile": options.certfile or ""}
    for module in options.module:
        name, _, keywords = module.partition(":")
        if name == "uavapi":
            settings.update(json.loads(keywords or "{}"))
    return local_url_of(options.host, options.port, tls=not is_unset(str(settings["certfile"])))


def greeting(options: RunOptions, url: str, with_token: bool, elsewhere: Sequence[str] = ()) -> str:
    """The text printed when the API answers: where it and the page are, and three lines to try a simulated vehicle.

    Args:
        options: the user's options.
        url: of the API, on this machine.
        with_token: whether callers need one.
        elsewhere: the URLs by which other machines reach it.
    """
    pages = ", ".join(f"{one}/" for one in (url, *elsewhere))
    if options.replay is not None:
        return f"Replay of {options.replay}: {pages}\n  nothing there is live, and nothing can be commanded"
    count, page = len(kinds(options)), f"  the page to fly from: {pages}"
    if count > 1:
        last = options.sysid + count - 1
        return f"API of vehicles {options.sysid} to {last}: {url}\n{page}\n  curl {url}/vehicles"
    lines = [f"API of vehicle {options.sysid}: {url}", page]
    if options.simulated:
        curl = 'curl -H "Authorization: Bearer $UAVAPI_TOKEN"' if with_token else "curl"
        go = "set_mode?mode=HOLD" if options.vehicle == "rover" else "takeoff?alt=10"
        lines += [
            f"  {curl} {url}/command/arm",
            f"  {curl} '{url}/command/{go}'",
            f"  {curl} {url}/telemetry/gps",
        ]
    return "\n".join(lines)
