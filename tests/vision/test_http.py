"""The routes' requests, and what the pictures of /vision do with old frames and with bodies that are no pictures."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from mavproxy_uavapi.errors import BadRequest, Invalid
from mavproxy_uavapi.http import call as calls
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.requests import parse
from mavproxy_vision.annotate import jpeg
from mavproxy_vision.camera import Folder, Posted
from mavproxy_vision.errors import BadImage, NoCamera
from mavproxy_vision.http import FrameRequest, LandRequest, MissionRequest, Pages, SearchRequest, StreamRequest
from mavproxy_vision.model import CameraModel
from mavproxy_vision.sighting import Seen
from mavproxy_vision.vision import FRESH
from mavproxy_vision.worker import Health

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
    rest = {"north": 1, "east": 1} if model is MissionRequest else {}
    assert getattr(parse(model, "query", {**rest, name: "7"}), name) == 7
    for value in (True, False, "1_0"):
        with pytest.raises(Invalid):
            parse(model, "body", {**rest, name: value})


def pages(age, source):
    """The routes' actions, over a camera whose newest frame is `age` s old."""
    seen = Seen(1, NOW - age - 0.1, NOW - age, NOW - age, (64, 48), ())
    vision = SimpleNamespace(
        seen=seen,
        image=IMAGE,
        worker=SimpleNamespace(source=source, detector=SimpleNamespace(model=CameraModel())),
        host=SimpleNamespace(clock=lambda: NOW, target=1),
        system=1,
        health=Health("frozen"),
        settings=SimpleNamespace(source="http"),
        require_camera=lambda: None,
    )
    return Pages(vision, SimpleNamespace(running=False, report=None))


def test_the_newest_frame_is_served_while_it_is_new(tmp_path):
    for fresh in (pages(FRESH - 0.1, Posted(0.0)), pages(60.0, Folder(tmp_path, 0.0, 0.1))):
        assert asyncio.run(fresh.frame(None)).body[:2] == b"\xff\xd8"
        assert asyncio.run(fresh.newest_frame())[:2] == b"\xff\xd8"


def test_an_old_frame_is_no_camera():
    old = pages(FRESH + 0.1, Posted(0.0))
    for ask in (lambda: old.frame(None), old.newest_frame):
        with pytest.raises(NoCamera, match=r"the newest frame is 1\.1 s old; the camera: frozen"):
            asyncio.run(ask())
    old.vision.worker = None
    with pytest.raises(NoCamera, match="no frame yet"):
        asyncio.run(old.frame(None))


def posted(over, body):
    """Post a body to /vision/frame: the answer, or the error that it would be made of."""
    found = []

    async def handle(request):
        try:
            found.append(await over.post_frame(Call(None, request, FrameRequest())))
        except BadRequest as error:
            found.append(error)
        return web.Response()

    async def run():
        app = web.Application()
        app.router.add_post("/vision/frame", handle)
        async with TestClient(TestServer(app)) as client:
            await client.post("/vision/frame", data=body)
        return found[0]

    return asyncio.run(run())


def test_a_posted_frame_is_taken_and_leaves_no_trail():
    over = pages(0.0, Posted(0.0))
    assert posted(over, jpeg(IMAGE))["result"] == "Frame taken"
    assert over.vision.worker.source.read().image.shape == (48, 64)
    routes = over.routes()
    assert [route.path for route in routes if not route.trail] == ["/vision/frame"]


def test_what_is_no_frame_of_the_camera_is_told():
    over = pages(0.0, Posted(0.0))
    refusal = posted(over, cv2.imencode(".png", np.zeros((72, 128), np.uint8))[1].tobytes())
    assert isinstance(refusal, BadImage)
    assert "128x72 came" in str(refusal)
    assert over.vision.worker.source.read().image.shape == (72, 128)  # the status says so too
    assert isinstance(posted(over, b"nonsense"), BadImage)
    assert over.vision.worker.source.read() is None
    assert "source http" in str(posted(pages(0.0, SimpleNamespace(live=True)), jpeg(IMAGE)))


def test_a_frame_that_does_not_arrive_is_told(monkeypatch):
    monkeypatch.setattr(calls, "BODY_TIMEOUT", 0.05)

    async def slow():
        yield b"\xff\xd8"
        await asyncio.sleep(0.5)

    assert "did not arrive within 0.05 s" in str(posted(pages(0.0, Posted(0.0)), slow()))
