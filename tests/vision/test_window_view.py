"""What `vision` shows on MAVProxy's map."""

from __future__ import annotations

from typing import Any

import pytest

from mavproxy_uavapi.core.geodesy import moved
from mavproxy_vision.window_view import TagView
from tests.support.landing import SMALL, TAG


def home(rig: Any) -> tuple[float, float]:
    """Where TAG is measured from."""
    here, local = rig.copter.fresh("GLOBAL_POSITION_INT"), rig.copter.fresh("LOCAL_POSITION_NED")
    return moved(here.lat / 1e7, here.lon / 1e7, -local.x, -local.y)


def test_the_map_shows_where_the_tag_lies_even_when_it_is_out_of_sight(lockstep: Any) -> None:
    rig = lockstep(sim_tags=TAG, **SMALL)
    show = TagView(rig.tracker)
    assert show().places == {}
    rig.start(5.0)
    rig.pass_time(2.0)
    there = pytest.approx(moved(*home(rig), 0.8, -0.6), abs=5e-6)  # 0.5 m
    assert show().places == {"tag 0": there}
    rig.tracker.result = None
    assert show().places == {"tag 0": there}
    rig.tracker.worker = None  # the camera is closed
    assert show().places == {}
