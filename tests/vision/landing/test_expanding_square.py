"""The expanding square covers the ground, within its leash."""

from __future__ import annotations

import itertools
import math

import numpy as np

from mavproxy_vision.landing.expanding_square import expanding_square, step_for


def test_it_spirals_outward_in_rings():
    corners = list(itertools.islice(expanding_square(2.0, 100), 6))
    assert [(c.north, c.east) for c in corners] == [(2, 0), (2, 2), (-2, 2), (-2, -2), (4, -2), (4, 4)]
    assert [c.ring for c in corners] == [1, 1, 1, 1, 2, 2]


def test_it_ends_at_the_leash():
    corners = list(expanding_square(2.0, 7.0))
    assert corners
    assert all(math.hypot(c.north, c.east) <= 7.0 for c in corners)


def test_tracks_lie_so_close_that_nothing_is_left_out():
    footprint, tag = 4.0, 0.3
    step = step_for(footprint, tag)
    assert step <= 0.7 * footprint
    places = [(0.0, 0.0)] + [(c.north, c.east) for c in expanding_square(step, 12)]
    path = np.concatenate([np.linspace(a, b, 50) for a, b in itertools.pairwise(places)])
    for north, east in itertools.product(np.arange(-5, 5.1, 0.5), repeat=2):
        near = np.abs(path - (north, east)).max(axis=1).min()  # the view is a square
        assert near <= footprint / 2 - tag / 2


def test_a_large_tag_in_a_small_view_still_gives_a_step():
    assert step_for(1.0, 0.9) > 0
