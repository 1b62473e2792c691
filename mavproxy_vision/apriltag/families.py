"""AprilTag families as AprilRobotics publishes them, reduced to the selected ids.

OpenCV knows their bits, and may have them turned: 5.0 draws all by 180 degrees. Which way up a tag is decides where
its target lies. So the bits count only if they are those of the published images, turned back if necessary.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mavproxy_uavapi.core.errors import ToolFailed
from mavproxy_vision.apriltag.tag_layout import FAMILIES

NAMES = {family: f"DICT_APRILTAG_{family}" for family in FAMILIES}
# SHA-256 of a family's payloads, of all ids in their order: a byte for each bit, 1 is white, the top row first. The
# first three are of the images of AprilRobotics/apriltag-imgs; six ids of 36h10 were held against its tag36h10.c.
PUBLISHED = {
    "36h11": "03e254518a633ac5dc9f61be5fe90045fd0fa577dd53f7c55830e52a640a4fb1",
    "25h9": "46b87400ef48be85a54aba09c6096d28372638be3d864d6608f968ffabd723e3",
    "16h5": "76a32b1a2931758a5dd287533445fb7ddf54547100fc3a6b8eef8e859ae027c6",
    "36h10": "0ee765cfbb28efd6febd651ef531750fc7afdf5bbf00b7bd90b9cfa2d9b60d9e",
}
# With 30 ids and a distance of 5 bits, corrected noise always looks like some tag: measured, 2 to 13 false frames in
# 200; without correction none.
NO_CORRECTION = {"16h5"}
Bits = NDArray[np.uint8]
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
        dictionary: OpenCV's dictionary, of the published bits.
        correction: a safe `errorCorrectionRate` for it.
    """

    name: str
    ids: tuple[int, ...] | None
    dictionary: Any
    correction: float

    def id_of(self, index: int) -> int:
        """The tag's id for the index that OpenCV reports."""
        return index if self.ids is None else self.ids[index]

    def bits(self, index: int) -> Bits:
        """The payload's bits (n, n), 1 is white, top row first."""
        one: Bits = payloads(self.name)[self.id_of(index)]
        return one


@lru_cache(maxsize=len(FAMILIES))
def payloads(name: str) -> Bits:
    """The published bits of all ids of a family: shape (ids, n, n), 1 is white, top row first.

    Raises:
        ToolFailed: the installed OpenCV has other tags by that name.
    """
    return published(name, _opencvs_bits(name))


def published(name: str, bits: Bits) -> Bits:
    """The same bits, turned by as many quarter turns as it takes to be those that are published.

    Raises:
        ToolFailed: no turn makes them so.
    """
    for quarters in range(4):
        turned: Bits = np.ascontiguousarray(np.rot90(bits, quarters, axes=(1, 2)))
        if hashlib.sha256(turned.tobytes()).hexdigest() == PUBLISHED[name]:
            return turned
    raise ToolFailed(f"OpenCV {cv2.__version__} has other tags of {name} than AprilRobotics publishes")


def _opencvs_bits(name: str) -> Bits:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, NAMES[name]))
    side = int(dictionary.markerSize)
    images = [
        cv2.aruco.generateImageMarker(dictionary, number, side + 2, borderBits=1)[1:-1, 1:-1]
        for number in range(len(dictionary.bytesList))
    ]
    return (np.stack(images) > 127).astype(np.uint8)


@lru_cache(maxsize=len(FAMILIES))
def _rows(name: str) -> Any:
    """OpenCV's own form of the payloads."""
    rows = [cv2.aruco.Dictionary.getByteListFromBits(bits) for bits in payloads(name)]
    return np.concatenate(rows)


class Words:
    """All payloads of `side` x `side` bits, of AprilTags and of other markers.

    Attributes:
        first: the row of each AprilTag family's id 0.
    """

    def __init__(self, side: int) -> None:
        ours = [name for name in FAMILIES if FAMILIES[name][0] == side + 2]
        others = [f"DICT_{other}" for other in OTHERS[side] if hasattr(cv2.aruco, f"DICT_{other}")]
        known: list[NDArray[np.uint8]] = [payloads(name).reshape(FAMILIES[name][1], -1) for name in ours]
        known += [bits_of(getattr(cv2.aruco, name)) for name in others]
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


@cache
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
    rows, correction = _rows(name), 0.0 if name in NO_CORRECTION else 0.6
    count = FAMILIES[name][1]
    ids = None if selected_ids is None else tuple(sorted({number for number in selected_ids if number < count}))
    chosen = rows if ids is None else np.ascontiguousarray(rows[list(ids)])
    side = payloads(name).shape[1]
    return Family(name, ids, cv2.aruco.Dictionary(chosen, side, correctable(name)), correction)


def correctable(name: str) -> int:
    """Bits that can be corrected: less than half of the family's distance. OpenCV 4 says 0."""
    return (int(name.partition("h")[2]) - 1) // 2


def marker_image(name: str, number: int, pixels_per_cell: int = 8, border: int = 1) -> Bits:
    """A tag with its white border of `border` cells, as printed, the right way up: shape (side, side), 0 to 255."""
    black = np.pad(payloads(name)[number] * np.uint8(255), 1)
    framed = np.pad(black, border, constant_values=255)
    cells: Bits = np.kron(framed, np.ones((pixels_per_cell, pixels_per_cell), np.uint8))
    return cells
