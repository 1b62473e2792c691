"""Pictures of a chessboard as a known camera takes them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from mavproxy_vision.camera.renderer import distortion_maps
from mavproxy_vision.geometry.camera_model import CameraModel

KIND = "chessboard:10x7:0.03"
PIXELS = 40  # of the flat picture for a square of 0.03 m


def draw(folder: Path, camera: CameraModel, count: int = 9) -> None:
    """Write so many pictures of a board held at random before the camera."""
    squares = np.kron(np.indices((7, 10)).sum(axis=0) % 2, np.ones((PIXELS, PIXELS))) * 200 + 30
    board = np.pad(squares, 60, constant_values=230).astype(np.uint8)
    random, maps, scale = np.random.default_rng(5), distortion_maps(camera), 0.03 / PIXELS
    middle = np.array([[scale, 0, -scale * board.shape[1] / 2], [0, scale, -scale * board.shape[0] / 2], [0, 0, 1]])
    for index in range(count):
        turn, _ = cv2.Rodrigues(random.uniform(-0.45, 0.45, 3))
        place = np.array([*random.uniform(-0.05, 0.05, 2), random.uniform(0.5, 0.8)])
        pose = np.column_stack([turn[:, 0], turn[:, 1], place])
        size = (camera.width, camera.height)
        flat = cv2.warpPerspective(board, camera.matrix @ pose @ middle, size, borderValue=120)
        cv2.imwrite(str(folder / f"{index}.png"), cv2.remap(flat, *maps, cv2.INTER_LINEAR))
