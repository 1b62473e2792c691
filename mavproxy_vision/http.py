"""/vision: the endpoints that `uavapi` serves while both modules are loaded."""

from __future__ import annotations

import asyncio
import contextlib
import functools
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Annotated, cast

from aiohttp import web
from pydantic import Field, model_validator

from mavproxy_uavapi.core.errors import BadRequest, NotFound
from mavproxy_uavapi.core.shared_tasks import SharedTasks
from mavproxy_uavapi.core.streaming import Slots, StreamingResponse
from mavproxy_uavapi.core.timeout import wait_with_timeout
from mavproxy_uavapi.http.extension import (
    ANY_FILE,
    EITHER,
    FLY,
    NED_REACH,
    POST,
    WATCH,
    Answer,
    Blocking,
    Call,
    Empty,
    Number,
    Request,
    Route,
    Success,
    Written,
    envelope,
    in_time,
)
from mavproxy_vision.answers import CameraAnswer, CameraStatus, FlightReport, Flown, TagInView, Tags, TagsAnswer
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.overlay import annotated, jpeg
from mavproxy_vision.camera.one_at_a_time import OneAtATime
from mavproxy_vision.camera.source import Image, Posted, decode
from mavproxy_vision.console import caption
from mavproxy_vision.errors import BadImage, NoCamera
from mavproxy_vision.landing.flight_jobs import FlightJobs, FlightTask
from mavproxy_vision.landing.mission import MissionPlan
from mavproxy_vision.settings import METHODS
from mavproxy_vision.status import in_view, status
from mavproxy_vision.tracking.carrier import FRESH
from mavproxy_vision.tracking.tracker import Tracker

BOUNDARY = "frame"
MISSION = "/vision/mission"
MJPEG = "multipart/x-mixed-replace"
BINARY = {"schema": {"type": "string", "format": "binary"}}
JPEG = {"image/jpeg": BINARY}
FRAME_TIMEOUT = 5.0  # s without a frame until a stream ends
MOST_POSTED = 32  # frames that may be in upload at once, each of up to 1 MB

PICTURE = {**dict.fromkeys(("image/jpeg", "image/jpg", "image/png"), BINARY), **ANY_FILE}  # how cameras name theirs

TagId = Annotated[int | None, Field(ge=0, le=100_000, description="of the tag; none for the main tag"), Written]
Method = Annotated[str | None, Field(pattern=f"^({'|'.join(METHODS)})$", description="none for the setting")]


class LandRequest(Blocking):
    """`id` of the tag, `method` velocity or landing_target."""

    id: TagId = None
    method: Method = None


class SearchRequest(Blocking):
    """`id` of the tag; `leash`: the largest distance (m) of the search from its start."""

    id: TagId = None
    leash: Annotated[float | None, Field(gt=0, le=500), Written] = None


class MissionRequest(Blocking):
    """`alt` m above home; `north`, `east` m from home, or `lat`, `long` degrees; `tag` false lands without one."""

    alt: Annotated[Number, Field(gt=0, le=500)] = 5
    north: Annotated[Number | None, Field(ge=-NED_REACH, le=NED_REACH)] = None
    east: Annotated[Number | None, Field(ge=-NED_REACH, le=NED_REACH)] = None
    lat: Annotated[Number | None, Field(ge=-90, le=90)] = None
    long: Annotated[Number | None, Field(ge=-180, le=180)] = None
    id: TagId = None
    tag: bool = True
    method: Method = None

    @model_validator(mode="after")
    def _one_place(self) -> MissionRequest:
        metres = self.north is not None and self.east is not None
        degrees = self.lat is not None and self.long is not None
        if metres == degrees:
            raise ValueError("give north and east, or lat and long")
        return self


def plan_of(request: MissionRequest, method: str) -> MissionPlan:
    """The plan of a request, with that landing method."""
    p = request
    return MissionPlan(p.alt, p.north, p.east, p.lat, p.long, p.id, p.tag, method)


class StreamRequest(Request):
    """`rate` frames per second at most."""

    rate: Annotated[float, Field(gt=0, le=60), Written] = 10


class FrameRequest(Request):
    """`latency` ms from light to arrival; none for the setting."""

    latency: Annotated[float | None, Field(ge=0, le=10_000), Written] = None


class VisionHandlers:
    """The actions of the routes."""

    def __init__(self, tracker: Tracker, flights: FlightJobs) -> None:
        self.tracker, self.flights = tracker, flights
        self._posts = Slots(MOST_POSTED, "frames are on their way in")
        self._decoding, self._encoding = OneAtATime(), OneAtATime()
        self._drawing = SharedTasks[bytes]()
        self._drawn: tuple[FrameResult, bytes] | None = None  # the newest picture with its tags

    def routes(self) -> list[Route]:
        """The routes."""
        routes = [
            Route("/vision/status", self._served(self.status), Empty, WATCH),
            Route("/vision/tags", self._served(self.tags), Empty, WATCH),
            Route("/vision/frame.jpg", self._served(self.frame), Empty, WATCH, content=JPEG),
            Route("/vision/stream.mjpg", self._served(self.stream), StreamRequest, WATCH, content={MJPEG: {}}),
            Route(
                "/vision/frame", self._served(self.post_frame), FrameRequest, FLY, POST, raw=PICTURE, audited=False
            ),
            Route("/vision/land", self._served(self.land), LandRequest, FLY, POST, job=True),
            Route("/vision/search", self._served(self.search), SearchRequest, FLY, POST, job=True),
            Route(
                MISSION,
                self._served(self.mission),
                MissionRequest,
                FLY,
                POST,
                job=True,
                conditions=lambda: self.tracker.settings.changed,
            ),
            Route("/vision/stop", self.stop, Empty, FLY, EITHER, stops=True),
        ]
        return [replace(route, errors=(*route.errors, NoCamera)) for route in routes]

    def _served(self, action: Callable[[Call], Awaitable[Answer]]) -> Callable[[Call], Awaitable[Answer]]:
        """The action, which refuses a path that names another vehicle than the one with the camera."""

        @functools.wraps(action)
        async def served(call: Call) -> Answer:
            carrier = self.tracker.carrier.system
            if carrier and call.named_system not in (0, carrier):
                sentence = f"the camera is on vehicle {carrier}, not on vehicle {call.named_system}"
                raise NotFound(f"{sentence} (`vision set vehicle` says on which)")
            call.prefer(self.tracker.settings.vehicle)
            return await action(call)

        return served

    # -- reading -------------------------------------------------------------------------------------------

    async def status(self, _call: Call) -> CameraAnswer:
        """The camera, the detected tags, and the flight."""
        return {**self._answer("success"), "info": cast(CameraStatus, status(self.tracker, self.flights))}

    async def tags(self, _call: Call) -> TagsAnswer:
        """The tags in view."""
        self.tracker.require_camera()
        result = self.tracker.fresh_result
        if result is None:
            raise NoCamera("no frame was processed in the last second")
        age = self.tracker.host.clock() - result.captured_at
        info: Tags = {"tags": cast(list[TagInView], in_view(result)), "frame": result.number}
        return {**self._answer("success"), "info": info, "age_s": round(age, 3)}

    async def frame(self, _call: Call) -> web.StreamResponse:
        """The newest frame with its tags drawn in."""
        return web.Response(
            body=await self._picture(), content_type="image/jpeg", headers={"Cache-Control": "no-store"}
        )

    async def newest_frame(self) -> bytes:
        """The newest frame without drawings, as JPEG; take_photo answers it with `command=vision`."""
        self.tracker.require_camera()
        result, image = self._newest()
        picture = await self._encoding.run(lambda: jpeg(image))
        return self.tracker.host.geotagged(self.tracker.carrier.system, picture, result.captured_at)

    def _newest(self) -> tuple[FrameResult, Image]:
        """The newest frame and its detections.

        Raises:
            NoCamera: there is none yet, or it is too old; only those of a folder or a file do not age.
        """
        result, image, worker = self.tracker.result, self.tracker.image, self.tracker.worker
        if result is None or image is None or worker is None:
            raise NoCamera("there is no frame yet")
        age = self.tracker.host.clock() - result.received_at
        if age > FRESH and worker.source.live:
            raise NoCamera(f"the newest frame is {age:.1f} s old; the camera: {self.tracker.health.state}")
        return result, image

    async def _picture(self) -> bytes:
        """The newest frame with its tags; drawn once for all callers, one frame at a time."""
        result, image = self._newest()
        if self._drawn is not None and self._drawn[0] is result:
            return self._drawn[1]
        return await self._drawing.outcome(None, lambda: self._draw(result, image))

    async def _draw(self, result: FrameResult, image: Image) -> bytes:
        lines = caption(self.tracker, self.flights)
        drawn = await self._encoding.run(lambda: jpeg(annotated(image, result, lines)))
        picture = self.tracker.host.geotagged(self.tracker.carrier.system, drawn, result.captured_at, is_taken=False)
        self._drawn = result, picture
        return picture

    async def stream(self, call: Call) -> web.StreamResponse:
        """Annotated frames as they arrive, in the format that browsers show (MJPEG)."""
        self.tracker.require_camera()
        pause = 1.0 / call.params(StreamRequest).rate
        response = StreamingResponse(f"{MJPEG}; boundary={BOUNDARY}")
        gone = ConnectionError, NoCamera, asyncio.TimeoutError  # the client, or the camera
        with call.one_more_stream(), contextlib.suppress(*gone):
            await response.prepare(call.request)
            while True:
                await wait_with_timeout(FRAME_TIMEOUT, self.tracker.changed.wait())
                picture = await self._picture()
                head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(picture)}\r\n\r\n"
                await response.write(head.encode() + picture + b"\r\n")
                await asyncio.sleep(pause)
        return response

    async def post_frame(self, call: Call) -> Success:
        """Take a frame: the body is a JPEG or PNG; needs source `http`."""
        self._require_own_frames(call)
        worker = self.tracker.worker
        if worker is None or not isinstance(worker.source, Posted):
            raise BadRequest("frames are taken with `vision set source http` only")
        with self._posts.one_more():
            data = await in_time(call.request.read())
            image = await self._decoding.run(lambda: decode(data))
        latency = call.params(FrameRequest).latency
        worker.source.post(image, None if latency is None else latency / 1000)
        why_not = worker.detector.model.misfit(image.shape[1], image.shape[0])
        if why_not:  # it is posted anyway; the status reports it too
            raise BadImage(why_not)
        return self._answer("Frame taken")

    def _require_own_frames(self, call: Call) -> None:
        """Let only those post frames who may command the vehicle: its landings follow what the frames show.

        Raises:
            Forbidden: the caller's token is not for that vehicle.
            Busy: somebody else holds it.
        """
        host, system = self.tracker.host, self.tracker.carrier.system
        call.require_right(system)
        if system in host.fleet.vehicles:
            host.leases.require(host.registry.find(system), call.caller.operator)

    # -- flying --------------------------------------------------------------------------------------------

    async def land(self, call: Call) -> Flown | web.StreamResponse:
        """Land on a tag from here; answers when the vehicle stands on it."""
        p = call.params(LandRequest)
        task = self.flights.landing(call.copter, p.id, p.method or self.tracker.settings.method)
        return await self._fly(call, task)

    async def search(self, call: Call) -> Flown | web.StreamResponse:
        """Fly an expanding square until the tag is in sight."""
        p = call.params(SearchRequest)
        return await self._fly(call, self.flights.searching(call.copter, p.id, p.leash))

    async def mission(self, call: Call) -> Flown | web.StreamResponse:
        """Take off, fly to a place, land on the tag or without one; return if there is none."""
        p = call.params(MissionRequest)
        plan = plan_of(p, p.method or self.tracker.settings.method)
        return await self._fly(call, self.flights.mission(call.copter, plan))

    async def stop(self, call: Call) -> Success:
        """End the landing, search or mission in flight; the vehicle holds where it is."""
        self._require_rights(call)
        done = self.flights.stop("stopped")
        return self._answer("Nothing was in flight" if done is None else done.capitalize())

    async def _fly(self, call: Call, task: FlightTask) -> Flown | web.StreamResponse:
        self._require_rights(call)
        answer = await call.fly(call.copter, task, task.result, outlives_client=True)
        report = task.report if task.begun else self.flights.report  # of the running flight that it joined
        if isinstance(answer, web.StreamResponse):
            return answer
        assert report is not None  # of a flight that has ended well
        return {**answer, "info": cast(FlightReport, report.as_dict())}

    def _require_rights(self, call: Call) -> None:
        """Let only those on who may command each vehicle that flies for us: its flight is about to end."""
        for system in self.flights.systems:
            call.require_right(system)

    def _answer(self, result: str) -> Success:
        return envelope(self.tracker.carrier.system, result)
