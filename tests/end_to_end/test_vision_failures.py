"""What goes wrong with the tag, the camera, the link or the pilot in a landing: each with the action expected.

A real MAVProxy, and somebody else's camera (`poster`) that posts its frames. On ArduPilot all of them fly; on the
embedded vehicle most do so in lock step, in tests/vision/landing/test_failures.py. The control, which shows that
these tests can fail, is the landing of the same camera with nothing wrong.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest
import requests

from tests.support.processes import Rig

pytestmark = pytest.mark.long

SPEEDUP = 1  # a landing ends after 5 s of the vehicle without a frame
SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 511, 512
NOTHING_MORE = 2.0  # s in which nothing more may be sent
in_lock_step = pytest.mark.sitl  # here on ArduPilot only


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def posted(
    request: pytest.FixtureRequest, harness: ModuleType, poster: ModuleType, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Any]:
    """A rig whose MAVProxy looks at what is posted."""
    directory = tmp_path_factory.mktemp("failures")
    make = harness.embedded if request.param == "embedded" else harness.ardupilot_with_faults
    made = make(directory)
    try:
        harness.eventually(lambda: made.status()["ready_to_arm"], 120, "getting ready to arm")
        made.ok(made.get("/command/set_sim_speedup", sim_factor=SPEEDUP))
        keywords = {"source": "http", "gimbal": True, "width": 480, "height": 360, "attempts": 1, "leash": 3}
        keywords["directory"] = str(directory)
        made.mavproxy.ask(f"module load vision:{json.dumps(keywords, separators=(',', ':'))}", "looking for")
        yield made
    finally:
        made.stop()


class Scene:
    """A landing, and what is wrong with it."""

    def __init__(self, rig: Rig, poster: ModuleType, harness: ModuleType) -> None:
        self.rig, self.harness, self._poster = rig, harness, poster
        self.answer: requests.Response | None = None
        self._landing: threading.Thread | None = None

    def tag(self, **changes: Any) -> Any:
        return self._poster.tag_near(self.rig, **changes)

    def camera(self, *tags: Any, **changes: Any) -> Any:
        return self._poster.Poster(self.rig, *(tags or (self.tag(),)), speedup=SPEEDUP, **changes)

    def settings(self, **changes: Any) -> None:
        for name, value in changes.items():
            self.rig.mavproxy.type(f"vision set {name} {value}")
        self.rig.mavproxy.ask("vision status", "in view")  # it has read them all then

    def begin(self, **body: Any) -> None:
        """Land, beside what the test does meanwhile."""
        self._landing = threading.Thread(target=lambda: setattr(self, "answer", self._land(body)))
        self._landing.start()
        self.harness.eventually(lambda: self.flight().get("running"), 60, "the landing's beginning")

    def _land(self, body: dict[str, Any]) -> requests.Response:
        answer: requests.Response = self.rig.post("/vision/land", timeout=120, **body)
        return answer

    def flight(self) -> dict[str, Any]:
        info = self.rig.ok(self.rig.get("/vision/status"))["info"]
        flight: dict[str, Any] = info.get("flight") or {}
        return flight

    def end(self, timeout: float = 90) -> dict[str, Any]:
        """The landing's answer."""
        assert self._landing is not None
        self._landing.join(timeout)
        assert self.answer is not None, "the landing did not end"
        body: dict[str, Any] = self.answer.json()
        return body

    def land(self, camera: Any, **body: Any) -> dict[str, Any]:
        """Land before this camera; the answer."""
        with camera:
            self.in_view()
            self.begin(**body)
            return self.end()

    def in_view(self) -> None:
        """Wait until frames come."""
        self.harness.eventually(lambda: self.rig.get("/vision/tags").status_code == 200, 60, "frames")

    def holds(self) -> bool:
        """Whether it stays in the air, in GUIDED, once it has stopped."""
        time.sleep(2.0)
        before = self.rig.ned()
        time.sleep(1.5)
        after = self.rig.ned()
        still = max(abs(a - b) for a, b in zip(before, after, strict=True)) < 0.6
        return still and self.rig.status()["mode"] == "GUIDED" and after[2] < -1.5

    def flown_by(self, mark: int) -> list[Any]:
        """What the vehicle was sent since then that could move it; asking for telemetry could not."""
        heard = self.rig.control.ask("received", since=mark)["messages"]
        requested = (SET_MESSAGE_INTERVAL, REQUEST_MESSAGE)
        return [
            message
            for message in heard
            if message["name"] in ("SET_POSITION_TARGET_LOCAL_NED", "SET_MODE", "COMMAND_LONG", "LANDING_TARGET")
            and message["fields"].get("command") not in requested
        ]

    def off(self, tag: Any) -> float:
        """Metres between the vehicle, which must be disarmed, and a tag."""
        assert not self.rig.status()["armed"]
        x, y, _ = self.rig.ned()
        return float(((x - tag.north) ** 2 + (y - tag.east) ** 2) ** 0.5)


@pytest.fixture
def scene(posted: Any, poster: ModuleType, harness: ModuleType) -> Iterator[Scene]:
    """A vehicle 5 m up, and settings that are put back."""
    posted.in_the_air(5)
    made = Scene(posted, poster, harness)
    made.settings(on_failure="hold", tags="0:0.30", attempts=1, leash=3)
    yield made
    posted.control.ask("clear")
    if posted.status()["armed"]:
        posted.on_the_ground()


def reason(body: dict[str, Any]) -> str:
    """Why a landing failed, which it must have done."""
    assert body["code"] == "aborted", body
    return str(body["detail"])


@pytest.mark.long
def test_control_it_lands_on_the_tag(scene: Scene) -> None:
    tag = scene.tag()
    body = scene.land(scene.camera(tag))
    assert body["result"] == "Landed on tag 0"
    assert scene.off(tag) < 0.25
    assert body["info"]["attempts"] == 1
    assert "descending the last metre" in body["info"]["phases"]


@in_lock_step
def test_a_small_tag_beside_the_large_one_takes_over_low_down(scene: Scene) -> None:
    small, large = scene.tag(number=1, size=0.08), scene.tag(east=-0.85, size=0.5)
    scene.settings(tags="1:0.08 0:0.5@-0.35,0")
    body = scene.land(scene.camera(small, large))
    assert body["result"] == "Landed on tag 1"
    assert scene.off(small) < 0.25


@in_lock_step
def test_wrong_id_is_not_landed_on(scene: Scene) -> None:
    body = scene.land(scene.camera(scene.tag(number=1)))
    assert "no tag in sight" in reason(body)
    assert body["info"]["action"] == "hold"
    assert scene.holds()


@in_lock_step
def test_two_equal_tags_are_refused_and_the_vehicle_holds(scene: Scene) -> None:
    body = scene.land(scene.camera(scene.tag(), scene.tag(north=-0.6, east=0.5)))
    assert "two tags" in reason(body)
    assert scene.holds()


@in_lock_step
def test_a_wrong_tag_size_is_refused_with_the_reason(scene: Scene) -> None:
    scene.settings(tags="0:0.42")
    assert "by its size" in reason(scene.land(scene.camera()))
    assert scene.holds()


@in_lock_step
@pytest.mark.parametrize("turned", [90, 180])
def test_a_camera_turned_from_what_mount_says_is_noticed(scene: Scene, turned: float) -> None:
    scene.settings(attempts=5, leash=15)  # it flies away from the tag until it is sure
    body = scene.land(scene.camera(scene.tag(north=0.6, east=-0.5), mount=turned))
    assert "mount" in reason(body)
    assert scene.holds()


@in_lock_step
def test_a_tag_lost_high_up_is_held_for_then_climbed_for_then_given_up(scene: Scene) -> None:
    camera = scene.camera()
    lost: list[float] = []

    def hidden(height: float) -> bool:
        if height < 3.0:
            lost.append(height)
        return bool(lost)

    camera.hidden = hidden
    body = scene.land(camera)
    assert "no tag in sight after 1 attempt" in reason(body)
    phases = list(body["info"]["phases"])
    assert phases.index("descending") < phases.index("holding: tag lost") < phases.index("climbing to the last fix")
    assert scene.holds()
    assert -scene.rig.ned()[2] > 3.2


@in_lock_step
@pytest.mark.parametrize("height", [0.95, 0.4])
def test_a_tag_lost_low_down_is_landed_on_straight(scene: Scene, height: float) -> None:
    tag = scene.tag()
    camera = scene.camera(tag)
    camera.hidden = lambda now: now < height
    body = scene.land(camera)
    assert body["result"] == "Landed on tag 0"
    assert scene.off(tag) < 0.35
    assert "climbing to the last fix" not in body["info"]["phases"]


@in_lock_step
def test_what_lies_over_the_tag_is_waited_out(scene: Scene) -> None:
    scene.settings(attempts=3)  # on a busy machine the frames come so late that it climbs first
    tag = scene.tag()
    camera = scene.camera(tag)
    since: list[float] = []

    def covered(height: float) -> bool:
        if height < 3.0:
            since.append(time.monotonic())
        return bool(since) and time.monotonic() - since[0] < 1.5 / SPEEDUP

    camera.covered = covered
    body = scene.land(camera)
    assert body.get("result") == "Landed on tag 0", body
    assert "holding: tag lost" in body["info"]["phases"]
    assert scene.off(tag) < 0.3


@in_lock_step
def test_a_frozen_camera_ends_the_landing(scene: Scene) -> None:
    scene.settings(on_failure="rtl", attempts=5)
    camera = scene.camera()
    with camera:
        scene.in_view()
        scene.begin()
        scene.harness.eventually(lambda: camera.height < 3.5, 60, "its descending")
        camera.frozen = True
        scene.harness.eventually(lambda: scene.rig.status()["mode"] == "RTL", 60, "returning")
        body = scene.end()
    assert "the camera: frozen" in reason(body)
    assert body["info"]["action"] == "rtl"


@pytest.mark.long
def test_link_silence_of_four_seconds_is_rested_out(scene: Scene) -> None:
    tag = scene.tag()
    scene.settings(attempts=3)  # it may have to climb to find it again
    with scene.camera(tag) as camera:
        scene.in_view()
        scene.begin()
        scene.harness.eventually(lambda: "descending" in str(scene.flight().get("phase")), 60, "its descending")
        scene.rig.control.fault("silence", seconds=4.0, sending=True, receiving=True)
        body = scene.end()
    assert body.get("result") == "Landed on tag 0", body
    assert camera.height < 1
    assert scene.off(tag) < 0.3


def test_the_pilots_hand_ends_a_landing_and_nothing_more_is_sent(scene: Scene) -> None:
    with scene.camera() as camera:
        scene.in_view()
        scene.begin()
        scene.harness.eventually(lambda: camera.height < 4.0, 60, "its descending")
        scene.rig.control.fault("pilot_mode", mode="LOITER")
        body = scene.end(60)
        mark = scene.rig.control.ask("received")["last"]
        time.sleep(NOTHING_MORE)
    assert body["code"] == "mode_changed"
    assert scene.rig.status()["mode"] == "LOITER"
    assert not scene.flown_by(mark)


@in_lock_step
def test_a_battery_failsafe_has_its_way(scene: Scene) -> None:
    for name, value in (("BATT_FS_LOW_ACT", 1), ("BATT_LOW_TIMER", 1)):  # LAND: with RTL it climbs away first
        scene.rig.mavproxy.type(f"param set {name} {value}")
    with scene.camera(scene.tag(north=0.0, east=-1.2)) as camera:
        scene.in_view()
        scene.begin()
        scene.harness.eventually(lambda: camera.height < 4.5, 60, "its descending")
        if scene.rig.is_ardupilot:
            scene.rig.mavproxy.type("param set SIM_BATT_VOLTAGE 9.9")
        else:
            scene.rig.control.fault("low_battery", voltage=9.9)
        body = scene.end(60)
        mark = scene.rig.control.ask("received")["last"]
        time.sleep(NOTHING_MORE)
    assert body["code"] == "mode_changed"
    assert scene.rig.status()["mode"] == "LAND"
    assert not scene.flown_by(mark)
