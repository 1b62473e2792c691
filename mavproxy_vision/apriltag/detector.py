"""Detects AprilTags in a grey frame by cv2.aruco.

pupil-apriltags and dt-apriltags are not used: both aborted the process when detectors of several families were built.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mavproxy_vision.apriltag.cell_reader import LARGE as READ_CENTRES
from mavproxy_vision.apriltag.cell_reader import SIZES as READER_SIZES
from mavproxy_vision.apriltag.cell_reader import CellReader, read_centres
from mavproxy_vision.apriltag.corner_refinement import Corners, refine
from mavproxy_vision.apriltag.detection import TagDetection
from mavproxy_vision.apriltag.families import MOST_WRONG, Family, family, words
from mavproxy_vision.apriltag.tag_layout import FAMILIES
from mavproxy_vision.apriltag.template_alignment import LARGE, SIZES, Pattern, align
from mavproxy_vision.geometry.camera_model import CameraModel

Image = NDArray[np.uint8]

# The passes over a frame: its enlargement, and the windows (px) and constant of the adaptive threshold. A small
# window finds small tags; a large one finds near, dim or blurred ones. Noise costs time, less so with a larger
# constant. In an enlarged frame 9 px see as far as 7 px, and farther through a lens that is not sharp.
Passes = tuple[tuple[float, tuple[int, ...], float], ...]
PASSES: Passes = ((1, (3, 23), 14.0),)
FAR_PASSES: Passes = ((1, (3, 23), 20.0), (2, (9,), 15.0))
# Over a brightened frame: its noise is smoothed, no edge is sharpened. A small window finds nothing more in it.
DIM_PASSES: Passes = ((1, (23,), 8.0),)
# Over a frame in which nothing was found, with the blur of a motion undone. Motion makes broad edges: a broad window.
# Double size finds hardly more, and takes half more time, most of it for the contours of noise.
CLOSER = 1.5
CLOSER_PASSES: Passes = ((CLOSER, (23,), 4.0),)
EAGER = 30  # frames after a find in which each one is looked at closer …
SOMETIMES = 3  # … and later one of so many
FEW_IDS = 8  # with at most so many ids OpenCV corrects all that it can; `MOST_WRONG` of our own reading decide
SQUARE = 0.35  # smallest ratio of a tag's shorter to its longer diagonal
SAME = 0.25  # share of a tag's side by which the corners of two detections of it may differ
DIM = 100.0  # brightness below which the brightest hundredth of a frame is raised to it …
MOST_LIGHT = 6.0  # … by this factor at most
NOISY = 2.0  # from this factor on its noise is smoothed …
SMOOTH, LESS = 0.7, 0.4  # px: … by a blur with this sigma; and that of an enlarged frame that is not dim
SHARPEN = (1.0, 0.7)  # share of the detail lost in a blur that is added, and the blur's sigma (px)
MOTION = (2.0, 5.0)  # share of the detail lost in a motion that is added, and the motion's length (px)
EDGES = 0.99  # share of the pixels that are no edges: along a motion the others are the weakest


@dataclass(frozen=True)
class DetectorOptions:
    """Options of the detector.

    Attributes:
        families: names from `tag_layout.FAMILIES`.
        sizes: side of the black square (m) by id.
        any_id: look for all ids, not only those in `sizes`; slower, and 16h5 gives false detections then.
        far: also look at the enlarged frame: a fifth more range for a third more time.
        refine: sharpen the corners.
    """

    families: tuple[str, ...] = ("36h11",)
    sizes: Mapping[int, float] | None = None
    any_id: bool = False
    far: bool = False
    refine: bool = True


class Detector:
    """Detects tags. Use it from one thread at a time.

    Args:
        model: the camera; frames of another size count as scaled frames of the same lens.
        options: see `DetectorOptions`.
    """

    def __init__(self, model: CameraModel, options: DetectorOptions) -> None:
        self.model, self.options = model, options
        self._sizes = dict(options.sizes or {})
        ids: Iterable[int] | None = None if options.any_id or not self._sizes else self._sizes
        families = [family(name, ids) for name in options.families]
        self._families = [searched for searched in families if searched.ids is None or searched.ids]
        self._passes = self._detectors(FAR_PASSES if options.far else PASSES)
        self._dim_passes, self._closer_passes = self._detectors(DIM_PASSES), self._detectors(CLOSER_PASSES)
        self._missed = 0  # frames in a row in which nothing was found
        self._bits: dict[str, dict[int, NDArray[np.uint8]]] = {f.name: {} for f in self._families}
        self._readers: dict[tuple[int, int], CellReader] = {}
        self._patterns: dict[tuple[str, int, int], Pattern] = {}

    def _detectors(self, passes: Passes) -> list[tuple[float, Family, Any]]:
        """For each pass and family the enlargement, the family, and OpenCV's detector."""
        return [
            (zoom, searched, cv2.aruco.ArucoDetector(searched.dictionary, parameters(searched, windows, constant)))
            for zoom, windows, constant in passes
            for searched in self._families
        ]

    def detect(self, image: Image) -> tuple[TagDetection, ...]:
        """The tags in a grey frame, shape (height, width)."""
        factor = lack_of_light(image)
        image, is_dim = lit(image, factor), factor >= NOISY
        if not is_dim:
            found = self._look(image, {1: sharpened(image)}, self._passes)
        else:
            found = self._look(image, {1: smoothed(image)}, self._dim_passes)
        self._missed = 0 if found else self._missed + 1
        if not found and (self._missed <= EAGER or self._missed % SOMETIMES == 0):
            sharp = enlarged(unmoved(smoothed(image) if is_dim else image), CLOSER)
            found = self._look(image, {CLOSER: smoothed(sharp, SMOOTH if is_dim else LESS)}, self._closer_passes)
            self._missed = 0 if found else self._missed
        return found

    def _look(
        self, image: Image, by_zoom: dict[float, Image], passes: list[tuple[float, Family, Any]]
    ) -> tuple[TagDetection, ...]:
        """The tags in a frame, whose squares are searched in prepared ones, by their enlargement."""
        model = self.model.scaled_to(image.shape[1], image.shape[0])
        candidates: list[tuple[Family, int, Corners]] = []
        for zoom, tag_family, detector in passes:
            if zoom not in by_zoom:
                by_zoom[zoom] = enlarged(by_zoom[1], zoom)
            corners, indices, _ = detector.detectMarkers(by_zoom[zoom])
            for quad, index in zip(corners, () if indices is None else indices.ravel(), strict=True):
                rough = (np.asarray(quad, np.float64).reshape(4, 2) + 0.5) / zoom - 0.5
                if not any(
                    tag_family is other and index == same and is_same(rough, there)
                    for other, same, there in candidates
                ):
                    candidates.append((tag_family, int(index), rough))
        detections = (self._sight(image, model, *tag) for tag in candidates)
        return tuple(detection for detection in detections if detection is not None)

    def _sight(
        self, image: Image, model: CameraModel, tag_family: Family, index: int, rough: Corners
    ) -> TagDetection | None:
        if not is_squarish(rough):
            return None
        corners = self._refined(image, tag_family, index, rough) if self.options.refine else rough
        number = tag_family.id_of(index)
        hamming = self._wrong_bits(image, tag_family, number, corners)
        if hamming is None:
            return None
        size = self._sizes.get(number, 0.0)
        if size <= 0:
            return TagDetection(tag_family.name, number, hamming, corners)
        position, turned, error = locate(model, corners, size)
        return TagDetection(tag_family.name, number, hamming, corners, size, position, turned, error)

    def _refined(self, image: Image, tag_family: Family, index: int, rough: Corners) -> Corners:
        corners = refine(image, rough)
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
        steps = round(float(sides.mean()) / FAMILIES[tag_family.name][0] / SIZES)
        if not 0 < steps < LARGE / SIZES:
            return corners
        key = (tag_family.name, index, steps)
        if key not in self._patterns:
            self._patterns[key] = Pattern.of(self._payload(tag_family, index), steps * SIZES)
        return align(image, corners, self._patterns[key])

    def _payload(self, tag_family: Family, index: int) -> NDArray[np.uint8]:
        known = self._bits[tag_family.name]
        if index not in known:
            known[index] = tag_family.bits(index)
        return known[index]

    def _wrong_bits(self, image: Image, tag_family: Family, number: int, corners: Corners) -> int | None:
        """Wrong bits in its payload; None if they are too many, or if it is more like another marker."""
        cells = FAMILIES[tag_family.name][0]
        for read in self._readings(image, cells, corners):
            wrong, others = words(cells - 2).wrong(tag_family.name, number, read)
            if wrong <= min(MOST_WRONG[tag_family.name], others):
                return wrong
        return None

    def _readings(self, image: Image, cells: int, corners: Corners) -> Iterator[NDArray[np.uint8]]:
        """Its payload, by its blurred cells if they are small, then by their centres."""
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
        steps = round(float(sides.mean()) / cells / READER_SIZES)
        if 0 < steps < READ_CENTRES / READER_SIZES:
            if (cells, steps) not in self._readers:
                self._readers[cells, steps] = CellReader.of(cells, steps * READER_SIZES)
            yield self._readers[cells, steps].read(image, corners)
        yield read_centres(image, cells, corners)


def is_squarish(corners: Corners) -> bool:
    """Whether four corners may be a tag seen from a plausible angle."""
    diagonal, other_diagonal = np.linalg.norm(corners[0] - corners[2]), np.linalg.norm(corners[1] - corners[3])
    return bool(min(diagonal, other_diagonal) >= SQUARE * max(diagonal, other_diagonal))


def sharpened(image: Image) -> Image:
    """The frame with sharpened edges: a camera's blur costs more range than its noise."""
    amount, sigma = SHARPEN
    return np.asarray(
        cv2.addWeighted(image, 1 + amount, cv2.GaussianBlur(image, (0, 0), sigma), -amount, 0), np.uint8
    )


def unmoved(image: Image) -> Image:
    """The frame with sharpened edges along the motion that blurred it."""
    amount, length = MOTION
    moved = cv2.filter2D(image, -1, motion(length, direction_of_motion(image)))
    return np.asarray(cv2.addWeighted(image, 1 + amount, moved, -amount, 0), np.uint8)


def direction_of_motion(image: Image) -> float:
    """The direction along which a frame's edges are the weakest: rad from its x axis to its y axis."""
    half = cv2.pyrDown(image)
    x, y = (cv2.Sobel(half, cv2.CV_32F, *order).ravel() for order in ((1, 0), (0, 1)))
    strength = x * x + y * y
    edges = strength > np.partition(strength, rank := int(EDGES * strength.size))[rank]
    x, y = x[edges], y[edges]
    return math.atan2(2 * float(x @ y), float(x @ x - y @ y)) / 2 + math.pi / 2


def motion(length: float, direction: float) -> NDArray[np.float32]:
    """The kernel of a straight motion of `length` px."""
    half = math.ceil(length / 2)
    across, down = np.meshgrid(*2 * [np.arange(-half, half + 1)])
    along = np.linspace(-length / 2, length / 2, 8 * half + 1)[:, None, None]
    near_x = 1 - np.abs(across - along * math.cos(direction))
    near_y = 1 - np.abs(down - along * math.sin(direction))
    kernel = (np.maximum(near_x, 0) * np.maximum(near_y, 0)).sum(axis=0)
    return np.asarray(kernel / kernel.sum(), np.float32)


def enlarged(image: Image, zoom: float) -> Image:
    """The frame, so many times as large along each side."""
    return np.asarray(cv2.resize(image, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_CUBIC), np.uint8)


def is_same(corners: Corners, others: Corners) -> bool:
    """Whether two detections of an id are the same tag."""
    side = np.linalg.norm(corners[0] - corners[1])
    return bool(np.linalg.norm(corners.mean(axis=0) - others.mean(axis=0)) < SAME * side)


def smoothed(image: Image, sigma: float = SMOOTH) -> Image:
    """The frame with less noise: brightened or sharpened, it hides the edges."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), np.uint8)


def lack_of_light(image: Image) -> float:
    """The factor by which a dim frame is to be brightened, because the threshold needs contrast; 1 if it is not."""
    sample = image[::8, ::8].ravel()
    bright = float(np.partition(sample, rank := int(0.99 * sample.size))[rank])
    return 1.0 if bright >= DIM else min(DIM / max(bright, 1.0), MOST_LIGHT)


def lit(image: Image, factor: float) -> Image:
    """The frame, brightened by a factor."""
    return image if factor == 1.0 else np.asarray(cv2.convertScaleAbs(image, alpha=factor), np.uint8)


def parameters(tag_family: Family, windows: tuple[int, ...], constant: float) -> Any:
    """OpenCV's detector parameters: its defaults, except where measurements showed better values.

    In 640x480 frames at 7 m (tag 0.166 m) plain defaults find 37 % of 36h11; these, with sharpening, find more than
    nine in ten in half the time. OpenCV's third window between the two finds nothing more.
    """
    chosen = cv2.aruco.DetectorParameters()
    few = tag_family.ids is not None and len(tag_family.ids) <= FEW_IDS
    chosen.errorCorrectionRate = 1.0 if few and tag_family.correction else tag_family.correction
    chosen.perspectiveRemovePixelPerCell = 8
    chosen.perspectiveRemoveIgnoredMarginPerCell = 0.3
    chosen.adaptiveThreshConstant = constant
    chosen.adaptiveThreshWinSizeMin, chosen.adaptiveThreshWinSizeMax = windows[0], windows[-1]
    chosen.adaptiveThreshWinSizeStep = max(windows[-1] - windows[0], 1)
    return chosen


def locate(model: CameraModel, corners: Corners, size: float) -> tuple[Any, Any, float]:
    """Position (m) and rotation of a square of `size` m in the camera frame, and the error (px, rms)."""
    half = size / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    # OpenCV's result is wrong for a square exactly parallel to the image; a millionth of a pixel helps.
    corners = corners + np.array([[0.0, 0.0], [1e-6, 0.0], [0.0, -1e-6], [1e-6, 1e-6]])
    count, rotations, positions, errors = cv2.solvePnPGeneric(
        square, corners.reshape(4, 1, 2), model.matrix, model.coefficients, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    if not count:
        return None, None, math.nan
    rms = float(np.ravel(errors)[0])
    return positions[0].ravel(), cv2.Rodrigues(rotations[0])[0], rms
