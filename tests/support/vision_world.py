"""A virtual world with a camera, and vision's own flights in it; the same seed gives the same flight."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Aborted
from mavproxy_uavapi.core.link.messages import NedTarget
from mavproxy_uavapi.sim.options import Home, Wind
from tests.support.world import World

FINE = 0.02  # s of a tick, with which flights are measured
FIRST_PICTURES = 0.3  # s


class VisionWorld(World):
    """As `World`, with a loop of its own.

    Args:
        rendered: whether pictures are drawn, and tags detected in them; else both are left to geometry.
        precision_landing: whether the autopilot itself can land on a target.
        wind: m/s, and degrees from where it comes.
        heading: degrees.
        seed: what chance begins with.
        gps_noise: m.
        step: s of a tick.
        settings: of `vision`.
    """

    def __init__(
        self,
        *,
        rendered: bool = False,
        precision_landing: bool = False,
        wind: tuple[float, float] = (0.0, 0.0),
        heading: float = 353.0,
        seed: int = 1,
        gps_noise: float = 0.0,
        step: float = FINE,
        **settings: Any,
    ) -> None:
        options = {"wind": Wind(*wind), "home": Home(heading=heading), "gps_noise": gps_noise, "seed": seed}
        super().__init__({}, step=step, parameters={}, **options)
        if precision_landing:
            self.simulator.parameters.set("PLND_TYPE", 1)  # the autopilot reads it at boot
            self.simulator._boot(self.copter.mission)
        self.directory = Path(tempfile.mkdtemp())
        self.mount_camera(settings, rendered=rendered)

    def start(self, alt: float = 6.0) -> None:
        """Put it into the air by the pilot's hand, and switch everything on."""
        self.flying(height=alt)
        self.switch_on()
        self.open_eye()

    def switch_on(self) -> None:
        """Switch everything on but the camera."""
        self.listen()
        self.go_live()

    def open_eye(self) -> None:
        """Have the camera look, and see something."""
        super().open_eye()
        self.pass_time(FIRST_PICTURES)

    def put(self, **settings: Any) -> None:
        """Change settings; the camera sees it at once."""
        for name, value in settings.items():
            self.vision_settings.set(name, value)
        self.tracker.settings = self.vision_settings.snapshot()
        if self.eye.task is not None:
            self.eye.stop()
            self.eye.start()

    # -- flights --------------------------------------------------------------------------------------------------

    def fly(self, verb: Any, name: str = "/vision/test") -> Job:
        """Begin a job of that verb, or flight."""

        async def body(job: Job) -> str:
            await verb(job)
            return str(verb.result()) if hasattr(verb, "result") else "done"

        return self._in_loop(
            lambda: self.host.jobs.begin(self.known, name, {"n": self.now}, body, outlives_client=True)
        )

    def land(self, number: int | None = None, method: str = "velocity") -> Job:
        """Begin a landing on a tag."""
        return self.fly(self.vision.landing(self.known, number, method), "/vision/land")

    def go_to(self, north: float, east: float, down: float) -> None:
        """Fly there."""

        async def go(job: Job) -> None:
            await self.known.go_to(job, NedTarget(north, east, down), wait=True)

        result = self.outcome(self.fly(go, "/go"))
        assert not isinstance(result, Exception), result

    def outcome(self, job: Job) -> Any:
        """Its result, or the error that it ended with."""

        async def wait() -> Any:
            try:
                return await job.outcome()
            except Exception as error:  # noqa: BLE001  the test looks at it
                return error

        return self.run(wait())

    def stop(self, reason: str = "stopped") -> Any:
        """What `vision abort` and `/vision/stop` do."""
        return self._in_loop(lambda: self.vision.stop(reason))

    def abort(self, job: Job) -> None:
        """What DELETE of the job does."""
        self._in_loop(lambda: job.abort(Aborted("aborted by DELETE")))

    def unload(self, *, last: bool = False) -> list[Any]:
        """What `module unload vision` does; of the last module only the closing messages are sent."""

        async def unloaded() -> list[Any]:
            self.vision.abort_all()
            await asyncio.sleep(0)
            return [message for closing in self.host.closing_messages for message, _ in closing()] if last else []

        async def never(_message: Any, _system: int) -> None:
            await asyncio.Event().wait()  # MAVProxy's main loop waits for the unload, and sends nothing

        if last:
            self.send = never  # type: ignore[method-assign]
        output = self.run(unloaded())
        for message in output:
            self.deliver(message)
        return output

    def _in_loop(self, call: Callable[[], Any]) -> Any:
        async def called() -> Any:
            return call()

        work: Awaitable[Any] = called()
        return self.run(work)

    def close(self) -> None:
        """See `VirtualWorld.close`."""
        self.host.jobs.on_ended.clear()  # nothing is to follow what ends here
        super().close()
