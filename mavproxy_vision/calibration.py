"""Calibration files, and their making from images of a ChArUco board or a chessboard."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from mavproxy_vision.camera import IMAGES
from mavproxy_vision.errors import BadSetting
from mavproxy_vision.model import CameraModel

FEWEST_VIEWS = 5
FEWEST_CORNERS = 8
BOARD = re.compile(r"(charuco|chessboard):(\d+)x(\d+):([0-9.]+)(?::([0-9.]+))?")


@dataclass(frozen=True)
class Board:
    """A board: `charuco` or `chessboard`, squares across and down, side of a square and of a marker (m).

    ChArUco boards are those of OpenCV with DICT_5X5_250, the white squares of which hold the markers.
    """

    kind: str
    columns: int
    rows: int
    square: float
    marker: float

    @classmethod
    def parse(cls, text: str) -> Board:
        """Read `charuco:COLUMNSxROWS:SQUARE[:MARKER]` or `chessboard:COLUMNSxROWS:SQUARE`.

        Raises:
            BadSetting: it is neither.
        """
        match = BOARD.fullmatch(text)
        if match is None:
            raise BadSetting(f"board {text!r} is not charuco:7x5:0.03:0.022 or chessboard:9x6:0.025", "board")
        square = float(match[4])
        marker = float(match[5] or 0.75 * square)
        return cls(match[1], int(match[2]), int(match[3]), square, marker)

    @property
    def charuco(self) -> Any:
        """OpenCV's board."""
        words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, words)

    def points(self, image: Any) -> tuple[Any, Any] | None:
        """Corners on the board (n, 3) in m and in the image (n, 2) in px; None when it is not to be seen."""
        if self.kind == "charuco":
            board = self.charuco
            corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(image)
            if ids is None or len(ids) < FEWEST_CORNERS:
                return None
            on_board, in_image = board.matchImagePoints(corners, ids)
            return on_board.reshape(-1, 3).astype(np.float32), in_image.reshape(-1, 2).astype(np.float32)
        size = (self.columns - 1, self.rows - 1)
        found, corners = cv2.findChessboardCornersSB(image, size)
        if not found:
            return None
        grid = np.mgrid[0 : size[0], 0 : size[1]].T.reshape(-1, 2) * self.square
        on_board = np.column_stack([grid, np.zeros(len(grid))]).astype(np.float32)
        return on_board, corners.reshape(-1, 2).astype(np.float32)


@dataclass(frozen=True)
class Calibration:
    """A camera model, the images it was made of, and its error (px, rms)."""

    model: CameraModel
    views: int
    error: float


def calibrate(folder: Path, board: Board) -> Calibration:
    """Make a camera model of the images of a folder.

    Raises:
        BadSetting: no such folder, or too few of its images show the board.
    """
    if not folder.is_dir():
        raise BadSetting(f"{folder} is not a folder", "folder")
    on_boards, in_images, size = [], [], None
    for file in sorted(folder.iterdir()):
        image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) if file.suffix.lower() in IMAGES else None
        points = None if image is None else board.points(image)
        if image is None or points is None:
            continue
        if size not in (None, image.shape[::-1]):
            raise BadSetting(f"{file.name} has another size than the images before", "folder")
        size = image.shape[::-1]
        on_boards.append(points[0])
        in_images.append(points[1])
    if size is None or len(on_boards) < FEWEST_VIEWS:
        raise BadSetting(f"{len(on_boards)} images in {folder} show the board; {FEWEST_VIEWS} are needed", "folder")
    error, matrix, coefficients, _, _ = cv2.calibrateCamera(on_boards, in_images, size, None, None)
    model = CameraModel(
        int(size[0]),
        int(size[1]),
        float(matrix[0, 0]),
        float(matrix[1, 1]),
        float(matrix[0, 2]),
        float(matrix[1, 2]),
        tuple(float(value) for value in np.ravel(coefficients)[:5]),
    )
    return Calibration(model, len(on_boards), float(error))


def save(model: CameraModel, file: Path) -> None:
    """Write a model as JSON.

    Raises:
        OSError: it cannot be written.
    """
    file.write_text(json.dumps(asdict(model), indent=2) + "\n", encoding="utf-8")


def load(file: Path) -> CameraModel:
    """Read a model.

    Raises:
        BadSetting: there is none, or it makes no sense.
    """
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        values["distortion"] = tuple(float(value) for value in values.get("distortion", ()))
        model = CameraModel(**values)
    except OSError as error:
        raise BadSetting(f"{file}: {error.strerror}", "calibration") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise BadSetting(f"{file} is no calibration: {error}", "calibration") from error
    if not (model.width > 0 and model.height > 0 and model.fx > 0 and model.fy > 0):
        raise BadSetting(f"{file} is no calibration: sizes and focal lengths must be positive", "calibration")
    return model
