"""What is seen in rendered frames, where everything is known."""

from __future__ import annotations

import functools
import math

import cv2
import numpy as np
import pytest

from mavproxy_vision.apriltag.corner_refinement import refine
from mavproxy_vision.apriltag.detector import (
    EAGER,
    MOST_LIGHT,
    SOMETIMES,
    Detector,
    DetectorOptions,
    direction_of_motion,
    lack_of_light,
    lit,
    locate,
    motion,
)
from mavproxy_vision.apriltag.families import MOST_WRONG, family, marker_image, words
from mavproxy_vision.apriltag.template_alignment import Pattern, align
from mavproxy_vision.camera.renderer import Look, PlacedTag, Renderer
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector

pytestmark = pytest.mark.matrix

MODEL = CameraModel()
SIZE = 0.166
LEVEL, PLAIN = Attitude(), Look()


@functools.lru_cache(maxsize=8)
def renderer(tags, look, model):
    made = Renderer(model, Mount(), tags, look)
    made._noise  # noqa: B018  it is drawn here, so that a frame does not depend on those before it
    return made


def frame(height=3.0, north=0.0, east=0.0, attitude=LEVEL, tags=None, look=PLAIN, model=MODEL, seed=1):
    made = renderer((PlacedTag("36h11", 0, SIZE, north, east),) if tags is None else tags, look, model)
    made._random = np.random.default_rng(seed)
    return made.render(vector(0, 0, -height), attitude)


@pytest.mark.parametrize("name", ["36h11", "25h9", "16h5", "36h10"])
def test_each_family_is_found_where_it_lies(name):
    image = frame(tags=(PlacedTag(name, 3, SIZE, 0.4, -0.3, 20),))
    (seen,) = Detector(MODEL, DetectorOptions((name,), {3: SIZE})).detect(image)
    assert (seen.family, seen.id, seen.hamming) == (name, 3, 0)
    assert seen.position == pytest.approx([-0.3, -0.4, 3.0], abs=0.03)
    assert seen.error < 0.3


@pytest.mark.parametrize("height", [0.6, 1.5, 3.0, 5.0])
def test_range_is_right(height):
    detector, tags = Detector(MODEL, DetectorOptions(("25h9",), {0: SIZE})), (PlacedTag("25h9", 0, SIZE, 0, 0),)
    images = [frame(height, tags=tags, seed=seed) for seed in range(5)]
    ranges = [seen.distance for image in images for seen in detector.detect(image)]
    assert len(ranges) == 5
    assert np.mean(ranges) == pytest.approx(height, abs=0.05)


def test_refined_corners_are_where_the_tag_is():
    image = frame(3.0, look=Look(noise=0, blur=0.7))
    half = SIZE / 2 / 3.0 * MODEL.fx
    true = np.array([[-half, -half], [half, -half], [half, half], [-half, half]]) + (MODEL.cx, MODEL.cy)
    corners = refine(image, true + np.array([[1, -0.8], [-1, 0.7], [0.9, 0.9], [-0.6, -1]]))
    assert corners == pytest.approx(true, abs=0.1)


def test_corners_that_cannot_be_refined_stay():
    rough = np.array([[100.0, 100], [140, 100], [140, 140], [100, 140]])
    assert (refine(np.full((480, 640), 90, np.uint8), rough) == rough).all()


def test_only_selected_ids_are_detected_unless_all_are_selected():
    image = frame(tags=(PlacedTag("36h11", 5, SIZE, 0, 0),))
    assert Detector(MODEL, DetectorOptions(sizes={0: SIZE})).detect(image) == ()
    (seen,) = Detector(MODEL, DetectorOptions(sizes={0: SIZE}, any_id=True)).detect(image)
    assert (seen.id, seen.position) == (5, None)


def test_several_families_at_once():
    image = frame(tags=(PlacedTag("36h11", 0, SIZE, 0, -0.3), PlacedTag("16h5", 0, SIZE, 0, 0.3)))
    detections = Detector(MODEL, DetectorOptions(("36h11", "16h5"), {0: SIZE})).detect(image)
    assert {(tag.family, tag.id) for tag in detections} == {("36h11", 0), ("16h5", 0)}


@pytest.mark.parametrize("name", ["36h11", "25h9", "16h5", "36h10"])
def test_no_ghosts_on_bare_ground(name):
    renderer = Renderer(MODEL, Mount(), (), Look(), 4)
    detector = Detector(MODEL, DetectorOptions((name,), {0: SIZE, 1: SIZE}))
    random = np.random.default_rng(2)
    for _ in range(15):
        place = vector(*random.uniform(-40, 40, 2), -random.uniform(1, 12))
        assert detector.detect(renderer.render(place, Attitude(*random.uniform(-0.3, 0.3, 2), 1.0))) == ()


def test_distortion_is_undone():
    model = CameraModel(distortion=(-0.25, 0.08, 0.001, -0.001, 0.0))
    image = frame(2.0, 0.5, 0.6, model=model, look=Look(noise=2))
    (seen,) = Detector(model, DetectorOptions(sizes={0: SIZE})).detect(image)
    assert seen.position == pytest.approx([0.6, -0.5, 2.0], abs=0.02)


def test_another_frame_size_is_the_same_lens():
    half = MODEL.scaled_to(320, 240)
    (seen,) = Detector(MODEL, DetectorOptions(sizes={0: SIZE})).detect(frame(2.0, 0.2, 0.1, model=half))
    assert seen.position == pytest.approx([0.1, -0.2, 2.0], abs=0.03)


def test_the_far_setting_sees_farther():
    tags = (PlacedTag("25h9", 0, SIZE, 0, 0),)
    images = [frame(7.0, tags=tags, seed=seed, attitude=Attitude(yaw=0.3 * seed)) for seed in range(8)]
    far = Detector(MODEL, DetectorOptions(("25h9",), {0: SIZE}, far=True))
    assert sum(bool(far.detect(image)) for image in images) >= 7


@pytest.mark.parametrize("apart", [0.22, 0.5])
def test_each_tag_is_reported_once_however_often_it_is_detected(apart):
    tags = (PlacedTag("36h11", 0, SIZE, 0, 0), PlacedTag("36h11", 0, SIZE, 0, apart))
    for height in (1.5, 4.0):
        detections = Detector(MODEL, DetectorOptions(sizes={0: SIZE}, far=True)).detect(frame(height, tags=tags))
        assert sorted(tag.position[0] for tag in detections) == pytest.approx([0, apart], abs=0.02)


@pytest.mark.parametrize("exposure", [0.3, 0.15, 0.1])
@pytest.mark.parametrize("far", [False, True])
def test_tags_in_a_dim_picture_are_detected(exposure, far):
    detector = Detector(MODEL, DetectorOptions(sizes={0: SIZE}, far=far))
    for height in (0.8, 2.0, 4.0):
        (seen,) = detector.detect(frame(height, look=Look(exposure=exposure, noise=1.5)))
        assert seen.distance == pytest.approx(height, rel=0.02)


def test_a_picture_that_is_bright_enough_is_left_as_it_is():
    image = frame()
    assert lack_of_light(image) == 1.0
    assert lit(image, 1.0) is image
    dark = np.zeros((480, 640), np.uint8)
    assert lack_of_light(dark) == MOST_LIGHT


LARGE = (PlacedTag("36h11", 0, 0.30, 0, 0),)
POOR = {  # height (m), quality, and px of motion
    "low light": (8.0, Look(exposure=0.08, noise=3), 0.0),
    "a soft lens": (8.0, Look(blur=1.3), 0.0),
    "motion": (10.0, Look(noise=0), 3.0),
    "fast motion": (7.0, Look(noise=0), 5.0),
}


def in_motion(image, length, seed):
    """A picture without noise as a camera sees it that moves by `length` px, in another direction for each seed."""
    moved = cv2.filter2D(image, -1, motion(length, 0.9 * seed)) if length else image
    noise = np.random.default_rng(seed).normal(0, 5 if length else 0, image.shape)
    return np.clip(moved + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("name", POOR)
def test_a_far_tag_is_detected_in_a_poor_picture(name):
    height, look, length = POOR[name]
    detector = Detector(MODEL, DetectorOptions(sizes={0: 0.30}))
    pictures = [
        frame(height, attitude=Attitude(yaw=0.5 * seed), tags=LARGE, look=look, seed=seed) for seed in range(6)
    ]
    seen = [detector.detect(in_motion(picture, length, seed)) for seed, picture in enumerate(pictures)]
    assert sum(map(bool, seen)) >= 5


@pytest.mark.parametrize("degrees", range(0, 180, 30))
def test_the_direction_of_a_motion_is_seen(degrees):
    image = in_motion(frame(6.0, tags=LARGE, look=Look(noise=0)), 0.0, 1)
    moved = np.clip(cv2.filter2D(image, -1, motion(5.0, math.radians(degrees))), 0, 255)
    off = (math.degrees(direction_of_motion(moved)) - degrees + 90) % 180 - 90
    assert abs(off) < 20


def test_a_frame_without_a_tag_is_looked_at_closer_only_now_and_then(monkeypatch):
    detector, looks = Detector(MODEL, DetectorOptions(sizes={0: SIZE})), []
    monkeypatch.setattr(detector, "_look", lambda _image, _prepared, passes: looks.append(passes) or ())
    for _ in range(EAGER + 3 * SOMETIMES):
        detector.detect(np.full((48, 64), 120, np.uint8))
    assert len(looks) == EAGER + 3 * SOMETIMES + EAGER + 3


def test_a_picture_that_is_read_wrong_reports_how_many_bits():
    picture = marker_image("36h11", 0, 16)
    picture[3 * 16 : 4 * 16, 3 * 16 : 4 * 16] = 255 - picture[3 * 16 : 4 * 16, 3 * 16 : 4 * 16]
    canvas = np.full((480, 640), 255, np.uint8)
    canvas[100 : 100 + picture.shape[0], 100 : 100 + picture.shape[1]] = picture
    (seen,) = Detector(MODEL, DetectorOptions(sizes={0: SIZE})).detect(canvas)
    assert seen.hamming == 1


def canvas_of(picture):
    """A frame with a marker's picture in it."""
    canvas = np.full((480, 640), 255, np.uint8)
    canvas[100 : 100 + picture.shape[0], 100 : 100 + picture.shape[1]] = picture
    return canvas


def with_wrong_bits(name, number, count):
    """A tag's picture in which the first bits of each row are turned over."""
    picture = marker_image(name, number, 16)
    for row in range(count):
        cell = (slice((2 + row) * 16, (3 + row) * 16), slice(2 * 16, 3 * 16))
        picture[cell] = 255 - picture[cell]
    return picture


@pytest.mark.parametrize(("name", "most"), [("36h11", 2), ("36h10", 2), ("25h9", 1), ("16h5", 0)])
def test_a_tag_with_more_wrong_bits_is_none(name, most):
    detector = Detector(MODEL, DetectorOptions((name,), {3: SIZE}))
    for wrong in range(4):
        seen = detector.detect(canvas_of(with_wrong_bits(name, 3, wrong)))
        assert [tag.hamming for tag in seen] == ([wrong] if wrong <= most else [])


@pytest.mark.parametrize(("family_of_it", "number"), [("36h10", 1158), ("36h10", 123)])
@pytest.mark.parametrize("far", [False, True])
def test_a_tag_of_another_family_is_none(family_of_it, number, far):
    detector = Detector(MODEL, DetectorOptions(("36h11",), dict.fromkeys(range(8), SIZE), far=far))
    for height in (1.0, 2.5, 4.0, 5.5):
        assert detector.detect(frame(height, tags=(PlacedTag(family_of_it, number, SIZE, 0, 0),))) == ()


def test_marker_of_another_kind_is_none_though_as_good_as_a_wrong_bit():
    aruco = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_1000)
    detector = Detector(MODEL, DetectorOptions(("25h9",), dict.fromkeys(range(35), SIZE)))
    for number in range(0, 1000, 10):
        picture = cv2.copyMakeBorder(cv2.aruco.generateImageMarker(aruco, number, 112), 16, 16, 16, 16, 0, None, 255)
        assert detector.detect(canvas_of(picture)) == ()


@pytest.mark.parametrize(("name", "side"), [("36h11", 6), ("36h10", 6), ("25h9", 5), ("16h5", 4)])
def test_each_tag_of_a_family_is_most_like_itself(name, side):
    known = words(side)
    for number in (0, 7, 29):
        bits = family(name).bits(number)
        wrong, others = known.wrong(name, number, bits)
        assert wrong == 0
        assert others > MOST_WRONG[name]
        assert known.wrong(name, number, np.rot90(bits))[0] > MOST_WRONG[name]  # its turn is known


@pytest.mark.parametrize(("name", "bits"), [("36h11", 5), ("25h9", 4), ("16h5", 2), ("36h10", 4)])
def test_as_many_bits_are_corrected_as_the_family_allows(name, bits):
    assert family(name).dictionary.maxCorrectionBits == bits
    assert family(name, [0, 1]).dictionary.maxCorrectionBits == bits


def test_a_family_keeps_its_numbers():
    cut = family("36h11", [7, 3, 9999])
    assert cut.ids == (3, 7)
    assert (cut.bits(1) == family("36h11").bits(7)).all()


def test_a_square_is_located():
    half = SIZE / 2 / 2.0 * MODEL.fx
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]]) + (MODEL.cx, MODEL.cy)
    position, _, error = locate(MODEL, corners, SIZE)
    assert position == pytest.approx([0, 0, 2.0], abs=1e-6)
    assert error < 1e-3


@pytest.mark.parametrize("blur", [0.4, pytest.param(0.7, marks=pytest.mark.long), 1.0])
def test_the_range_of_a_small_tag_is_right_however_sharp_the_lens_is(blur):
    def off(refine: bool) -> float:
        detector = Detector(MODEL, DetectorOptions(sizes={0: SIZE}, far=True, refine=refine))
        look = Look(noise=3, blur=blur)
        seen = [
            detector.detect(frame(6.0, attitude=Attitude(yaw=0.4 * seed), look=look, seed=seed)) for seed in range(6)
        ]
        distances = [one.distance for detections in seen for one in detections]
        # The control compares ranges, not finds: through a soft lens its corners do not lead to the cells.
        assert len(distances) >= (5 if refine else 4)
        return float(np.mean(distances)) - 6.0

    assert off(refine=True) == pytest.approx(0, abs=0.03)
    assert off(refine=False) > 0.1  # the control: OpenCV's own corners


def test_a_pattern_that_does_not_fit_leaves_the_corners():
    image, half = frame(6.0, look=Look(noise=0)), SIZE / 2 / 6.0 * MODEL.fx
    true = np.array([[-half, -half], [half, -half], [half, half], [-half, half]]) + (MODEL.cx, MODEL.cy)
    rough, words = true + np.array([[0.3, 0.2], [-0.3, 0.2], [0.2, -0.3], [0.1, 0.3]]), family("36h11", [0, 1])
    cell = 2 * half / 8
    assert align(image, rough, Pattern.of(words.bits(0), cell)) == pytest.approx(true, abs=0.1)
    assert (align(image, rough, Pattern.of(words.bits(1), cell)) == rough).all()
    assert (align(255 - image, rough, Pattern.of(words.bits(0), cell)) == rough).all()
