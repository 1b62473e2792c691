"""Tracks as one thing: what is recorded, and what is flown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mavproxy_gradys.track_flight import VERB, Flight, flight_of
from mavproxy_gradys.track_recorder import Recorder
from mavproxy_gradys.tracks import Waypoint
from mavproxy_uavapi.errors import Aborted, Busy
from mavproxy_uavapi.host.host import Host
from mavproxy_uavapi.vehicle.jobs import CONSOLE, Job
from mavproxy_uavapi.vehicle.vehicle import Vehicle

REACH = 10_000.0  # m from here within which a track must lie


class Tracking:
    """All methods belong to the asyncio thread."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._recorder: Recorder | None = None
        self._flight: Flight | None = None
        self._job: Job | None = None

    async def record(
        self, file: Path, *, style: str, period: float, latest: Path | None, system: int = 0
    ) -> Recorder:
        """Record the track of a vehicle; 0 is MAVProxy's current one.

        Raises:
            Busy: another one is being recorded.
            NoVehicle: there is no such vehicle yet.
            NotStored: the file cannot be written.
        """
        if self._recorder is not None:
            raise Busy(f"{self._recorder.file} is being recorded; `gradys track stop` ends that")
        number = self._host.hangar.find(system).state.system
        recorder = Recorder(self._host, number, file, style=style, period=period, latest=latest)
        await recorder.start()
        self._recorder = recorder
        return recorder

    async def stop_recording(self) -> Recorder | None:
        """End the recording; what was recorded, None when nothing was."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            await recorder.stop()
        return recorder

    def fly(
        self,
        vehicle: Vehicle,
        places: Sequence[Waypoint],
        reach: float = REACH,
        *,
        request: Mapping[str, Any],
        client: str = CONSOLE,
        outlives_client: bool = False,
    ) -> Job:
        """Begin to fly through those places; an identical request joins the flight that is under way.

        Raises:
            NotSupported, Invalid, Stale: as `flight_of`; nothing was sent.
        """
        flight = flight_of(vehicle, places, reach)
        job = self._host.jobs.begin(
            vehicle.seat, VERB, request, flight.fly, client=client, outlives_client=outlives_client
        )
        if job is not self._job:
            self._job, self._flight = job, flight
        return job

    async def close(self) -> None:
        """End the recording and the flight: the vehicle keeps its last setpoint."""
        await self.stop_recording()
        if self._job is not None and self._job.running:
            self._job.abort(Aborted(f"{VERB}: gradys is unloaded"))

    def report(self) -> dict[str, Any]:
        """What the status says."""
        return {
            "recording": None if self._recorder is None else self._recorder.report(),
            "flight": None if self._flight is None else self._flight.report(),
        }
