"""The command line of `mavproxy-uavapi run` -> one frozen `Order`."""

from __future__ import annotations

import argparse
import atexit
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import urlsplit

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.space import Space
from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.link import parameter_files
from mavproxy_uavapi.core.mission.mission_files import parts_of
from mavproxy_uavapi.launcher import values
from mavproxy_uavapi.launcher.errors import OptionError
from mavproxy_uavapi.rehearsal.faults import ALL, Fault, NoSuchFault, fault_of
from mavproxy_uavapi.rehearsal.filed_request import request_in
from mavproxy_uavapi.rehearsal.like import Likeness, likeness_of
from mavproxy_uavapi.rehearsal.rules import Limits

SCRIPTS = (".py", ".sh")
REPORTS = (".json", ".html", ".xml")
HTTP_PORT = 80
SPEEDUP = 10.0
LONGEST = 3600.0  # s on the vehicle's clock
RESERVE = 20.0  # %


@dataclass(frozen=True)
class Order:
    """What to fly, and how.

    Attributes:
        files: scripts, missions, tracks or requests, each of the vehicle of its number.
        args: the scripts' command-line arguments.
        runs: the faults of each flight.
        repeats: how often each of them is flown, with the next seed each time.
        vehicle: the type of the vehicles.
        count: how many there are, one for each file at least; their system ids begin at 1.
        location: where they start: a name, or lat,lon,alt,heading.
        wind: m/s, degrees from; empty for none.
        gps_noise: m, 1 sigma.
        seed: of all randomness in the vehicles.
        battery: mAh; 0 for one that never becomes empty.
        speedup: s of the vehicle in one s.
        parameters: a file of parameters for them, a NAME VALUE a line; None for none.
        mission: a file with the mission that they hold at the beginning; None for none.
        envelope: the file in force; None for none.
        limits: what is judged.
        longest: s on the vehicle's clock, after which the file is ended.
        reports: where to write what came of it; the suffix says how.
        python: the interpreter of the scripts.
        on_script_exit: what the API does when a script dies, as its setting of that name.
        looks_ahead: whether twins show where the vehicles would end without their link or their GPS.
        ardupilot: a copy of ArduPilot, whose SITL are the vehicles; None for embedded ones.
        mavlink_ports: where scripts expect MAVLink themselves, besides the usual ones.
        api_ports: of APIs on this machine in whose place scripts find the rehearsal's, besides the usual one.
        camera: settings of the module vision, before those of the environment.
    """

    files: tuple[Path, ...]
    args: tuple[str, ...] = ()
    runs: tuple[tuple[Fault, ...], ...] = ((),)
    repeats: int = 1
    vehicle: str = "copter"
    count: int = 1
    location: str = "AbraDF"
    wind: str = ""
    gps_noise: float = 0.0
    seed: int = 0
    battery: float = 0.0
    speedup: float = SPEEDUP
    parameters: Path | None = None
    mission: Path | None = None
    envelope: Path | None = None
    limits: Limits = Limits()
    longest: float = LONGEST
    reports: tuple[Path, ...] = ()
    python: str = sys.executable
    on_script_exit: str = "hold"
    looks_ahead: bool = True
    ardupilot: Path | None = None
    mavlink_ports: tuple[int, ...] = ()
    api_ports: tuple[int, ...] = ()
    camera: Mapping[str, Any] = field(default_factory=dict)


def is_script(file: Path) -> bool:
    """Whether it is a program; else it is a mission, a track or a request."""
    return file.suffix in SCRIPTS


class _OrderParser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise OptionError(message)


def _parser() -> argparse.ArgumentParser:
    parser = _OrderParser(
        prog="mavproxy-uavapi run",
        description="Fly a script or a mission on embedded vehicles first, with what may go wrong.",
        epilog="Status: 0 it went well, 1 the file failed, 2 a rule was broken, 3 it could not be flown. "
        "Everything after -- goes to the script.",
    )
    add = parser.add_argument
    add(
        "files",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="a .py or .sh script, also of aerpawlib, a mission (.plan, QGC WPL, JSON), a track (.track, .tuple), "
        "or a request as JSON (path, body, vision); of several files each is flown by a vehicle of its own",
    )
    add("--vehicle", choices=values.VEHICLES, default="copter", help="type of the vehicles (copter)")
    add("--vehicles", dest="count", type=int, default=0, metavar="N", help="how many there are (as many as files)")
    add("--location", default="", help="home: a name or lat,lon,alt,heading (the mission's, or AbraDF)")
    add("--wind", default="", metavar="SPEED,DIRECTION", help="m/s, degrees from")
    add("--gps-noise", type=float, default=0.0, metavar="METRES", help="1 sigma, slowly wandering")
    add("--seed", type=int, default=0, metavar="N", help="of all randomness in the vehicles (0)")
    add("--battery", type=float, default=0.0, metavar="MAH", help="its capacity; without it it never becomes empty")
    add("--reserve", type=float, default=RESERVE, metavar="PERCENT", help="left of the battery at the end (20)")
    add(
        "--speedup",
        type=float,
        default=SPEEDUP,
        metavar="X",
        help="times faster than real time, the script too (10)",
    )
    add(
        "--ardupilot-path",
        type=Path,
        metavar="DIR",
        help="fly on ArduPilot's SITL, built there, at --speedup as far as the machine can",
    )
    add(
        "--like",
        metavar="URL",
        help="of a vehicle's API: its type, home, parameters, mission, envelope, battery, wind, on_script_exit",
    )
    add("--parameters", type=Path, metavar="FILE", help="a list of parameters of the real vehicle")
    add("--envelope", type=Path, metavar="FILE", help="where it may fly: GeoJSON, KML, .plan")
    add("--separation", type=float, default=0.0, metavar="METRES", help="between any two vehicles in the air")
    add("--fault", action="append", default=[], metavar="NAME[=VALUE][@WHEN][:SECONDS]", help=FAULTS)
    add("--faults", choices=["all"], help="one more flight with each kind of fault")
    add("--runs", type=int, default=1, metavar="N", help="of each flight, with the next seed each time (1)")
    add("--timeout", type=float, default=LONGEST, metavar="SECONDS", help="of the vehicle's clock (3600)")
    add("--on-script-exit", choices=ON_SCRIPT_EXIT, default="hold", help="when a script dies in flight (hold)")
    add("--python", default=sys.executable, metavar="PROGRAM", help="the interpreter of the scripts (this one)")
    add("--mavlink-port", type=int, action="append", default=[], metavar="PORT", help=MAVLINK_PORT)
    add("--report", type=Path, action="append", default=[], metavar="FILE", help=".html, .json, or .xml (JUnit)")
    return parser


MAVLINK_PORT = "of a script that speaks MAVLink itself; repeatable (5760 to 5799, 14540 to 14599)"
ON_SCRIPT_EXIT = ("nothing", "hold", "land", "rtl")
FAULTS = (
    "gps_loss, gps_frozen, link_loss, radio_loss, low_battery, pilot_mode=LOITER, pilot_disarm, reboot, "
    "wind_gust=15, script_killed or companion_killed, at 20s, 15m, item2 or leg3; repeatable"
)


def order_of(argv: Sequence[str]) -> Order:
    """Read the arguments.

    Raises:
        OptionError: a wrong option, file or fault; its text is one line.
    """
    arguments = list(argv)
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    given = _parser().parse_args(arguments[:cut])
    folder = Path(tempfile.mkdtemp(prefix="uavapi-run-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    likeness = None if given.like is None else _take_likeness(given, folder)
    given.count = given.count or len(given.files)
    _check(given)
    try:
        faults = tuple(fault_of(text) for text in given.fault)
        more = [(*faults, fault_of(text)) for text in ALL] if given.faults else []
    except NoSuchFault as error:
        raise OptionError(f"--fault: {error}") from error
    reserve = given.reserve if given.battery else 0.0
    return Order(
        tuple(file.absolute() for file in given.files),
        tuple(arguments[cut + 1 :]),
        runs=(faults, *more),
        repeats=given.runs,
        vehicle=given.vehicle,
        count=given.count,
        location=given.location or _home_of(given.files) or Order.location,
        wind=given.wind,
        gps_noise=given.gps_noise,
        seed=given.seed,
        battery=given.battery,
        speedup=given.speedup,
        parameters=given.parameters and _readable(given.parameters, folder),
        mission=None if likeness is None else likeness.mission,
        envelope=given.envelope and given.envelope.absolute(),
        limits=Limits(_space(given.envelope), given.separation, reserve),
        longest=given.timeout,
        reports=tuple(given.report),
        python=given.python,
        on_script_exit=given.on_script_exit,
        looks_ahead=given.ardupilot_path is None,
        ardupilot=given.ardupilot_path and given.ardupilot_path.expanduser().absolute(),
        mavlink_ports=tuple(given.mavlink_port),
        api_ports=() if given.like is None else (urlsplit(given.like).port or HTTP_PORT,),
        camera={} if likeness is None else likeness.camera,
    )


def _home_of(files: Sequence[Path]) -> str:
    """Where the first mission that names its home was planned to begin; empty where none does."""
    for file in files:
        if not is_script(file) and request_in(file) is None:
            try:
                home = parts_of(file.read_text(encoding="utf-8", errors="replace")).home
            except UavApiError:  # the vehicle refuses it, too
                continue
            if home is not None:
                return "{:.7f},{:.7f},{:.2f},0".format(*home)
    return ""


def _check(given: argparse.Namespace) -> None:
    """Raise OptionError for a file that is missing, or a number or a report's name that cannot be used."""
    for file in (*given.files, given.parameters, given.envelope):
        if file is not None and not file.is_file():
            raise OptionError(f"there is no file {file}")
    for report in given.report:
        if report.suffix not in REPORTS:
            raise OptionError(f"--report: {report} ends in none of {', '.join(REPORTS)}")
    if given.runs < 1:
        raise OptionError("--runs is 1 or more")
    if not 0.25 <= given.speedup <= 100 or not len(given.files) <= given.count <= 50:
        raise OptionError("--speedup is from 0.25 to 100, --vehicles from the number of files to 50")


def _readable(file: Path, folder: Path) -> Path:
    """A list of parameters in any format as one with a NAME VALUE a line.

    Raises:
        OptionError: it is no list.
    """
    try:
        values = parameter_files.read(file.read_text(encoding="utf-8", errors="replace"), restore=True).values
    except UavApiError as error:
        raise OptionError(f"--parameters: {file}: {error}") from error
    target = folder / "defaults.param"
    target.write_text("".join(f"{name} {value:.9g}\n" for name, value in values.items()), encoding="utf-8")
    return target


def _take_likeness(given: argparse.Namespace, folder: Path) -> Likeness:
    """Take over what a real vehicle is, where nothing else was said.

    Raises:
        LaunchError: it does not answer.
    """
    likeness, usual = likeness_of(given.like, folder), _parser()
    for name in ("vehicle", "location", "parameters", "envelope", "battery", "wind", "on_script_exit"):
        if getattr(given, name) == usual.get_default(name):
            setattr(given, name, getattr(likeness, name))
    return likeness


def _space(file: Path | None) -> Space | None:
    try:
        return None if file is None else Space(formats.of_bytes(file.read_bytes(), str(file)))
    except UavApiError as error:
        raise OptionError(f"--envelope: {error}") from error
