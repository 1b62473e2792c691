"""OpenCV's AprilTag families, reduced to the selected ids."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mavproxy_vision.apriltag.tag_layout import FAMILIES

NAMES = {family: f"DICT_APRILTAG_{family}" for family in FAMILIES}
# With 30 ids and a distance of 5 bits, corrected noise always looks like some tag: measured, 2 to 13 false frames in
# 200; without correction none.
NO_CORRECTION = {"16h5"}


@dataclass(frozen=True)
class Family:
    """One family's dictionary.

    Attributes:
        name: `36h11` …
        ids: its ids, in the order of OpenCV's indices; None means all.
        dictionary: OpenCV's dictionary.
        correction: a safe `errorCorrectionRate` for it.
    """

    name: str
    ids: tuple[int, ...] | None
    dictionary: Any
    correction: float

    def id_of(self, index: int) -> int:
        """The tag's id for the index that OpenCV reports."""
        return index if self.ids is None else self.ids[index]

    def bits(self, index: int) -> NDArray[np.uint8]:
        """The payload's bits (n, n), 1 is white, top row first."""
        marker = int(self.dictionary.markerSize)
        image = cv2.aruco.generateImageMarker(self.dictionary, index, marker + 2, borderBits=1)
        inner: NDArray[np.uint8] = (image[1:-1, 1:-1] > 127).astype(np.uint8)
        return inner


def family(name: str, selected_ids: Iterable[int] | None = None) -> Family:
    """The dictionary of a family with only the selected ids; None means all."""
    full_dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, NAMES[name]))
    correction = 0.0 if name in NO_CORRECTION else 0.6
    count = FAMILIES[name][1]
    ids = None if selected_ids is None else tuple(sorted({number for number in selected_ids if number < count}))
    rows = full_dictionary.bytesList if ids is None else np.ascontiguousarray(full_dictionary.bytesList[list(ids)])
    return Family(name, ids, cv2.aruco.Dictionary(rows, full_dictionary.markerSize, correctable(name)), correction)


def correctable(name: str) -> int:
    """Bits that can be corrected: less than half of the family's distance. OpenCV 4 says 0."""
    return (int(name.partition("h")[2]) - 1) // 2


def marker_image(name: str, number: int, pixels_per_cell: int = 8, border: int = 1) -> NDArray[np.uint8]:
    """A tag with its white border of `border` cells, as printed: shape (side, side), 0 to 255."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, NAMES[name]))
    cells = int(dictionary.markerSize) + 2
    image = cv2.aruco.generateImageMarker(dictionary, number, cells * pixels_per_cell, borderBits=1)
    edge = border * pixels_per_cell
    framed: NDArray[np.uint8] = np.full((image.shape[0] + 2 * edge,) * 2, 255, np.uint8)
    framed[edge:-edge, edge:-edge] = image
    return framed
