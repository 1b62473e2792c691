"""Calibration files; they are made from images of a ChArUco board or a chessboard."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from mavproxy_uavapi.core.errors import BadRequest, SettingError, UavApiError
from mavproxy_uavapi.core.file_text import read_text
from mavproxy_vision.apriltag.tag_layout import NUMBER
from mavproxy_vision.camera import calibration_files
from mavproxy_vision.camera.source import IMAGES, Image, decode_any
from mavproxy_vision.errors import BadImage
from mavproxy_vision.geometry.camera_model import CameraModel

FEWEST_VIEWS = 5
FEWEST_CORNERS = 8
BOARD = re.compile(rf"(charuco|chessboard):([0-9]{{1,3}})x([0-9]{{1,3}}):({NUMBER})(?::({NUMBER}))?")
MARKERS = 250  # in the dictionary of ChArUco boards
FEWEST_SQUARES = {"charuco": 3, "chessboard": 4}  # of a board, in each direction
MOST_SQUARES = 50
SQUARES = (0.001, 2.0)  # m, a square's side
SIZES = (16, 16384)  # px, of a frame
FOCAL_LENGTHS = (0.03, 30.0)  # shares of the frame's width: fields of view from 2 to 173 degrees
DISTORTIONS = (0, 4, 5, 8, 12, 14)  # numbers of coefficients that OpenCV accepts


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
            SettingError: it is neither, or such a board is impossible.
        """
        match = BOARD.fullmatch(text)
        if match is None:
            raise SettingError(f"board {text!r} is not charuco:7x5:0.03:0.022 or chessboard:9x6:0.025", "board")
        square = float(match[4])
        marker = float(match[5] or 0.75 * square)
        board = cls(match[1], int(match[2]), int(match[3]), square, marker)
        board.check()
        return board

    def check(self) -> None:
        """Raise SettingError unless such a board is possible."""
        fewest = FEWEST_SQUARES[self.kind]
        if not fewest <= min(self.columns, self.rows) <= max(self.columns, self.rows) <= MOST_SQUARES:
            raise SettingError(f"a {self.kind} has {fewest} to {MOST_SQUARES} squares each way", "board")
        if not (SQUARES[0] <= self.square <= SQUARES[1] and 0 < self.marker < self.square):
            raise SettingError(
                f"a board's squares have {SQUARES[0]:g} to {SQUARES[1]:g} m; its markers are smaller", "board"
            )
        if self.kind == "charuco" and self.columns * self.rows // 2 > MARKERS:
            raise SettingError(f"a ChArUco board has at most {2 * MARKERS} squares", "board")

    @property
    def charuco(self) -> Any:
        """OpenCV's board."""
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, dictionary)

    def points(self, image: Any) -> tuple[Any, Any] | None:
        """Corners on the board (n, 3) in m and in the image (n, 2) in px; None if the image does not show it."""
        if self.kind == "charuco":
            board = self.charuco
            corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(image)
            if ids is None or len(ids) < FEWEST_CORNERS:
                return None
            on_board, in_image = board.matchImagePoints(corners, ids)
            return on_board.reshape(-1, 3).astype(np.float32), in_image.reshape(-1, 2).astype(np.float32)
        size = (self.columns - 1, self.rows - 1)
        detected, corners = cv2.findChessboardCornersSB(image, size)
        if not detected:
            return None
        grid = np.mgrid[0 : size[0], 0 : size[1]].T.reshape(-1, 2) * self.square
        on_board = np.column_stack([grid, np.zeros(len(grid))]).astype(np.float32)
        return on_board, corners.reshape(-1, 2).astype(np.float32)


@dataclass(frozen=True)
class Calibration:
    """A camera model, the number of images that it was made from, and its error (px, rms)."""

    model: CameraModel
    views: int
    error: float


def calibrate(folder: Path, board: Board) -> Calibration:
    """Make a camera model from the images of a folder.

    Raises:
        SettingError: no such folder; too few of its images show the board; or they give no valid camera model.
        OSError: the folder cannot be read.
    """
    if not folder.is_dir():
        raise SettingError(f"{folder} is not a folder", "folder")
    on_boards, in_images, size = [], [], None
    for file in sorted(folder.iterdir()):
        image = _image(file) if file.suffix.lower() in IMAGES else None
        points = None if image is None else board.points(image)
        if image is None or points is None:
            continue
        if size not in (None, image.shape[::-1]):
            raise SettingError(f"{file.name} has a different size than the images before it", "folder")
        size = image.shape[::-1]
        on_boards.append(points[0])
        in_images.append(points[1])
    if size is None or len(on_boards) < FEWEST_VIEWS:
        raise SettingError(f"{len(on_boards)} images in {folder} show the board; {FEWEST_VIEWS} are needed", "folder")
    return _fitted(on_boards, in_images, (int(size[0]), int(size[1])))


def _image(file: Path) -> Image | None:
    """The image in grey; None if the file is not an image."""
    try:
        return decode_any(file.read_bytes())
    except BadImage:
        return None


def _fitted(on_boards: list[Any], in_images: list[Any], size: tuple[int, int]) -> Calibration:
    try:
        error, matrix, coefficients, _, _, spread, *_ = cv2.calibrateCameraExtended(
            on_boards, in_images, size, None, None
        )
    except cv2.error as failed:
        raise SettingError(f"the images give no camera model: {failed.err}", "folder") from failed
    model = CameraModel(
        *size,
        float(matrix[0, 0]),
        float(matrix[1, 1]),
        float(matrix[0, 2]),
        float(matrix[1, 2]),
        tuple(float(value) for value in np.ravel(coefficients)[:5]),
    )
    # What the images do not determine has a variance that is no number; OpenCV 4 gives a plausible value for it.
    why_not = why_invalid(model) or ("" if np.isfinite(spread).all() else "they leave it undetermined")
    if why_not:
        raise SettingError(
            f"the images give no camera model: {why_not}; they should show the board from many sides", "folder"
        )
    return Calibration(model, len(on_boards), float(error))


def save(model: CameraModel, file: Path) -> None:
    """Write a model as JSON.

    Raises:
        OSError: it cannot be written.
    """
    file.write_text(json.dumps(asdict(model), indent=2) + "\n", encoding="utf-8")


def load(file: Path) -> CameraModel:
    """Read a model, of any of the formats of `calibration_files`.

    Raises:
        SettingError: the file is missing or invalid.
    """
    try:
        text = read_text(file, calibration_files.LARGEST_FILE)
    except BadRequest as error:
        raise SettingError(str(error), "calibration") from error
    try:
        model = calibration_files.read(text)
    except UavApiError as error:
        raise SettingError(f"{file} is not a calibration: {error}", "calibration") from error
    why_not = why_invalid(model)
    if why_not:
        raise SettingError(f"{file} is not a calibration: {why_not}", "calibration")
    return model


def why_invalid(model: CameraModel) -> str:
    """Why no camera can have this model; empty for a valid model."""
    if not SIZES[0] <= min(model.width, model.height) <= max(model.width, model.height) <= SIZES[1]:
        return f"a size of {model.width}x{model.height} px; {SIZES[0]} to {SIZES[1]} are possible"
    least, most = (share * model.width for share in FOCAL_LENGTHS)
    if not (least <= model.fx <= most and least <= model.fy <= most):
        return f"focal lengths of {model.fx:g} and {model.fy:g} px; {least:g} to {most:g} are possible for that width"
    if not (0 <= model.cx <= model.width and 0 <= model.cy <= model.height):
        return f"the optical axis at {model.cx:g}, {model.cy:g} px is outside the frame"
    if len(model.distortion) not in DISTORTIONS:
        return f"{len(model.distortion)} distortion coefficients; OpenCV takes {', '.join(map(str, DISTORTIONS))}"
    if not all(abs(value) <= calibration_files.LARGEST for value in model.distortion):  # false for NaN
        return f"distortion coefficients beyond {calibration_files.LARGEST:g}"
    return ""
