"""Tags are those that AprilRobotics publishes, the same way up, whatever OpenCV is installed."""

from __future__ import annotations

import numpy as np
import pytest

from mavproxy_uavapi.core.errors import ToolFailed
from mavproxy_vision.apriltag import families
from mavproxy_vision.apriltag.detector import Detector, DetectorOptions
from mavproxy_vision.apriltag.tag_layout import FAMILIES
from mavproxy_vision.geometry.camera_model import CameraModel

# The payloads of AprilRobotics' images tag36_11_00000.png, tag25_09_00000.png and tag16_05_00000.png: # is black.
IMAGES = {
    "36h11": ("..#.#.", "#...#.", "#..###", ".#.###", "#.#..#", "###.##"),
    "25h9": (".#.#.", "#.#..", ".##.#", ".....", ".###."),
    "16h5": ("##.#", "##..", "###.", ".#.."),
}


def image_of(rows: tuple[str, ...], cell: int = 20) -> np.ndarray:
    """A picture of a tag with its borders, drawn without OpenCV."""
    payload = np.array([[0 if mark == "#" else 255 for mark in row] for row in rows], np.uint8)
    framed = np.pad(np.pad(payload, 1), 3, constant_values=255)
    return np.kron(framed, np.ones((cell, cell), np.uint8))


@pytest.mark.parametrize("name", IMAGES)
def test_bits_are_those_of_the_published_images(name: str) -> None:
    rows = ("".join("#" if bit == 0 else "." for bit in row) for row in families.payloads(name)[0])
    assert tuple(rows) == IMAGES[name]


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("quarters", range(4))
def test_an_opencv_that_turns_them_changes_nothing(name: str, quarters: int) -> None:
    bits = families.payloads(name)
    turned = np.ascontiguousarray(np.rot90(bits, quarters, axes=(1, 2)))
    assert np.array_equal(families.published(name, turned), bits)


def test_an_opencv_with_other_tags_is_refused() -> None:
    bits = families.payloads("16h5").copy()
    bits[7, 0, 0] ^= 1
    with pytest.raises(ToolFailed, match="other tags of 16h5"):
        families.published("16h5", bits)


@pytest.mark.parametrize("name", IMAGES)
def test_published_tag_is_seen_the_right_way_up_and_where_it_lies(name: str) -> None:
    image = image_of(IMAGES[name])
    model = CameraModel(image.shape[1], image.shape[0], 600, 600, image.shape[1] / 2, image.shape[0] / 2)
    (seen,) = Detector(model, DetectorOptions((name,), {0: 0.3})).detect(image)
    assert seen.id == 0 and seen.corners[0] == pytest.approx([59.5, 59.5], abs=1.0)
    assert seen.rotation is not None
    assert seen.rotation[:2, 0] == pytest.approx([1.0, 0.0], abs=0.02)  # the tag's right is the picture's


def test_a_printed_tag_is_the_published_one() -> None:
    image = families.marker_image("36h11", 0, pixels_per_cell=20, border=3)
    assert np.array_equal(image, image_of(IMAGES["36h11"]))
