"""`gradys track …` at the prompt: its arguments and its output. Pure, except for `TrackConsole`."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Callable, Coroutine, Mapping
from pathlib import Path
from typing import Any, NoReturn

from mavproxy_gradys.tracks.flight import (
    HIGHEST_TAKEOFF,
    LARGEST_REACH,
    LOWEST_TRANSIT,
    REACH,
    TRANSIT,
    VERB,
    flight_of,
)
from mavproxy_gradys.tracks.formats import FORMATS, GROUND, TrackWaypoint, style_of, waypoints_of
from mavproxy_gradys.tracks.service import Tracking
from mavproxy_uavapi.core.background import BackgroundCommands
from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.core.file_text import read_text
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.terminal import say, say_text
from mavproxy_uavapi.core.text import joined

LARGEST = 64 * 1024 * 1024  # bytes of a track
HELP = """\
gradys track                            the recording and the track flights
gradys track record FILE [SECONDS=5] [--format text|tuple|gpx] [--latest FILE] [--sysid N]
gradys track stop                       end the recording
gradys track fly FILE [--ground M] [--reach M] [--transit M] [--sysid N]
                                        take off, fly through the track, return and land"""


class ArgumentParser(argparse.ArgumentParser):
    """A parser that neither prints nor ends the program."""

    def error(self, message: str) -> NoReturn:
        """Raise BadRequest."""
        raise BadRequest(f"{message}; `gradys track help` has the commands")


def between(low: float, high: float) -> Callable[[str], float]:
    """A function that parses a number of an option and checks its range."""

    def number(text: str) -> float:
        if not low <= float(text) <= high:
            raise argparse.ArgumentTypeError(f"{text} is not from {low:g} to {high:g}")
        return float(text)

    return number


def argument_parser() -> argparse.ArgumentParser:
    """The parser of the arguments of `gradys track`."""
    parser = ArgumentParser(prog="gradys track", add_help=False)
    verbs = parser.add_subparsers(dest="verb", parser_class=ArgumentParser)
    record = verbs.add_parser("record", add_help=False)
    record.add_argument("file", type=Path)
    record.add_argument("seconds", type=float, nargs="?", default=5.0)
    record.add_argument("--format", choices=FORMATS)
    record.add_argument("--latest", type=Path)
    record.add_argument("--sysid", type=int, default=0)
    verbs.add_parser("stop", add_help=False)
    fly = verbs.add_parser("fly", add_help=False)
    fly.add_argument("file", type=Path)
    fly.add_argument("--ground", type=between(*GROUND))
    fly.add_argument("--reach", type=between(1.0, LARGEST_REACH), default=REACH)
    fly.add_argument("--transit", type=between(LOWEST_TRANSIT, HIGHEST_TAKEOFF), default=TRANSIT)
    fly.add_argument("--sysid", type=int, default=0)
    verbs.add_parser("help", add_help=False)
    return parser


class TrackConsole:
    """The command. MAVProxy does not wait for it: its result is printed later.

    Args:
        host: the vehicles, and access to the main loop.
        tracks: the recording and the flights.
        background: runs the commands; its owner ends them.
    """

    def __init__(self, host: Host, tracks: Tracking, background: BackgroundCommands) -> None:
        self._host = host
        self._tracks = tracks
        self._background = background

    def command(self, args: list[str]) -> None:
        """Run the typed command. Main loop only."""
        try:
            options = argument_parser().parse_args(args)
            if options.verb == "record" and not 0.1 <= options.seconds <= 86400:
                raise BadRequest("SECONDS are from 0.1 to 86400")
        except BadRequest as error:
            say(f"gradys: {error}")
            return
        if options.verb == "help":
            say_text(HELP)
            return
        verbs: dict[str | None, Callable[[argparse.Namespace], Coroutine[Any, Any, str]]] = {
            None: self._show,
            "record": self._record,
            "stop": self._stop,
            "fly": self._fly,
        }
        self._background.send(lambda: verbs[options.verb](options))

    async def _show(self, _options: argparse.Namespace) -> str:
        return report_text(self._tracks.report())

    async def _record(self, options: argparse.Namespace) -> str:
        file = options.file.expanduser()
        latest = None if options.latest is None else options.latest.expanduser()
        style = options.format or style_of(file.name)
        recorder = await self._tracks.record(
            file, style=style, period=options.seconds, latest=latest, system=options.sysid
        )
        return f"recording vehicle {recorder.system} every {options.seconds:g} s into {file} ({style})"

    async def _stop(self, _options: argparse.Namespace) -> str:
        recorder = await self._tracks.stop_recording()
        return "nothing is recorded" if recorder is None else f"{recorder.written} readings are in {recorder.file}"

    async def _fly(self, options: argparse.Namespace) -> str:
        vehicle = self._host.registry.commandable(options.sysid)
        places = await asyncio.to_thread(read, options.file.expanduser(), options.ground)
        flight = flight_of(vehicle, places, options.reach, options.transit)
        request = {**{name: str(value) for name, value in vars(options).items()}, "digest": hash(tuple(places))}
        job = self._host.jobs.begin(vehicle, VERB, request, lambda job: self._tracks.fly(flight, job))
        self._background.say(
            f"flying {len(places)} legs with vehicle {vehicle.state.system}; `gradys track` shows the progress"
        )
        return await job.outcome()


def read(file: Path, ground: float | None) -> list[TrackWaypoint]:
    """The waypoints of the track in a file.

    Raises:
        BadRequest: the file cannot be read.
        Invalid: as `waypoints_of`.
    """
    return waypoints_of(read_text(file, LARGEST), ground)


def report_text(report: Mapping[str, Any]) -> str:
    """The recording and the flights in a few lines."""
    recording = report["recording"]
    lines = []
    if recording is not None:
        latest = f", the latest in {recording['latest']}" if recording["latest"] else ""
        lines.append(
            f"recording vehicle {recording['vehicle']} into {recording['file']}: {recording['written']}{latest}"
        )
        if recording["problem"]:
            lines.append(f"  {recording['problem']}")
    for flight in report["flights"]:
        to_go = f", {flight['distance_to_go']:.0f} m to go" if "distance_to_go" in flight else ""
        progress = flight["error"] or f"{flight['stage']}, leg {flight['leg']} of {flight['legs']}{to_go}"
        lines.append(f"track flight {flight['state']}, vehicle {flight['vehicle']}: {progress}")
    return joined(lines) or "no track is recorded or flown"
