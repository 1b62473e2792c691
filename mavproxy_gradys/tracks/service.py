"""The recording of a track, and the track flights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mavproxy_gradys.tracks.flight import VERB, TrackFlight
from mavproxy_gradys.tracks.recorder import Recorder
from mavproxy_uavapi.core.control.jobs import Ending, Job
from mavproxy_uavapi.core.errors import Aborted, Busy
from mavproxy_uavapi.core.host import Host


class Tracking:
    """All methods belong to the asyncio thread."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._recorder: Recorder | None = None
        self._flights: list[TrackFlight] = []  # the running ones, and each vehicle's newest
        self._closed = False

    async def record(
        self, file: Path, *, style: str, period: float, latest: Path | None, system: int = 0
    ) -> Recorder:
        """Record the track of a vehicle; system id 0 is MAVProxy's current vehicle.

        Raises:
            Busy: a recording is running.
            NoVehicle: there is no such vehicle yet.
            NotStored: the file cannot be written.
        """
        if self._recorder is not None:
            raise Busy(f"{self._recorder.file} is being recorded; `gradys track stop` ends the recording")
        number = self._host.registry.find(system).state.system
        recorder = Recorder(self._host, number, file, style=style, period=period, latest=latest)
        self._recorder = recorder  # at once, so that a second recording is refused while the file is opened
        try:
            await recorder.start()
        except BaseException:
            self._recorder = None
            raise
        return recorder

    async def stop_recording(self) -> Recorder | None:
        """End the recording and return it; None without a recording."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            await recorder.stop()
        return recorder

    async def fly(self, flight: TrackFlight, job: Job) -> str:
        """Fly a track; see `TrackFlight.fly`.

        Raises:
            Aborted: the module was unloaded meanwhile.
        """
        if self._closed:
            raise Aborted(f"{VERB}: gradys is unloaded")
        self._flights = [*self._reported_flights(), flight]
        return await flight.fly(job)

    def _reported_flights(self) -> list[TrackFlight]:
        newest = {flight.copter: flight for flight in self._flights}
        return [flight for flight in self._flights if flight.running or newest[flight.copter] is flight]

    async def close(self) -> None:
        """End the recording and the flights; the vehicles hold. None begins any more."""
        self._closed = True
        for flight in self._flights:
            if flight.job is not None and flight.job.running:
                flight.job.abort(Aborted(f"{VERB}: gradys is unloaded"), Ending.UNLOADED)
        await self.stop_recording()

    def report(self) -> dict[str, Any]:
        """The report for the status."""
        return {
            "recording": None if self._recorder is None else self._recorder.report(),
            "flights": [flight.report() for flight in self._reported_flights()],
        }
