"""Reads the cells of a tag whose cells are so small that the camera's blur mixes them. Pure.

The frame's values around the tag are the blurred sum of its cells. The cells' brightness is the least-squares
solution, damped a little (Tikhonov), so that noise does not grow. At 1.4 px per cell the centres give three wrong
bits of 36 and more, this mostly none.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PER_CELL = 3  # points along a cell
FINE = 12  # pixels along a cell in the picture from which the blur is computed
BLUR = 0.75  # px, sigma: of the lens, and of the interpolation between the frame's pixels
DAMPING = 0.05
SIZES = 0.25  # px per cell: step between readers
LARGE = 6.0  # px per cell above which the centres of the cells are as good
AROUND = 1  # cells around the black square: the white border


@dataclass(frozen=True)
class CellReader:
    """The way from the frame's values to the cells' brightness, for one size of cells.

    Attributes:
        cells: along the black square.
        points: (n, 2) places on the tag, in cells from its top left corner.
        solution: (c, n) maps the values at the points to the brightness of all cells with the white border.
    """

    cells: int
    points: NDArray[np.float32]
    solution: Floats

    @classmethod
    def of(cls, cells: int, cell: float) -> CellReader:
        """A reader for a tag of `cells` cells, each `cell` px wide."""
        side = cells + 2 * AROUND
        along = (np.arange(side * PER_CELL) + 0.5) / PER_CELL
        # A cell's share at a point is the product of its shares along both axes.
        fine = np.repeat(np.eye(side), FINE, axis=1)
        soft = np.asarray(cv2.GaussianBlur(fine, (0, 0), sigmaX=BLUR / cell * FINE, sigmaY=1e-3), np.float64)
        share = soft[:, np.minimum((along * FINE).astype(int), side * FINE - 1)]
        shares = np.kron(share, share).T  # (n, c)
        damped = shares.T @ shares + DAMPING * np.eye(side * side)
        x, y = np.meshgrid(along - AROUND, along - AROUND)
        points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
        return cls(cells, points, np.linalg.solve(damped, shares.T))

    def read(self, image: NDArray[np.uint8], corners: Floats) -> NDArray[np.uint8]:
        """The payload's bits (n, n), 1 is white, of the tag with these corners (4, 2; px)."""
        level = _values(image, self.cells, corners, self.points)
        side = self.cells + 2 * AROUND
        middle = level.mean()
        shades = (self.solution @ (level - middle)).reshape(side, side)
        white, black = _ring(shades), _ring(shades[1:-1, 1:-1])
        return np.asarray(shades[2:-2, 2:-2] > (np.median(white) + np.median(black)) / 2, np.uint8)


def read_centres(image: NDArray[np.uint8], cells: int, corners: Floats) -> NDArray[np.uint8]:
    """The payload's bits (n, n), 1 is white, at the centres of the cells."""
    middles = np.arange(cells, dtype=np.float32) + 0.5
    x, y = np.meshgrid(middles, middles)
    values = _values(image, cells, corners, np.stack([x.ravel(), y.ravel()], axis=1)).reshape(cells, cells)
    payload, border = values[1:-1, 1:-1], _ring(values).mean()
    return np.asarray(payload > (np.max(payload) + min(border, np.min(payload))) / 2, np.uint8)


def _values(image: NDArray[np.uint8], cells: int, corners: Floats, points: NDArray[np.float32]) -> Floats:
    """The frame's values at places on the tag (n, 2), in cells."""
    square = np.array([[0, 0], [cells, 0], [cells, cells], [0, cells]], np.float32)
    transform = cv2.getPerspectiveTransform(square, corners.astype(np.float32))
    places = cv2.perspectiveTransform(points[None], transform)[0]
    values = cv2.remap(image, places[:, 0], places[:, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values, np.float64).ravel()


def _ring(shades: Floats) -> Floats:
    """The outermost cells."""
    return np.concatenate([shades[0], shades[-1], shades[1:-1, 0], shades[1:-1, -1]])
