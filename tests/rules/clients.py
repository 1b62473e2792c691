"""Who asks for a flight and does not await it over HTTP: the pilot at MAVProxy's prompt, and a script.

As a `Wire` has, each has a `reply`, which comes when the flight is over, and may `hang_up`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mavproxy_gradys.tracks.console import TrackConsole
from mavproxy_uavapi.core.background import BackgroundCommands
from mavproxy_uavapi.core.control.jobs import CONSOLE, Job
from mavproxy_uavapi.http.contract.reports import error_of
from mavproxy_uavapi.scripts import on_exit
from tests.support.world import World

LOOK_EVERY = 0.02  # s
PORT = 50001  # of a script's connections
SESSION = "UAV_API_1_mission"


class Typed:
    """A flight that was begun at MAVProxy's prompt.

    Attributes:
        reply: the job's outcome as an answer, once the prompt has printed the very same sentence.

    Args:
        world: where.
        module: its name, which is at the head of what it prints.
        begin: begins the flight.
    """

    def __init__(self, world: World, module: str, begin: Callable[[], object]) -> None:
        self._world, self._module = world, module
        self.reply = world.loop.create_task(self._printed())
        world.loop.call_soon(begin)

    async def _printed(self) -> Any:
        lines: list[str] = []
        while True:
            await asyncio.sleep(LOOK_EVERY)
            lines += self._world.screen().splitlines()
            job = next((job for job in self._world.host.jobs.all() if job.client == CONSOLE), None)
            if job is not None and not job.running and f"{self._module}: {job.error or job.result}" in lines:
                error = None if job.error is None else error_of(job)
                return self._world.reported(error["status"] if error else 200, error or {"result": job.result})


def fly_track(world: World, request: dict[str, Any]) -> Typed:
    """`uavapi fly FILE --ground M`, which is `gradys track fly`."""
    file: Path = world.directory / "track.txt"
    file.write_text(request["track"])
    words = ["fly", str(file), "--ground", str(request["ground"])]
    console = TrackConsole(world.host, world.gradys.tracks, BackgroundCommands(world.host, "gradys"))
    return Typed(world, "gradys", lambda: console.command(words))


def vision_land(world: World, _request: dict[str, Any]) -> Typed:
    """`vision land`, from where the module hands it to the asyncio thread."""
    say = BackgroundCommands(world.host, "vision").say

    def begin() -> None:
        copter, request = world.vision.copter(), {"id": None, "method": "velocity"}
        world.vision.begin(copter, world.vision.landing(copter, *request.values()), "/vision/land", request, say)

    return Typed(world, "vision", begin)


class Script:
    """A script that begins a job and looks later what has become of it; whose connection it is, is known.

    Attributes:
        reply: what it is told.
        death: what is done when it has died.

    Args:
        world: where.
        ask: the request's arguments, for `World.request`.
        waits: whether it awaits the verb's answer instead.
    """

    def __init__(self, world: World, *ask: Any, waits: bool = False) -> None:
        self._world = world
        self._connections: list[Any] = []
        self.death: asyncio.Task[str] | None = None
        world.service.scripts.session_of = self._session_of
        self.reply = world.loop.create_task(self._reported(*ask, waits=waits))
        world.loop.settle()

    @staticmethod
    async def _session_of(peer: tuple[str, int] | None) -> str | None:
        return SESSION if peer is not None and peer[1] == PORT else None

    async def _reported(self, method: str, path: str, *body: Any, waits: bool) -> Any:
        answer = await self._requested(method, path if waits else f"{path}?wait=false", *body)
        if answer is None or answer.status != 202:
            return answer
        job: Job = self._world.host.jobs.get(answer.body["job"])
        assert job.script == SESSION
        ended = asyncio.Event()
        job.when_ended(ended.set)
        if job.running:
            await ended.wait()
        shown = (await self._requested("GET", f"/jobs/{job.id}")).body
        error = shown["error"]
        return self._world.reported(error["status"] if error else 200, error or shown)

    async def _requested(self, *request: Any) -> Any:
        self._connections.append(await self._world.request(*request, port=PORT))
        return await self._connections[-1].reply

    def hang_up(self) -> None:
        """It dies: its connections close, and what watches scripts sees that it has ended."""
        self.reply.cancel()
        for connection in self._connections:
            connection.hang_up()
        self._world.loop.settle()  # a closed connection is seen at once, a run's end when it is looked for
        run: Any = SimpleNamespace(session=SESSION, script="mission.py")
        self.death = self._world.loop.create_task(on_exit.after_death(self._world.host, 0, run, []))
