"""Corners from the whole pattern of a tag that is so small that its border blurs into its payload. Pure.

Lines through edge points (`corner_refinement`) need a border that is wider than the camera's blur. For a tag with
less than four pixels per cell they lie inside the true edge: 36h11 of 0.166 m seemed 0.12 m too far at 7 m. Here the
picture of the tag, blurred like a camera's, is fitted to the frame: the inverse compositional algorithm of Baker and
Matthews, "Lucas-Kanade 20 Years On" (IJCV 2004), with a homography. The brightness of black, of white and of the
ground around it is fitted too, and so is the blur.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Corners = NDArray[np.float64]
Floats = NDArray[np.float64]

FINE = 16  # pixels per cell in our picture of a tag
AROUND = 3  # cells around the black square: a white one, then ground
OUTSIDE = 0.7  # cells beyond the black square that are compared
BLUR = 0.7  # px, sigma: the initial blur; the difference to the true one is fitted
FINEST = 4  # compared places per cell and side, at most
SIZES = 0.25  # px per cell: step between stored pictures
LARGE = 5.0  # px per cell above which lines are as good
STEPS = 8
ENOUGH = 0.02  # px: the fit ends when corners move less
MOVED = 1.6  # px that a corner may move; a larger move is a wrong fit
ALIKE = 0.85  # lowest accepted correlation of picture and frame


@dataclass(frozen=True)
class Pattern:
    """A tag's picture at one size, prepared for comparison.

    Attributes:
        points: (n, 2) places on the tag; its black square spans -1 to 1.
        shades: (5, n) the parts of the brightness: a constant, the white, the ground, and how the latter two change
        with the blur.
        levels: (5, n) maps a frame's values at the points to the share of each shade.
        warp: (8, n) maps the residual to the change of the homography.
    """

    points: Floats
    shades: Floats
    levels: Floats
    warp: Floats

    @classmethod
    def of(cls, bits: NDArray[np.uint8], cell: float) -> Pattern:
        """The pattern of a payload (n, n; 1 is white) whose cells are `cell` px wide."""
        cells = bits.shape[0] + 2
        white = np.pad(np.pad(bits, 1).astype(np.float64), 1, constant_values=1.0)
        ground = np.pad(np.zeros_like(white), AROUND - 1, constant_values=1.0)
        white = np.pad(white, AROUND - 1)
        count = round((cells + 2 * OUTSIDE) * min(max(1.5 * cell, 2.5), FINEST))
        along = np.linspace(-OUTSIDE, cells + OUTSIDE, count)
        x, y = (grid.ravel() for grid in np.meshgrid(along, along))
        sigma = BLUR / cell * FINE
        shade, slope_x, slope_y = _read(white, sigma, x, y)
        dark = _read(ground, sigma, x, y)[0]
        softer = [
            _read(picture, 1.15 * sigma, x, y)[0] - _read(picture, sigma, x, y)[0] for picture in (white, ground)
        ]
        u, v = 2 * x / cells - 1, 2 * y / cells - 1
        slope_x, slope_y = slope_x * cells / 2, slope_y * cells / 2
        turned = slope_x * u + slope_y * v
        moves = np.stack(
            [slope_x * u, slope_x * v, slope_x, slope_y * u, slope_y * v, slope_y, -u * turned, -v * turned]
        )
        shades = np.stack([np.ones_like(shade), shade, dark, *softer])
        levels: Any = np.linalg.pinv(shades.T)
        moves = moves - (moves @ levels.T) @ shades  # remove what a change of brightness explains
        warp: Any = np.linalg.pinv(moves.T)
        return cls(np.stack([u, v], axis=1), shades, levels, warp)


def _read(picture: Floats, sigma: float, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Values and slopes (per cell) of a blurred picture at x and y cells from the black square."""
    fine: Any = cv2.GaussianBlur(np.kron(picture, np.ones((FINE, FINE))), (0, 0), sigma)
    slopes = np.gradient(fine, 1.0 / FINE)
    column, row = (((at + AROUND) * FINE - 0.5).astype(np.float32) for at in (x, y))
    read: list[Any] = [
        cv2.remap(image, column, row, cv2.INTER_LINEAR).ravel() for image in (fine, slopes[1], slopes[0])
    ]
    return read[0], read[1], read[2]


def align(image: NDArray[np.uint8], corners: Corners, pattern: Pattern) -> Corners:
    """The corners (4, 2; px) at which the pattern fits the frame best; unchanged if it does not fit."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
    now: Any = cv2.getPerspectiveTransform(square, corners.astype(np.float32))
    ends, refined = np.column_stack([square, np.ones(4)]).T, corners
    points = np.column_stack([pattern.points, np.ones(len(pattern.points))]).T
    for _ in range(STEPS):
        x, y, scale = now @ points
        column, row = (x / scale).astype(np.float32), (y / scale).astype(np.float32)
        read: Any = cv2.remap(image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        values = read.ravel().astype(np.float64)
        levels = pattern.levels @ values
        if levels[1] <= 0:
            return corners  # white is not brighter than black
        fitted = levels @ pattern.shades
        a, b, c, d, e, f, g, h = pattern.warp @ (values - fitted) / levels[1]
        now = now @ np.linalg.inv(np.array([[1 + a, b, c], [d, 1 + e, f], [g, h, 1.0]]))
        before, refined = refined, _flat(now @ ends)
        if np.abs(refined - before).max() < ENOUGH:
            break
    alike = 1.0 - np.var(values - fitted) / max(np.var(values), 1e-9)
    if alike < ALIKE**2 or np.abs(refined - corners).max() > MOVED:
        return corners
    return refined


def _flat(homogeneous: Floats) -> Corners:
    flat: Corners = (homogeneous[:2] / homogeneous[2]).T
    return flat
