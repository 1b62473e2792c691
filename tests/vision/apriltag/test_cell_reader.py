"""What is read of a tag whose cells the blur mixes."""

from __future__ import annotations

import numpy as np
import pytest

from mavproxy_vision.apriltag.cell_reader import CellReader, read_centres
from mavproxy_vision.apriltag.families import family
from mavproxy_vision.camera.renderer import Look, PlacedTag, Renderer
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector

MODEL, SIZE = CameraModel(), 0.166


def wrong_bits(height, read):
    """Wrong bits of a tag from that height, with known corners."""
    renderer = Renderer(MODEL, Mount(), (PlacedTag("36h11", 0, SIZE, 0, 0),), Look(noise=3), 2)
    image, half = renderer.render(vector(0, 0, -height), Attitude()), SIZE / 2 / height * MODEL.fx
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]]) + (MODEL.cx, MODEL.cy)
    return int((read(image, corners) != family("36h11", [0]).bits(0)).sum())


@pytest.mark.parametrize("height", [4.0, 6.0, 8.0, 9.0])
def test_small_cells_are_read_without_a_wrong_bit(height):
    cell = SIZE * MODEL.fx / height / 8
    assert wrong_bits(height, CellReader.of(8, cell).read) == 0


def test_control_the_centres_of_small_cells_are_read_wrong():
    assert wrong_bits(9.0, lambda image, corners: read_centres(image, 8, corners)) >= 2


def test_large_cells_are_read_at_their_centres():
    assert wrong_bits(1.0, lambda image, corners: read_centres(image, 8, corners)) == 0
