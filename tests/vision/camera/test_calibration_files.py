from __future__ import annotations

import pytest

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_vision.camera.calibration_files import read
from mavproxy_vision.geometry.camera_model import CameraModel

MODEL = CameraModel(640, 480, 580.5, 576.6, 315.25, 247.5, (0.13, -0.31, 0.002, 0.003, 0.0))
ROS = """image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [ 580.5,    0.,  315.25,
            0.,  576.6,  247.5,
            0.,     0.,    1. ]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.13, -0.31, 0.002, 0.003, 0.000000]
projection_matrix:
  rows: 3
  cols: 4
  data: [587.7, 0., 316.7, 0., 0., 585.6, 248.2, 0., 0., 0., 1., 0.]
"""
OPENCV = """%YAML:1.0
---
calibration_time: "Tue 24 Nov 2026 08:25:05 AM"
image_width: 640
image_height: 480
flags: 0
fisheye_model: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.805e+02, 0., 3.1525e+02, 0., 5.766e+02, 2.475e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 1.3e-01, -3.1e-01, 2.0e-03, 3.0e-03, 0. ]
avg_reprojection_error: 3.4e-01
"""
OLDER = OPENCV.replace("image_width", "image_Width").replace("image_height", "image_Height").replace(
    "camera_matrix", "Camera_Matrix"
).replace("distortion_coefficients", "Distortion_Coefficients")  # fmt: skip
RECORDED = """height: 480
width: 640
distortion_model: plumb_bob
d: [0.13, -0.31, 0.002, 0.003, 0.0]
k: [580.5, 0.0, 315.25, 0.0, 576.6, 247.5, 0.0, 0.0, 1.0]
---
"""
LISTS = ROS.replace("[0.13, -0.31, 0.002, 0.003, 0.000000]", "\n  - 0.13\n  - -.31\n  - 2e-3\n  - 0.003\n  - 0\n")
# As Python programs dump NumPy's arrays.
ROWS = """image_width: 640
image_height: 480
cameraMatrix:
- [580.5, 0.0, 315.25]
- [0.0, 576.6, 247.5]
- - 0.0
  - 0.0
  - 1.0
dist_coeff:
- [0.13, -0.31, 0.002, 0.003, 0.0]
"""
XML = """<?xml version="1.0"?>
<opencv_storage>
<image_Width>640</image_Width>
<Camera_Matrix type_id="opencv-matrix"><rows>3</rows></Camera_Matrix>
</opencv_storage>
"""
VIDERE = "# oST version 5.0 parameters\n\n\n[image]\n\nwidth\n640\n\nheight\n480\n\n[narrow_stereo]\n"


@pytest.mark.parametrize(
    "text", [ROS, ROWS, OPENCV, OLDER, RECORDED, 3 * RECORDED, LISTS, ROS.replace("plumb_bob", "rational_polynomial")]
)
def test_every_calibrator_gives_the_same_model(text: str) -> None:
    assert read(text) == MODEL


def test_a_camera_without_distortion_has_none() -> None:
    text = "width: 64\nheight: 48\nk: [60, 0, 32, 0, 60, 24, 0, 0, 1]"
    assert read(text) == CameraModel(64, 48, 60.0, 60.0, 32.0, 24.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ROS.replace("plumb_bob", "equidistant"), "line 10 has the lens 'equidistant'; plumb_bob,"),
        (OPENCV.replace("fisheye_model: 0", "fisheye_model: 1"), "line 7 is of a fisheye model"),
        (ROS.replace("580.5", "580,5"), "line 7: camera_matrix has 10 numbers, not 9"),
        (ROS.replace("580.5", "wide"), "line 7: its camera_matrix has 'wide', not a number"),
        (ROS.replace("580.5", ".nan"), "has '.nan', not a number"),
        (ROS.replace("image_width: 640", "image_width: 640.5"), "image_width: 640.5 is not a whole number"),
        (ROS.replace("image_width: 640\n", ""), "missing: image_width"),
        (ROS.replace("            0.,  576.6", "            2.,  576.6"), "is not fx 0 cx, 0 fy cy, 0 0 1"),
        (ROS + "image_width: 1280\n", "line 19 has the name 'image_width' a second time"),
        (ROS + "a: b: c\n", "it is neither JSON nor YAML: line 19"),
        ("[\n" * 1000, "it is neither JSON nor YAML"),
        (
            ROWS.replace("dist_coeff", "distorsion"),
            "line 10 has 'distorsion', which is not known: call it distortion_c",
        ),
        (XML, "or YAML of ROS (ost.yaml) or OpenCV (.yml)"),
        (
            VIDERE,
            "it is neither JSON nor YAML: line 6, column 1; a calibration is JSON of `vision calibrate`, or YAML of",
        ),
        ("- 5", "neither a JSON object nor a YAML mapping"),
        ("", "it is empty; a calibration is JSON"),
        (
            RECORDED + RECORDED.replace("580.5", "581.5"),
            "it has several calibrations, which differ: keep one of them",
        ),
        ("a: &a [*a]\nwidth: *a", "width has '', not a number"),
        ("a: \x07", "a character that no YAML has"),
        ('{"width": 640, "widht": 5}', "unknown: 'widht'; did you mean width?"),
        ('{"width": 640}', "missing: height, fx, fy, cx, cy"),
    ],
)
def test_what_is_no_calibration_is_refused_by_its_place(text: str, words: str) -> None:
    with pytest.raises(BadRequest) as caught:
        read(text)
    assert words in str(caught.value)
