"""The MAVProxy module `vision`: commands and hooks; a thin adapter, no logic."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mavproxy_vision import opencv_install

if (_problem := opencv_install.problem()) is not None:
    raise ImportError(_problem)  # MAVProxy prints the text of an ImportError as one line

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import SettingError, UavApiError
from mavproxy_uavapi.core.module import SharedModule
from mavproxy_uavapi.core.terminal import say, say_text
from mavproxy_uavapi.core.vehicle.copter import Copter
from mavproxy_uavapi.core.windows import View
from mavproxy_vision import console, file_commands, flight_commands
from mavproxy_vision.http import VisionHandlers
from mavproxy_vision.landing.flight_jobs import FlightJobs, FlightTask
from mavproxy_vision.settings import VisionModuleSettings, VisionSettings
from mavproxy_vision.tracking.tracker import Tracker
from mavproxy_vision.window_view import TagView

COMPLETIONS = [
    "<status|start|stop|config|tags|land|search|mission|abort|help>",
    "<calibrate|snapshot|tag> (FILENAME)",
]
RESTARTS = {  # settings that need the camera to be opened again
    "source", "family", "tags", "any_id", "far", "calibration", "fov", "width", "height", "fps", "exposure", "gain",
    "brightness", "latency", "mount", "offset", "gimbal", "threads", "vehicle",
}  # fmt: skip


class VisionModule(SharedModule[VisionSettings]):
    """`module load vision`."""

    def __init__(self, mpstate: Any, keywords: dict[str, Any]) -> None:
        actions: dict[str, Callable[[list[str]], None]] = {
            "status": lambda _: self._print_text(lambda: console.report(self.tracker, self.flights)),
            "start": lambda _: self._start(),
            "stop": lambda _: self._stop(),
            "tags": lambda _: self._print_text(lambda: console.tags(self.tracker)),
            "land": self._land,
            "search": self._search,
            "mission": self._mission,
            "abort": lambda _: self._abort(),
            "calibrate": lambda args: self._with_files(lambda: file_commands.calibrated(args)),
            "snapshot": self._snapshot,
            "tag": self._tag,
            "help": lambda _: say_text(console.HELP),
        }
        super().__init__(
            mpstate,
            keywords,
            VisionModuleSettings,
            "AprilTags, search and precise landing",
            actions=actions,
            completions=COMPLETIONS,
        )
        self.tracker = Tracker(self.host, self.module_settings.snapshot())
        self.flights = FlightJobs(self.tracker, self._directory)
        self._tag_view = TagView(self.tracker)
        self._handlers = VisionHandlers(self.tracker, self.flights)
        self.finish_loading(self._handlers.routes())

    # -- life ------------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Listen, and open the camera if one is set."""
        self.host.newest_frame = self._handlers.newest_frame
        self.host.bridge.call_soon(self.tracker.carrier.listen)
        if self.module_settings.snapshot().source:
            self._start()

    def view(self) -> View:
        """Where the tags lie."""
        return self._tag_view()

    async def end(self) -> None:
        """Close everything."""
        await self.tracker.close()
        await self._background.close()

    def unload(self) -> None:
        """Make the vehicle hold, then release everything."""
        self.host.newest_frame = None
        try:
            self._abort_all()
        finally:
            super().unload()

    def _abort_all(self) -> None:
        """End what is in flight."""

        async def abandoned() -> None:
            self.flights.abort_all()

        if self.host.bridge.running:
            self.host.bridge.run(abandoned())
        else:  # there is no asyncio thread yet, so nothing flies
            self.flights.abort_all()

    def _directory(self) -> Path:
        """The directory for files."""
        chosen = self.module_settings.snapshot().directory
        if chosen:
            return Path(chosen).expanduser()
        return Path(getattr(self.mpstate.status, "logdir", None) or ".")

    # -- helpers ---------------------------------------------------------------------------------------------

    def _awake(self) -> bool:
        """Whether MAVProxy's main loop has run; prints a line if it has not."""
        if not self._begun:
            say("vision: it begins once MAVProxy's main loop runs")
        return self._begun

    def _run(self, coroutine: Any) -> Any:
        return self.host.bridge.run(coroutine)

    def _start(self) -> None:
        settings = self.module_settings.snapshot()

        async def started() -> str:
            await self.tracker.start(settings)
            return f"looking for {settings.family} through {settings.shown_source}"

        if self._awake():
            self._background.send(started, "opening the camera")

    def _stop(self) -> None:
        async def stopped() -> str:
            await self.tracker.stop()
            return "stopped"

        if self._awake():
            self._abort(quiet=True)
            self._background.send(stopped, "closing the camera")

    def _abort(self, quiet: bool = False) -> None:
        async def stopped() -> str | None:
            return self.flights.stop("it was stopped at the prompt")

        if self._awake() and not self._run(stopped()) and not quiet:
            say("vision: nothing is in flight")

    def check_change(self, name: str) -> None:
        """Refuse changes in flight that need the camera to be opened again.

        Raises:
            SettingError: something is in flight.
        """
        if reopens_camera(name) and self._flying():
            raise SettingError(f"{name} is not changed in flight (`vision abort` ends it)", name)

    def use_settings(self, name: str, before: VisionSettings, after: VisionSettings) -> None:
        """Open the camera again, close it, or go on with the new settings."""
        if reopens_camera(name) and after.source:
            self._start()
            return
        if before.source and not after.source:
            self._stop()
        self.host.bridge.call_soon(setattr, self.tracker, "settings", after)

    def _flying(self) -> bool:
        async def flying() -> bool:
            return self.flights.running

        return self._begun and bool(self._run(flying()))

    # -- flying ----------------------------------------------------------------------------------------------

    def _land(self, args: list[str]) -> None:
        method, landing = self.module_settings.snapshot().method, self.flights.landing
        parse = functools.partial(flight_commands.land, args, method)
        self._fly("/vision/land", parse, lambda copter, given: landing(copter, given["id"], given["method"]))

    def _search(self, args: list[str]) -> None:
        parse, searching = functools.partial(flight_commands.search, args), self.flights.searching
        self._fly("/vision/search", parse, lambda copter, given: searching(copter, given["id"], None))

    def _mission(self, args: list[str]) -> None:
        parse = functools.partial(flight_commands.mission, args, self.module_settings.snapshot().method)
        mission = self.flights.mission
        self._fly("/vision/mission", parse, lambda copter, given: mission(copter, flight_commands.plan(given)))

    def _fly(
        self, path: str, parse: Callable[[], dict[str, Any]], make: Callable[[Copter, dict[str, Any]], FlightTask]
    ) -> None:
        """Begin a flight and print that; print its end when it comes."""

        async def begin(request: dict[str, Any]) -> Job:
            copter = self.flights.copter()
            return self.flights.begin(copter, make(copter, request), path, request, self._background.say)

        try:
            request = parse()
            if not self._awake():
                return
            job = self._run(begin(request))
        except UavApiError as error:
            say(f"vision: {error}")
        else:
            say(f"vision: {path.rpartition('/')[2]} begins (job {job.id}); `vision abort` ends it")

    # -- files -----------------------------------------------------------------------------------------------

    def _snapshot(self, args: list[str]) -> None:
        self._with_files(lambda: file_commands.snapshot(args, self.tracker.result, self.tracker.image))

    def _tag(self, args: list[str]) -> None:
        settings = self.module_settings.snapshot()
        self._with_files(lambda: file_commands.tag(args, settings.families[0], settings.tag_list[0]))

    def _with_files(self, work: Callable[[], str]) -> None:
        self._background.send(lambda: asyncio.to_thread(file_commands.outcome, work))


def reopens_camera(name: str) -> bool:
    """Whether a change of that setting needs the camera to be opened again."""
    return name in RESTARTS or name.startswith("sim_")


def init(mpstate: Any, **kwargs: Any) -> VisionModule:
    """MAVProxy calls this on `module load vision`, or `vision:{"source":"sim"}`.

    Raises:
        ImportError: as `SharedModule`.
    """
    module = VisionModule(mpstate, kwargs)
    if (overlap := opencv_install.overlap()) is not None:
        say(f"vision: {overlap}")
    return module
