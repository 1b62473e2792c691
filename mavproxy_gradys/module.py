"""The MAVProxy module `gradys`: commands, settings and hooks; a thin adapter, no logic."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from typing import Any

try:
    from mavproxy_gradys import console
    from mavproxy_gradys.http import GradysHandlers
    from mavproxy_gradys.service import Gradys
    from mavproxy_gradys.settings import GradysModuleSettings, GradysSettings
    from mavproxy_gradys.tracks.console import HELP as TRACK_HELP
    from mavproxy_gradys.tracks.console import TrackConsole
except ModuleNotFoundError as missing:  # MAVProxy prints the text of an ImportError as one line
    raise ImportError(f"gradys needs {missing.name}: pip install mavproxy-uavapi") from missing
from mavproxy_uavapi.core.module import SharedModule
from mavproxy_uavapi.core.terminal import say, say_text
from mavproxy_uavapi.core.timeout import wait_with_timeout

log = logging.getLogger("gradys.spool")
LONGEST_END = 3.0  # s that MAVProxy waits for the module's end
COMPLETIONS = [
    "<status|stats|start|stop|flush|config|help>",
    "track <record|fly> (FILENAME)",
    "track <stop|help>",
]
HELP = f"""\
gradys status            the ground stations, what was pushed, what became of it, and why nothing is pushed
gradys stats             the same counts, as a table
gradys start             push and sense (it does so by itself when the module is loaded)
gradys stop              end that; unsent readings stay in the spool
gradys flush             end all pauses after failures and try everything now
gradys set               show the settings
gradys set NAME VALUE    change one; it takes effect at once
gradys config            the settings in force, and where each came from
gradys set gs HOST:PORT  the ground station (several by comma)
gradys set sink URL      where readings go: http(s)://HOST/PATH or mqtt(s)://HOST/fleet/{{device}}/{{quantity}}
{TRACK_HELP}
gradys help              this"""


class GradysModule(SharedModule[GradysSettings]):
    """`module load gradys`."""

    def __init__(self, mpstate: Any, keywords: dict[str, Any]) -> None:
        actions: dict[str, Callable[[list[str]], None]] = {
            "status": lambda _: self._print_text(lambda: console.status(self.gradys.report())),
            "stats": lambda _: self._print_text(lambda: console.stats(self.gradys.report())),
            "start": lambda _: self._start(),
            "stop": lambda _: self._stop(),
            "flush": lambda _: self._flush(),
            "track": lambda args: self._track.command(args),  # noqa: PLW0108  it is made below
            "help": lambda _: say_text(HELP),
        }
        super().__init__(
            mpstate,
            keywords,
            GradysModuleSettings,
            "GrADyS ground station push",
            actions=actions,
            completions=COMPLETIONS,
        )
        self.gradys = Gradys(self.host)
        self._lost = ""  # what was still unwritten at the end
        self._track = TrackConsole(self.host, self.gradys.tracks, self._background)
        self.host.commands["fly"] = self._fly  # `uavapi fly FILE`
        self.finish_loading(GradysHandlers(self.gradys).routes())

    def begin(self) -> None:
        """Push and sense."""
        self._start()

    async def end(self) -> None:
        """Stop pushing and sensing."""
        await self.gradys.tracks.close()
        try:
            with contextlib.suppress(asyncio.TimeoutError):  # the spool is closed in its own thread
                await wait_with_timeout(LONGEST_END, self.gradys.close())
        finally:
            self._lost = self.gradys.pipeline.lost
            if self._lost:
                log.warning("%s", self._lost)
        await self._background.close()

    def unload(self) -> None:
        """Release our own resources, then the shared ones; print what is lost."""
        if self.host.commands.get("fly") == self._fly:  # not its successor's
            del self.host.commands["fly"]
        try:
            super().unload()
        finally:
            if self._lost:
                say(f"gradys: {self._lost}")

    def command(self, args: list[str]) -> None:
        """The module's command at the prompt; most commands need the asyncio thread."""
        if self._begun or args[:1] in (["set"], ["config"], ["help"]):
            super().command(args)
        else:
            say("gradys: MAVProxy is still starting")

    def _start(self) -> None:
        settings = self.module_settings.snapshot()

        async def start() -> str:
            await self.gradys.start(settings)
            return push_summary(settings)

        self._background.send(start, "starting")

    def _stop(self) -> None:
        async def stop() -> str:
            await self.gradys.stop()
            return "stopped"

        self._background.send(stop, "stopping")

    def _flush(self) -> None:
        self.host.bridge.call_soon(self.gradys.flush)
        say("gradys: everything is tried now; `gradys status` shows the result")

    def _fly(self, args: list[str]) -> None:
        self.command(["track", "fly", *args])

    def use_settings(self, name: str, before: GradysSettings, after: GradysSettings) -> None:
        """Push and sense with the new settings."""

        async def restart() -> str:
            return push_summary(after) if await self.gradys.restart(after) else ""

        self._background.send(restart, "taking up the setting")


def push_summary(settings: GradysSettings) -> str:
    """A line with the stations that get positions."""
    urls = ", ".join(station.url for station in settings.gs)
    return f"pushing to {urls}" if urls else "no ground station is set; `gradys set gs HOST:PORT`"


def init(mpstate: Any, **kwargs: Any) -> GradysModule:
    """MAVProxy calls this on `module load gradys`, or `gradys:{"gs":"10.0.0.5:8000"}`.

    Raises:
        ImportError: as `SharedModule`.
    """
    return GradysModule(mpstate, kwargs)
