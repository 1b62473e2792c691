"""The routes' requests, and what the pictures of /vision do with old frames and with bodies that are no pictures."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from aiohttp import TCPConnector, web
from aiohttp.test_utils import TestClient, TestServer, make_mocked_request

from mavproxy_uavapi.core.errors import BadRequest, Invalid, NotFound, TooManyRequests, UavApiError
from mavproxy_uavapi.core.streaming import SharedSlots
from mavproxy_uavapi.http.callers.call import Call
from mavproxy_uavapi.http.callers.caller import CALLER, Caller
from mavproxy_uavapi.http.contract.parsing import parse
from mavproxy_uavapi.http.openapi import document
from mavproxy_uavapi.http.wire import bodies
from mavproxy_vision import http
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.overlay import jpeg
from mavproxy_vision.camera.one_at_a_time import OneAtATime
from mavproxy_vision.camera.source import Folder, Posted
from mavproxy_vision.errors import BadImage, NoCamera
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.http import (
    MOST_POSTED,
    FrameRequest,
    LandRequest,
    MissionRequest,
    SearchRequest,
    StreamRequest,
    VisionHandlers,
)
from mavproxy_vision.tracking.capture_worker import CameraHealth
from mavproxy_vision.tracking.carrier import FRESH

IMAGE = np.full((48, 64), 50, np.uint8)
NOW = 100.0


@pytest.mark.parametrize(
    ("model", "name"),
    [
        (LandRequest, "id"),
        (SearchRequest, "id"),
        (SearchRequest, "leash"),
        (MissionRequest, "id"),
        (StreamRequest, "rate"),
        (FrameRequest, "latency"),
    ],
)
def test_true_is_no_number(model, name):
    required = {"north": 1, "east": 1} if model is MissionRequest else {}
    assert getattr(parse(model, "query", {**required, name: "7"}), name) == 7
    for value in (True, False, "1_0"):
        with pytest.raises(Invalid):
            parse(model, "body", {**required, name: value})


def handlers(age, source):
    """The routes' actions, over a camera whose newest frame is `age` s old."""
    result = FrameResult(1, NOW - age - 0.1, NOW - age, NOW - age, (64, 48), ())
    tagged = []

    def geotagged(system, picture, at, *, is_taken=True):
        tagged.append((system, at, is_taken))
        return picture

    vision = SimpleNamespace(
        result=result,
        image=IMAGE,
        worker=SimpleNamespace(source=source, detector=SimpleNamespace(model=CameraModel())),
        host=SimpleNamespace(clock=lambda: NOW, target=1, fleet=SimpleNamespace(vehicles={}), geotagged=geotagged),
        tagged=tagged,
        carrier=SimpleNamespace(system=1),
        health=CameraHealth("frozen"),
        settings=SimpleNamespace(source="http"),
        require_camera=lambda: None,
    )
    return VisionHandlers(vision, SimpleNamespace(running=False, report=None))


def test_the_newest_frame_is_served_while_it_is_new(tmp_path):
    for fresh in (handlers(FRESH - 0.1, Posted(0.0)), handlers(60.0, Folder(tmp_path, 0.0, 0.1))):
        assert asyncio.run(fresh.frame(None)).body[:2] == b"\xff\xd8"
        assert asyncio.run(fresh.newest_frame())[:2] == b"\xff\xd8"
        taken_at = fresh.tracker.result.captured_at
        assert fresh.tracker.tagged == [(1, taken_at, False), (1, taken_at, True)], "looking at it takes no picture"


def test_an_old_frame_is_no_camera():
    old = handlers(FRESH + 0.1, Posted(0.0))
    for ask in (lambda: old.frame(None), old.newest_frame):
        with pytest.raises(NoCamera, match=r"the newest frame is 1\.1 s old; the camera: frozen"):
            asyncio.run(ask())
    old.tracker.worker = None
    with pytest.raises(NoCamera, match="no frame yet"):
        asyncio.run(old.frame(None))


def posted(over, body):
    """Post a body to /vision/frame: the answer, or the error that it would be made of."""
    outcomes = []

    async def handle(request):
        request[CALLER] = Caller(None)
        try:
            outcomes.append(await over.post_frame(Call(None, request, FrameRequest())))
        except BadRequest as error:
            outcomes.append(error)
        return web.Response()

    async def run():
        app = web.Application()
        app.router.add_post("/vision/frame", handle)
        async with TestClient(TestServer(app)) as client:
            await client.post("/vision/frame", data=body)
        return outcomes[0]

    return asyncio.run(run())


def test_a_posted_frame_is_taken_and_is_not_audited():
    over = handlers(0.0, Posted(0.0))
    assert posted(over, jpeg(IMAGE))["result"] == "Frame taken"
    assert over.tracker.worker.source.read().image.shape == (48, 64)
    routes = over.routes()
    assert [route.path for route in routes if not route.audited] == ["/vision/frame"]


def test_what_is_no_frame_of_the_camera_is_reported():
    over = handlers(0.0, Posted(0.0))
    refusal = posted(over, cv2.imencode(".png", np.zeros((72, 128), np.uint8))[1].tobytes())
    assert isinstance(refusal, BadImage)
    assert "a frame has 128x72 px" in str(refusal)
    assert over.tracker.worker.source.read().image.shape == (72, 128)  # the status says so too
    assert isinstance(posted(over, b"nonsense"), BadImage)
    assert over.tracker.worker.source.read() is None
    assert "source http" in str(posted(handlers(0.0, SimpleNamespace(live=True)), jpeg(IMAGE)))


def test_a_frame_that_does_not_arrive_is_reported(monkeypatch):
    monkeypatch.setattr(bodies, "BODY_TIMEOUT", 0.05)

    async def slow():
        yield b"\xff\xd8"
        await asyncio.sleep(0.5)

    assert "did not arrive within 0.05 s" in str(posted(handlers(0.0, Posted(0.0)), slow()))


# -- many at once -----------------------------------------------------------------------------------------


class Counting:
    """Work that takes a while in its thread: how often it was done, and how much of it at once.

    It lasts until `may_end` is set.
    """

    def __init__(self, result):
        self.result, self.count, self.at_once, self.most = result, 0, 0, 0
        self.may_end = threading.Event()
        self.may_end.set()

    def __call__(self, *_):
        self.count += 1
        self.at_once += 1
        self.most = max(self.most, self.at_once)
        time.sleep(0.01)
        assert self.may_end.wait(60)
        self.at_once -= 1
        return self.result


def post_many(over, count):
    """The answers to so many frames that are posted at once."""

    async def handle(request):
        request[CALLER] = Caller(None)
        try:
            await over.post_frame(Call(None, request, FrameRequest()))
        except UavApiError as error:
            return web.Response(status=error.status)
        return web.Response()

    async def run():
        app = web.Application()
        app.router.add_post("/vision/frame", handle)
        async with TestClient(TestServer(app), connector=TCPConnector(limit=0)) as client:
            answers = await asyncio.gather(*(client.post("/vision/frame", data=jpeg(IMAGE)) for _ in range(count)))
            return sorted(answer.status for answer in answers)

    return asyncio.run(run())


def test_frames_are_decoded_one_at_a_time(monkeypatch):
    decoding = Counting(IMAGE)
    monkeypatch.setattr(http, "decode", decoding)
    assert post_many(handlers(0.0, Posted(0.0)), 24) == [200] * 24
    assert (decoding.count, decoding.most) == (24, 1)


def test_frames_beyond_those_on_their_way_are_429():
    over = handlers(0.0, Posted(0.0))
    with contextlib.ExitStack() as on_their_way:
        for _ in range(MOST_POSTED):
            on_their_way.enter_context(over._posts.one_more())
        assert post_many(over, 3) == [429] * 3
    assert post_many(over, 1) == [200]


def test_decoding_goes_on_when_its_client_has_gone(monkeypatch):
    decoding = Counting(IMAGE)
    turns = OneAtATime()

    async def run():
        for _ in range(5):
            task = asyncio.create_task(turns.run(decoding))
            await asyncio.sleep(0.001)
            task.cancel()
        await turns.run(decoding)

    asyncio.run(run())
    assert decoding.most == 1


def test_a_picture_is_drawn_once_for_all_who_ask(monkeypatch):
    drawing = Counting(b"\xff\xd8")
    monkeypatch.setattr(http, "jpeg", drawing)
    over = handlers(0.0, Posted(0.0))

    async def ask(count):
        return await asyncio.gather(*(over.frame(None) for _ in range(count)))

    async def run():
        await ask(100)
        await ask(100)
        over.tracker.result = FrameResult(2, NOW, NOW, NOW, (64, 48), ())
        await ask(100)

    asyncio.run(run())
    assert (drawing.count, drawing.most) == (2, 1)


def test_a_slow_drawing_is_joined_rather_than_overtaken(monkeypatch):
    drawing = Counting(b"\xff\xd8")
    drawing.may_end.clear()
    monkeypatch.setattr(http, "jpeg", drawing)
    over = handlers(0.0, Posted(0.0))

    async def run():
        requested = []
        for number in range(20):
            over.tracker.result = FrameResult(number, NOW, NOW, NOW, (64, 48), ())
            requested.append(asyncio.create_task(over.frame(None)))
            await asyncio.sleep(0)
        drawing.may_end.set()
        await asyncio.gather(*requested)

    asyncio.run(run())
    assert drawing.count == 1


def test_frame_streams_count_among_the_open_ones():
    over = handlers(0.0, Posted(0.0))
    over.tracker.changed = asyncio.Event()
    service = SimpleNamespace(streams=SharedSlots(1, "streams are open"))

    async def run():
        request = make_mocked_request("GET", "/vision/stream.mjpg")
        request[CALLER] = Caller(None)
        first = asyncio.create_task(over.stream(Call(service, request, StreamRequest())))
        await asyncio.sleep(0)
        with pytest.raises(TooManyRequests, match="1 streams are open already"):
            await over.stream(Call(service, request, StreamRequest()))
        first.cancel()
        await asyncio.wait({first})
        assert service.streams.count == 0

    asyncio.run(run())


def served(named, setting, carrier):
    """The system id that a land request means, by the path's, the setting's, and the one with the camera."""
    tracker = SimpleNamespace(carrier=SimpleNamespace(system=carrier), settings=SimpleNamespace(vehicle=setting))
    means = SimpleNamespace(settings=SimpleNamespace(sysid=7))
    routed = VisionHandlers(tracker, None)

    async def land(call):
        return call.system

    call = Call(means, make_mocked_request("POST", "/vision/land"), LandRequest())
    call.named_system = named
    return asyncio.run(routed._served(land)(call))


def test_path_without_a_vehicle_means_the_one_of_the_setting():
    assert served(0, 2, 2) == 2
    assert served(0, 0, 1) == 7, "the API's own, as for any path"


def test_path_of_the_vehicle_with_the_camera_is_answered():
    assert served(2, 2, 2) == 2
    assert served(1, 0, 1) == 1
    assert served(3, 0, 0) == 3, "nobody was heard: the action says so"


@pytest.mark.parametrize("setting", [0, 1])
def test_path_of_another_vehicle_is_not_found(setting):
    with pytest.raises(NotFound, match="the camera is on vehicle 1, not on vehicle 2"):
        served(2, setting, 1)


def test_every_route_but_the_stop_looks_at_the_vehicle():
    routes = VisionHandlers(None, None).routes()
    assert [r.path for r in routes if not hasattr(r.action, "__wrapped__")] == ["/vision/stop"]


def test_description_names_the_errors_of_a_camera() -> None:
    described = document(VisionHandlers(None, None).routes())  # type: ignore[arg-type]
    assert "no_camera" in described["paths"]["/vision/tags"]["get"]["x-codes"]
    assert "no_camera" in described["components"]["schemas"]["Failure"]["properties"]["code"]["enum"]
