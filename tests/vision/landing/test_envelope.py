"""Landings in an envelope that their tag leaves."""

from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.errors import ModeChanged, OutsideEnvelope
from mavproxy_vision.tracking.target_filter import Target
from tests.support.envelopes import feature, square
from tests.support.landing import LARGE

LOITER = 5


@pytest.fixture
def fenced(flying: Any, monkeypatch: Any) -> Any:
    """A vehicle above a tag that walks north, out of a field whose border is 2 m north of home."""
    monkeypatch.setattr(Target, "contradiction", None)  # that it moves is not what is looked at here

    def make(speed: float, **settings: Any) -> Any:
        rig = flying(6.0, precision_landing=True, **{**LARGE, **settings})
        area = feature("field", square(20, north=-18))
        rig.host.envelopes.put(
            "api", 0, formats.of_geojson({"type": "FeatureCollection", "features": [area]}, "a test")
        )
        since = rig.loop.time()
        rig.eye.walk = lambda time: (speed * max(time - since - 2.0, 0.0), 0.0)
        rig.farthest = -1e9
        rig.each_step.append(lambda: setattr(rig, "farthest", max(rig.farthest, rig.truth.north)))
        return rig

    return make


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
@pytest.mark.parametrize("speed", [0.15, 0.3, 0.6])
def test_a_tag_that_leaves_the_envelope_is_not_followed(fenced, method, speed):
    rig = fenced(speed)
    rig.outcome(rig.land(method=method))
    rig.pass_time(5.0)
    assert rig.farthest < 2.1


@pytest.mark.parametrize("method", ["velocity", "landing_target"])
def test_such_a_landing_ends_in_a_stop_with_its_reason(fenced, method):
    rig = fenced(0.5)
    error = rig.outcome(rig.land(method=method))
    assert isinstance(error, OutsideEnvelope)
    rig.pass_time(5.0)
    assert rig.simulator.copter.armed
    assert rig.mode in ("BRAKE", "GUIDED")
    assert abs(rig.simulator.copter.body.velocity_down) < 0.1


@pytest.mark.long
def test_control_a_tag_that_stays_inside_is_landed_on(fenced):
    rig = fenced(0.0)
    assert rig.outcome(rig.land(method="landing_target")).startswith("Landed")


def test_a_pilot_who_takes_it_as_its_tag_leaves_the_envelope_keeps_it(fenced):
    rig = fenced(0.5)
    wait = rig.copter.wait_for_heartbeat

    async def wait_while_the_pilot_takes_it() -> None:
        if rig.mode == "LAND":
            assert rig.simulator.copter.set_mode(LOITER)
        await wait()

    rig.copter.wait_for_heartbeat = wait_while_the_pilot_takes_it
    assert isinstance(rig.outcome(rig.land(method="landing_target")), ModeChanged)
    rig.pass_time(5.0)
    assert rig.mode == "LOITER"
