"""OpenCV's AprilTag families, reduced to the selected ids."""

from __future__ import annotations

import functools
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
# Wrong bits with which a tag is one. Of random squares one in three million is one of eight tags of 36h11 then.
MOST_WRONG = {"36h11": 2, "36h10": 2, "25h9": 1, "16h5": 0}
# The markers of others with as many cells: one of them is not one of our tags because it is like it.
OTHERS = {4: ("4X4_1000",), 5: ("5X5_1000", "ARUCO_ORIGINAL"), 6: ("6X6_1000", "ARUCO_MIP_36h12")}


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


class Words:
    """All payloads of `side` x `side` bits, of AprilTags and of other markers.

    Attributes:
        first: the row of each AprilTag family's id 0.
    """

    def __init__(self, side: int) -> None:
        ours = [name for name in FAMILIES if FAMILIES[name][0] == side + 2]
        names = [*(NAMES[name] for name in ours), *(f"DICT_{other}" for other in OTHERS[side])]
        known = [bits_of(getattr(cv2.aruco, name)) for name in names if hasattr(cv2.aruco, name)]
        starts = np.cumsum([0, *(len(bits) for bits in known)])
        self.first = dict(zip(ours, starts, strict=False))
        self._signs = np.concatenate(known).astype(np.float32) * 2 - 1

    def wrong(self, name: str, number: int, bits: NDArray[np.uint8]) -> tuple[int, int]:
        """Bits that differ from tag `number` of a family, and from the most alike of all others in any turn."""
        turns = np.stack([np.rot90(bits, turn).ravel() for turn in range(4)], axis=1)
        agree = self._signs @ (turns.astype(np.float32) * 2 - 1)
        differ = ((bits.size - agree) / 2).round().astype(int)
        row = self.first[name] + number
        ours = int(differ[row, 0])
        differ[row] = bits.size
        return ours, int(differ.min())


@functools.cache
def words(side: int) -> Words:
    """The payloads of that size; they are made once."""
    return Words(side)


def bits_of(dictionary_number: int) -> NDArray[np.uint8]:
    """The payloads (n, bits) of an OpenCV dictionary; 1 is white."""
    dictionary = cv2.aruco.getPredefinedDictionary(dictionary_number)
    side = int(dictionary.markerSize)
    rows = [cv2.aruco.Dictionary.getBitsFromByteList(row[None], side).ravel() for row in dictionary.bytesList]
    return np.array(rows, np.uint8)


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
