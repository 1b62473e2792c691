from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision import file_commands
from mavproxy_vision.camera.calibration import Board, calibrate, load, save
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.settings import VisionModuleSettings
from tests.support.pictures import png_header


def test_calibration_from_rendered_chessboards(tmp_path, boards):
    true = CameraModel(640, 480, 610.0, 605.0, 325.0, 236.0, (-0.1, 0.02, 0.0, 0.0, 0.0))
    boards.draw(tmp_path, true)
    calibrated = calibrate(tmp_path, Board.parse("chessboard:10x7:0.03"))
    assert calibrated.views >= 5
    assert calibrated.error < 0.3
    assert calibrated.model.fx == pytest.approx(610, rel=0.01)
    assert calibrated.model.fy == pytest.approx(605, rel=0.01)
    save(calibrated.model, tmp_path / "camera.json")
    assert load(tmp_path / "camera.json") == calibrated.model
    assert VisionModuleSettings({"calibration": str(tmp_path / "camera.json")}).snapshot().model == calibrated.model


def calibration(**changed):
    """A calibration's members; what is changed to `...` is left out."""
    whole = {"width": 640, "height": 480, "fx": 600, "fy": 601.5, "cx": 320, "cy": 240, "distortion": [0.1, 0, 0, 0]}
    return {name: value for name, value in (whole | changed).items() if value is not ...}


@pytest.mark.parametrize("count", [0, 4, 5, 8, 12, 14])
def test_a_calibration_may_have_as_many_coefficients_as_opencv_takes(tmp_path, count):
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(calibration(distortion=[0.01] * count)), encoding="utf-8")
    model = load(file)
    assert (model.width, model.fy, len(model.distortion)) == (640, 601.5, count)
    cv2.undistortPoints(np.array([[[5.0, 5.0]]]), model.matrix, model.coefficients)


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        *(({name: ...}, f"missing: {name}") for name in ("width", "height", "fx", "fy", "cx", "cy")),
        ({"nonsense": 5}, "unknown: 'nonsense'"),
        ({"width": "640"}, "width: '640' is not a number"),
        ({"height": True}, "height: true is not a number"),
        ({"width": 640.5}, "width: 640.5 is not a whole number"),
        ({"width": 0}, "a size of 0x480 px"),
        ({"height": -480}, "a size of 640x-480 px"),
        ({"width": 100_000}, "a size of 100000x480 px"),
        ({"fx": 0}, "focal lengths of 0 and"),
        ({"fy": -600}, "focal lengths of 600 and -600"),
        ({"fx": 1e5}, "focal lengths of 100000"),
        ({"cx": math.nan}, "cx: NaN is not a number"),
        ({"fy": math.inf}, "fy: Infinity is not a number"),
        ({"fx": 10**400}, "fx: Infinity"),
        ({"cy": 481}, "outside the frame"),
        ({"distortion": [0.1, 0.2, 0.3]}, "3 distortion coefficients"),
        ({"distortion": [math.nan, 0, 0, 0, 0]}, "distortion: NaN"),
        ({"distortion": "none"}, "distortion: 'none' is not a list"),
        ({"distortion": {"k1": 1}}, "is not a list"),
    ],
)
def test_a_calibration_that_makes_no_sense_is_refused(tmp_path, changed, why):
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(calibration(**changed)), encoding="utf-8")
    with pytest.raises(SettingError, match=f"is not a calibration: .*{why}"):
        load(file)


@pytest.mark.parametrize("text", ["", "[]", "{}", "5", "null", "[\n" * 1000, b"\xff\xfe"])
def test_a_file_that_is_no_calibration_is_refused(tmp_path, text):
    file = tmp_path / "camera.json"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(SettingError, match="is not a calibration"):
        load(file)


def test_what_is_no_file_is_no_calibration(tmp_path):
    for file, why in (
        (tmp_path / "none.json", "No such file"),
        (tmp_path, "not a file"),
        (Path("/dev/zero"), "not a"),
    ):
        with pytest.raises(SettingError, match=why):
            load(file)


@pytest.mark.parametrize(
    ("board", "why"),
    [
        ("charuco:7", "is not charuco"),
        ("charuco:7x5:0.0.3", "is not charuco"),
        ("charuco:7x5:.", "is not charuco"),
        ("charuco:7x5:0.03:0..2", "is not charuco"),
        ("charuco:0x5:0.03", "3 to 50 squares each way"),
        ("chessboard:3x6:0.025", "4 to 50 squares each way"),
        ("chessboard:9x999:0.025", "4 to 50 squares each way"),
        ("charuco:30x30:0.03", "at most 500 squares"),
        ("charuco:7x5:0.03:0.03", "markers are smaller"),
        ("charuco:7x5:0.03:-0.02", "markers are smaller"),
        ("chessboard:9x6:0", "0.001 to 2 m"),
        ("chessboard:9x6:1e400", "0.001 to 2 m"),
    ],
)
def test_a_board_that_cannot_be_is_refused(tmp_path, board, why):
    with pytest.raises(SettingError, match=why):
        file_commands.calibrated([str(tmp_path), board])


@pytest.mark.parametrize(
    "board", ["charuco:3x3:0.03", "charuco:10x50:0.03", "chessboard:4x4:0.03", "charuco:22x22:1"]
)
def test_any_other_board_is_looked_for(board):
    assert Board.parse(board).points(np.zeros((48, 64), np.uint8)) is None


def test_a_folder_without_boards_makes_no_camera(tmp_path):
    (tmp_path / "0.png").write_bytes(png_header(40_000, 40_000))
    (tmp_path / "1.png").write_bytes(b"nonsense")
    with pytest.raises(SettingError, match="0 images"):
        calibrate(tmp_path, Board.parse("charuco:7x5:0.03:0.022"))
    with pytest.raises(SettingError, match="not a folder"):
        calibrate(tmp_path / "none", Board.parse("charuco:7x5:0.03:0.022"))


def test_images_that_determine_no_camera_are_reported(tmp_path):
    squares = np.kron(np.indices((7, 10)).sum(axis=0) % 2, np.ones((40, 40))) * 200 + 30
    flat = np.pad(squares, 40, constant_values=230).astype(np.uint8)
    for index in range(5):
        cv2.imwrite(str(tmp_path / f"{index}.png"), flat)
    with pytest.raises(SettingError, match="the images give no camera model: "):
        calibrate(tmp_path, Board.parse("chessboard:10x7:0.03"))


def test_a_charuco_board_is_read():
    board = Board.parse("charuco:7x5:0.03:0.022")
    image = board.charuco.generateImage((700, 500), marginSize=20)
    on_board, in_image = board.points(image)
    assert len(on_board) == len(in_image) == 24
