"""The module as a whole: its pushers, its pipeline, its senders."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Awaitable, Callable
from typing import Any

from mavproxy_gradys.forwarding.pipeline import ReadingPipeline
from mavproxy_gradys.nearby.listener import PositionListener
from mavproxy_gradys.net.addresses import StationAddress
from mavproxy_gradys.net.http_client import Client
from mavproxy_gradys.push.pusher import Pusher
from mavproxy_gradys.push.statistics import StationTally
from mavproxy_gradys.settings import GradysSettings
from mavproxy_gradys.tracks.service import Tracking
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host


class Gradys:
    """The part of gradys in the asyncio thread; all its methods belong to that thread.

    Attributes:
        stations: the outcomes of the updates, by station; kept across a stop and a start.
        pipeline: readings, their spool and their sinks.
        tracks: the recordings and the flights of tracks.
    """

    def __init__(self, host: Host) -> None:
        self.host = host
        self.stations: dict[str, StationTally] = {}
        self.pipeline = ReadingPipeline(host)
        self.tracks = Tracking(host)
        self.settings: GradysSettings | None = None
        self._pushers: list[Pusher] = []
        self._tasks = HeldTasks()
        self._changing = asyncio.Lock()  # a start waits for the previous stop, which may take long

    @property
    def running(self) -> bool:
        """Whether it pushes and senses."""
        return self.settings is not None

    async def start(self, settings: GradysSettings) -> None:
        """Push and sense according to the settings; does nothing if it already does.

        Raises:
            NotDelivered: the CA file cannot be used.
        """
        async with self._changing:
            if not self.running:
                self._start(settings)

    def _start(self, settings: GradysSettings) -> None:
        pushers = [self._pusher(station, settings) for station in settings.gs]
        self.settings, self._pushers = settings, pushers
        for pusher in pushers:
            self._tasks.start(pusher.run(), f"the push to {pusher.station.url}")
        self.pipeline.start(settings)
        if settings.hear:
            near = (settings.hear, settings.timeout, settings.ca_file, settings.device)
            self._tasks.start(PositionListener(self.host, *near).run(), "the listening to other MAVProxys")

    def _pusher(self, station: StationAddress, settings: GradysSettings) -> Pusher:
        client = Client(settings.timeout, settings.token, settings.ca_file)
        return Pusher(station, self.host, settings, self._tally(station), client)

    def _tally(self, station: StationAddress) -> StationTally:
        tally = self.stations.setdefault(station.url, StationTally(station.url, random.random))
        tally.backoff.hurry()
        return tally

    async def stop(self) -> None:
        """Stop; unacknowledged readings stay in the spool."""
        async with self._changing:
            await self._stop()

    async def restart(self, settings: GradysSettings) -> bool:
        """Use other settings if it runs; returns whether it runs.

        Raises:
            NotDelivered: as `start`; it is stopped then.
        """
        async with self._changing:
            if not self.running:
                return False
            await self._stop()
            self._start(settings)
            return True

    async def _stop(self, stop_pipeline: Callable[[], Awaitable[None]] | None = None) -> None:
        self.settings = None
        await self._tasks.end()
        for pusher in self._pushers:  # including those that had not begun
            await pusher.close()
        await (stop_pipeline or self.pipeline.stop)()

    async def close(self) -> None:
        """End it finally; readings that the spool has not taken are tried once more."""
        async with self._changing:
            await self._stop(self.pipeline.close)

    def flush(self) -> None:
        """End all pauses after failures, so that everything is tried now."""
        for tally in self.stations.values():
            tally.backoff.hurry()
            for vehicle in tally.vehicles.values():
                vehicle.backoff.hurry()
        self.pipeline.flush()

    def report(self) -> dict[str, Any]:
        """The body of `GET /gradys/status`."""
        now = self.host.clock()
        current = [] if self.settings is None else [station.url for station in self.settings.gs]
        tallies = [self.stations[url] for url in current]
        newest = max((tally for tally in tallies if tally.last_error), key=lambda t: t.last_error_at, default=None)
        trips = [tally.round_trips.summary() for tally in tallies]
        return {
            "running": self.running,
            "sent": sum(tally.total("sent") for tally in tallies),
            "acknowledged": sum(tally.total("acknowledged") for tally in tallies),
            "dropped_by_station": sum(tally.total("dropped") for tally in tallies),
            "last_error": newest.last_error if newest else None,
            "round_trip_ms": next((trip for trip in trips if trip), None),
            "stations": [tally.report(now) for tally in tallies],
            **self.pipeline.report(),
            "tracks": self.tracks.report(),
        }
