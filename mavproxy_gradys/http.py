"""The module's endpoints while uavapi is loaded: /gradys/…, and /mission/fly-track."""

from __future__ import annotations

import asyncio
import math
import time
from typing import Annotated, Any, cast

from pydantic import BeforeValidator, Field, model_validator

from mavproxy_gradys.answers import GradysAnswer, GradysStatus, Kept, Recent, Series
from mavproxy_gradys.forwarding.quantities import LONGEST_TEXT, NAME, STATUS
from mavproxy_gradys.forwarding.readings import Reading, Value, device_of
from mavproxy_gradys.service import Gradys
from mavproxy_gradys.tracks.flight import VERB, flight_of
from mavproxy_gradys.tracks.formats import waypoints_of
from mavproxy_gradys.tracks.request import TrackFile, TrackRequest
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Invalid, NoVehicle
from mavproxy_uavapi.http.extension import (
    EITHER,
    FLY,
    POST,
    WATCH,
    Call,
    Done,
    Empty,
    Request,
    Route,
    Success,
    envelope,
)

MOST_READINGS = 1000  # readings in one request
LONGEST_LIST = 64
Name = Annotated[str, Field(pattern=rf"^{NAME}$", description="letters, digits, _ . -")]


def checked(value: Any) -> Value:
    """A measured value, unchanged.

    Raises:
        ValueError: the value cannot be sent.
    """
    numbers = value if isinstance(value, list) and len(value) <= LONGEST_LIST else [value]
    is_text = isinstance(value, str) and len(value) <= LONGEST_TEXT
    if not (is_text or isinstance(value, bool) or all(map(is_number, numbers))):
        raise ValueError(
            "Input should be a finite number (an integer of 64 bits), true or false, a text of at most"
            f" {LONGEST_TEXT} letters, or a list of at most {LONGEST_LIST} finite numbers"
        )
    return value  # type: ignore[no-any-return]


def is_number(value: Any) -> bool:
    """Whether the value is a finite number; an integer must fit into 64 bits."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) if isinstance(value, float) else -(2**63) <= value < 2**63


class OneReading(Request):
    """A measurement; `time` is s since 1970, by default now; `sysid` is the vehicle that it belongs to."""

    quantity: Name
    value: Annotated[Any, BeforeValidator(checked)]
    representation: Annotated[str, Field(max_length=64, pattern=r"^[^\x00]*$")] = ""  # a NUL is refused by stations
    time: Annotated[float | None, Field(ge=0, le=1e11)] = None
    device: Name | None = None
    sysid: Annotated[int | None, Field(ge=1, le=255)] = None


class Readings(Request):
    """One measurement, or several in `readings`."""

    readings: Annotated[list[OneReading], Field(min_length=1, max_length=MOST_READINGS)]

    @model_validator(mode="before")
    @classmethod
    def one_or_several(cls, value: Any) -> Any:
        """Treat a single measurement as a list of one."""
        return value if not isinstance(value, dict) or "readings" in value else {"readings": [value]}


class RecentRequest(Request):
    """`since`: s since 1970; only later readings are answered."""

    since: Annotated[float, Field(ge=0, le=1e11, description="s since 1970; only later readings")] = 0.0


class GradysHandlers:
    """The actions of the routes."""

    def __init__(self, gradys: Gradys) -> None:
        self._gradys = gradys

    def routes(self) -> list[Route]:
        """The routes."""
        return [
            Route("/gradys/status", self.status, Empty, WATCH),
            Route("/gradys/readings", self.readings, Readings, FLY, POST),
            Route("/gradys/recent", self.recent, RecentRequest, WATCH),
            Route("/gradys/flush", self.flush, Empty, FLY, EITHER),
            Route(VERB, self.fly_track, TrackRequest, FLY, POST, job=True, conditions=dict),
        ]

    async def status(self, call: Call) -> GradysAnswer:
        """The counts of pushes and readings, and their outcomes."""
        return {**_answer(call, "success"), "info": cast(GradysStatus, self._gradys.report())}

    async def flush(self, call: Call) -> Success:
        """Try all stations and sinks now."""
        self._gradys.flush()
        return _answer(call, "Everything is tried now")

    async def readings(self, call: Call) -> Kept:
        """Store measurements of a program on the companion computer; answers when they are on the disk."""
        now = time.time()
        readings = [self._reading(call, reading, now) for reading in call.params(Readings).readings]
        numbers = await self._gradys.pipeline.keep(readings)
        plural = "" if len(numbers) == 1 else "s"
        return {**_answer(call, f"Kept {len(numbers)} reading{plural}"), "seq": numbers}

    async def recent(self, call: Call) -> Recent:
        """The newest numbers by device and quantity; their points are [s since 1970, value]."""
        series = self._gradys.pipeline.recent.report(call.params(RecentRequest).since)
        return {**_answer(call, "success"), "series": cast(list[Series], series)}

    async def fly_track(self, call: Call) -> Done:
        """Take off, fly through a track's places, return and land."""
        track_request = call.params(TrackRequest)
        call.remembered = TrackFile.of(track_request)
        places = await asyncio.to_thread(waypoints_of, track_request.track, track_request.ground)
        flight = flight_of(call.vehicle, places, track_request.reach, track_request.transit)

        async def verb(job: Job) -> None:
            await self._gradys.tracks.fly(flight, job)

        return await call.fly(flight.copter, verb, lambda: flight.result)

    def _reading(self, call: Call, request: OneReading, now: float) -> Reading:
        system = request.sysid or call.known_vehicle.state.system
        call.require_right(system)
        at = now if request.time is None else request.time
        device = request.device or self._gradys.pipeline.device_of(system)
        if request.quantity == STATUS:
            raise Invalid(f"{STATUS} tells whether a vehicle is online; take another name", "quantity")
        if request.quantity in self._gradys.pipeline.reserved and self._is_vehicle(device):
            raise Invalid(f"{request.quantity} of {device} comes from the vehicle itself only", "quantity")
        return Reading(device, system, request.quantity, request.representation, request.value, at)

    def _is_vehicle(self, device: str) -> bool:
        """Whether it is the device name of a vehicle."""
        number = device.rpartition("-")[2]
        is_number = number.isascii() and number.isdigit()
        return is_number and device in (device_of(int(number)), self._gradys.pipeline.device_of(int(number)))


def _answer(call: Call, result: str) -> Success:
    try:
        system: int | None = call.known_vehicle.state.system
    except NoVehicle:
        system = None
    return envelope(system, result)
