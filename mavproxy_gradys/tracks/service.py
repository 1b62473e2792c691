"""Tracks as one thing: what is recorded, and what is flown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mavproxy_gradys.tracks.flight import VERB, TrackFlight
from mavproxy_gradys.tracks.recorder import Recorder
from mavproxy_uavapi.core.errors import Aborted, Busy
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.vehicle.jobs import Ending, Job


class Tracking:
    """All methods belong to the asyncio thread."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._recorder: Recorder | None = None
        self._flights: list[TrackFlight] = []  # those under way, and each vehicle's newest

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
        number = self._host.registry.find(system).state.system
        recorder = Recorder(self._host, number, file, style=style, period=period, latest=latest)
        self._recorder = recorder  # before the disk answers: another one is refused from now on
        try:
            await recorder.start()
        except BaseException:
            self._recorder = None
            raise
        return recorder

    async def stop_recording(self) -> Recorder | None:
        """End the recording; what was recorded, None when nothing was."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            await recorder.stop()
        return recorder

    async def fly(self, flight: TrackFlight, job: Job) -> str:
        """Fly a track, by `Flight.fly`."""
        self._flights = [*self._told(), flight]
        return await flight.fly(job)

    def _told(self) -> list[TrackFlight]:
        newest = {flight.copter: flight for flight in self._flights}
        return [flight for flight in self._flights if flight.running or newest[flight.copter] is flight]

    async def close(self) -> None:
        """End the recording and the flights: the vehicles hold."""
        for flight in self._flights:
            if flight.job is not None and flight.job.running:
                flight.job.abort(Aborted(f"{VERB}: gradys is unloaded"), Ending.UNLOADED)
        await self.stop_recording()

    def report(self) -> dict[str, Any]:
        """What the status says."""
        return {
            "recording": None if self._recorder is None else self._recorder.report(),
            "flights": [flight.report() for flight in self._told()],
        }
