"""What `vision` shows on MAVProxy's map."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from mavproxy_uavapi.core.geodesy import moved
from mavproxy_vision.window_view import TagView
from tests.support.landing import SMALL, TAG
from tests.support.vision_world import VisionWorld


def home(world: VisionWorld) -> tuple[float, float]:
    """Where TAG is measured from."""
    here, local = world.known.fresh("GLOBAL_POSITION_INT"), world.known.fresh("LOCAL_POSITION_NED")
    return moved(here.lat / 1e7, here.lon / 1e7, -local.x, -local.y)


def test_the_map_shows_where_the_tag_lies_even_when_it_is_out_of_sight(
    make_world: Callable[..., VisionWorld],
) -> None:
    world = make_world(sim_tags=TAG, **SMALL)
    show = TagView(world.tracker)
    assert show().places == {}
    world.start(5.0)
    world.pass_time(2.0)
    there = pytest.approx(moved(*home(world), 0.8, -0.6), abs=5e-6)  # 0.5 m
    assert show().places == {"tag 0": there}
    world.tracker.result = None
    assert show().places == {"tag 0": there}
    world.tracker.worker = None  # the camera is closed
    assert show().places == {}
