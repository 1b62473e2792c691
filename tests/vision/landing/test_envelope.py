"""Landings in an envelope that their tag leaves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.errors import ModeChanged, OutsideEnvelope
from mavproxy_vision.tracking.target_filter import Target
from tests.support.envelopes import feature, square
from tests.support.landing import LARGE
from tests.support.vision_world import VisionWorld

LOITER = 5


@pytest.fixture
def fenced(flying: Callable[..., VisionWorld], monkeypatch: pytest.MonkeyPatch) -> Any:
    """A vehicle above a tag that walks north, out of a field whose border is 2 m north of home."""
    monkeypatch.setattr(Target, "contradiction", None)  # that it moves is not what is looked at here

    def make(speed: float, **settings: Any) -> Any:
        world = flying(6.0, precision_landing=True, **{**LARGE, **settings})
        area = feature("field", square(20, north=-18))
        world.host.envelopes.put(
            "api", 0, formats.of_geojson({"type": "FeatureCollection", "features": [area]}, "a test")
        )
        since = world.now
        world.eye.walk = lambda time: (speed * max(time - since - 2.0, 0.0), 0.0)
        return world

    return make


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize("speed", [0.15, 0.3, 0.6])
def test_a_tag_that_leaves_the_envelope_is_not_followed(fenced, method, speed):
    world, farthest = fenced(speed), [-1e9]
    world.each_step.append(lambda: farthest.append(max(farthest.pop(), world.at.north)))
    world.outcome(world.land(method=method))
    world.pass_time(5.0)
    assert farthest[0] < 2.1


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
def test_such_a_landing_ends_in_a_stop_with_its_reason(fenced, method):
    world = fenced(0.5)
    error = world.outcome(world.land(method=method))
    assert isinstance(error, OutsideEnvelope)
    world.pass_time(5.0)
    assert world.copter.armed
    assert world.mode in ("BRAKE", "GUIDED")
    assert abs(world.copter.body.velocity_down) < 0.1


@pytest.mark.long
def test_control_a_tag_that_stays_inside_is_landed_on(fenced):
    world = fenced(0.0)
    assert world.outcome(world.land(method="landing_target")).startswith("Landed")


def test_a_pilot_who_takes_it_as_its_tag_leaves_the_envelope_keeps_it(fenced):
    world = fenced(0.5)
    wait = world.known.wait_for_heartbeat

    async def wait_while_the_pilot_takes_it() -> None:
        if world.mode == "LAND":
            assert world.copter.set_mode(LOITER)
        await wait()

    world.known.wait_for_heartbeat = wait_while_the_pilot_takes_it
    assert isinstance(world.outcome(world.land(method="landing_target")), ModeChanged)
    world.pass_time(5.0)
    assert world.mode == "LOITER"
