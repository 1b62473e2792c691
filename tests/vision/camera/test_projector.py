"""`Projector` finds what the real camera and detector find."""

from __future__ import annotations

import pytest

pytest.importorskip("cv2")

import numpy as np

from mavproxy_vision.apriltag.detector import Detector, DetectorOptions
from mavproxy_vision.camera.projector import Projector
from mavproxy_vision.camera.renderer import Look, PlacedTag, Renderer
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector

MODEL = CameraModel.from_field_of_view(640, 480, 56.145)
OPTIONS = DetectorOptions(("36h11",), {0: 0.3})
UPRIGHT = Attitude()


@pytest.mark.parametrize(
    ("position", "attitude", "heading"),
    [
        ((0.2, -0.1, -2.0), (0.0, 0.0, 0.0), 0.0),
        ((-0.5, 0.4, -4.0), (0.05, -0.08, 1.2), 70.0),
        ((0.1, 0.3, -1.0), (-0.1, 0.06, -2.5), 200.0),
    ],
)
@pytest.mark.parametrize("mount", [Mount(), Mount(0.0, 0.0, 90.0, (0.1, 0.0, 0.05))], ids=["below", "turned"])
def test_projected_tag_is_where_the_detector_finds_it(position, attitude, heading, mount):
    renderer = Renderer(MODEL, mount, (PlacedTag("36h11", 0, 0.3, 0.0, 0.0, heading),), Look(noise=1.0))
    where = vector(*position), Attitude(*attitude)
    (seen,) = Detector(MODEL, OPTIONS).detect(renderer.render(*where))
    (projected,) = Projector(renderer, seed=1).detect(*where, OPTIONS)
    assert np.abs(seen.corners - projected.corners).max() < 0.5  # px
    assert np.linalg.norm(seen.position - projected.position) < 0.02  # m


def test_tag_that_is_cut_off_or_too_far_or_behind_the_lens_is_not_detected():
    renderer = Renderer(MODEL, Mount(), (PlacedTag("36h11", 0, 0.3, 0.0, 0.0),), Look())
    projector = Projector(renderer, seed=1)
    assert projector.detect(vector(0.0, 0.0, -2.0), UPRIGHT, OPTIONS)
    for place in ((1.1, 0.0, -2.0), (0.0, 0.0, -60.0)):
        assert projector.detect(vector(*place), UPRIGHT, OPTIONS) == ()
    assert projector.detect(vector(0.0, 0.0, -2.0), Attitude(np.pi), OPTIONS) == ()
    assert projector.detect(vector(0.0, 0.0, -2.0), UPRIGHT, DetectorOptions(("36h11",), {7: 0.3})) == ()
