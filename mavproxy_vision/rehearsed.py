"""The module on simulated vehicles whose clock is ours: `mavproxy-uavapi run` has it beside its API."""

from __future__ import annotations

import asyncio
import contextlib
import functools
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.geodesy import offset
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.http.extension import Answer, Call, Route
from mavproxy_vision.apriltag.tag_layout import Tag
from mavproxy_vision.http import MISSION, MissionRequest, VisionHandlers, plan_of
from mavproxy_vision.landing.flight_jobs import FlightJobs
from mavproxy_vision.settings import VisionModuleSettings, VisionSettings
from mavproxy_vision.tracking.projected_worker import ProjectedWorker
from mavproxy_vision.tracking.tracker import Tracker

LOOKS_ON = 5.0  # s after the last call; without a flight nobody looks longer
SEES_WITHIN = 2.0  # s from a call to a frame


class RehearsedVision:
    """A simulated camera on the first vehicle, which looks from the first call of its routes on.

    What it finds is known by geometry, its pictures are black. A tag lies where a mission goes, unless the settings
    say where (`sim_tags`).

    Args:
        host: the vehicles, all of whose clock is its loop's.
        settings: values by name, before those of the environment.
        directory: for tracks and plots.
        home: latitude, longitude (degrees), altitude (m AMSL) at which the first vehicle stood at the beginning.

    Raises:
        SettingError: a setting is refused.
    """

    def __init__(
        self, host: Host, settings: Mapping[str, Any], directory: Path, home: tuple[float, float, float]
    ) -> None:
        self._usual = self._own = settings
        self._home = home
        self._placed: list[str] = []
        self._begun, self._asked_at = False, 0.0
        self._tracker = Tracker(host, self._settings(), ProjectedWorker)
        self._flights = FlightJobs(self._tracker, lambda: directory)

    def use(self, settings: Mapping[str, Any]) -> None:
        """Have these settings besides the first ones, from the next call on.

        Raises:
            SettingError: one is refused.
        """
        before, self._own = self._own, {**self._usual, **settings}
        try:
            self._settings()
        except SettingError:
            self._own = before
            raise

    def routes(self) -> list[Route]:
        """Those of the module; all but what ends a flight wait for a frame."""
        routes = VisionHandlers(self._tracker, self._flights).routes()
        return [route if route.stops else replace(route, action=self._seeing(route.action)) for route in routes]

    async def close(self) -> None:
        """End it."""
        self._flights.abort_all()
        await self._tracker.close()

    def _settings(self) -> VisionSettings:
        module = VisionModuleSettings({**self._own, "source": "sim", "vehicle": 0})
        if self._placed and "sim_tags" not in module.origins:
            module.set("sim_tags", " ".join(self._placed))
        return module.snapshot()

    def _seeing(self, action: Callable[[Call], Awaitable[Answer]]) -> Callable[[Call], Awaitable[Answer]]:
        @functools.wraps(action)
        async def seeing(call: Call) -> Answer:
            if call.path == MISSION:
                self._place(call.params(MissionRequest))
            await self._see()
            return await action(call)

        return seeing

    def _place(self, mission: MissionRequest) -> None:
        """Lay a tag where the mission goes."""
        tags = self._tracker.settings.tag_list
        main = tags[0] if mission.id is None else Tag(mission.id, tags[0].size)
        tag = next((tag for tag in tags if tag.id == main.id), main)
        north, east = offset(*self._home[:2], *plan_of(mission, "").place(self._home[:2]))
        placed = f"{tag.id}:{tag.size:g}@{north:.3f},{east:.3f}"
        if placed not in self._placed:
            self._placed.append(placed)

    async def _see(self) -> None:
        """Look through the camera, with the settings of now, until there is a frame."""
        tracker = self._tracker
        self._asked_at = tracker.host.clock()
        if not self._begun:
            self._begun = True
            tracker.carrier.listen()
            tracker.carrier.know_home(self._home)
        settings = self._settings()
        if not self._flights.systems and (tracker.worker is None or settings != tracker.settings):
            await tracker.start(settings)
            assert isinstance(tracker.worker, ProjectedWorker)
            tracker.worker.looks = self._looks
        with contextlib.suppress(asyncio.TimeoutError):  # who needs a camera says that there is none
            await wait_with_timeout(SEES_WITHIN, self._seen())

    async def _seen(self) -> None:
        while self._tracker.fresh_result is None:
            await self._tracker.changed.wait()

    def _looks(self) -> bool:
        return bool(self._flights.systems) or self._tracker.host.clock() < self._asked_at + LOOKS_ON
