"""Rotations, the mount, the camera model, tags: against numbers worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision.apriltag.tag_layout import Tag, parse_families, parse_tags, target_from
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, heading_frame, limited, vector


def test_a_level_camera_sees_what_lies_below_the_vehicle():
    assert Mount().sighted((0, 0, 5), Attitude()) == pytest.approx([0, 0, 5])


def test_the_top_of_the_image_is_forward_and_its_right_is_right():
    mount = Mount()
    assert mount.sighted((0, -1, 5), Attitude()) == pytest.approx([1, 0, 5])
    assert mount.sighted((1, 0, 5), Attitude()) == pytest.approx([0, 1, 5])


def test_heading_east_forward_is_east():
    assert Mount().sighted((0, -1, 5), Attitude(yaw=math.pi / 2)) == pytest.approx([0, 1, 5], abs=1e-9)


def test_mount_yaw_90_has_the_top_of_the_image_to_the_right():
    assert Mount(yaw=90).sighted((0, -1, 5), Attitude()) == pytest.approx([0, 1, 5], abs=1e-9)


def test_leaning_right_the_middle_of_the_image_lies_left():
    relative = Mount().sighted((0, 0, 5), Attitude(roll=math.radians(10)))
    assert relative == pytest.approx([0, -5 * math.sin(math.radians(10)), 5 * math.cos(math.radians(10))])


def test_a_gimbal_takes_the_lean_away():
    assert Mount(gimbal=True).sighted((0, 0, 5), Attitude(roll=0.2, pitch=0.1)) == pytest.approx([0, 0, 5])


def test_the_offset_turns_with_the_vehicle():
    mount = Mount(offset=(0.1, 0.0, 0.05))
    assert mount.sighted((0, 0, 5), Attitude(yaw=math.pi)) == pytest.approx([-0.1, 0, 5.05], abs=1e-9)


def test_rotations_keep_lengths_and_right_handedness():
    matrix = Attitude(0.3, -0.2, 1.1).matrix
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1)
    assert np.linalg.det(Mount(5, 6, 77).in_body) == pytest.approx(1)


def test_heading_frame_is_what_the_nose_calls_forward():
    assert heading_frame(vector(0, 2, -1), math.pi / 2) == pytest.approx((2, 0, -1), abs=1e-12)


def test_limited_keeps_the_direction():
    assert limited(vector(3, 4, 0), 1) == pytest.approx([0.6, 0.8, 0])
    assert limited(vector(0.3, 0.4, 0), 1) == pytest.approx([0.3, 0.4, 0])


def test_the_model_of_a_field_of_view():
    model = CameraModel.from_field_of_view(640, 480, 56.145)
    assert model.fx == pytest.approx(600, abs=0.1)
    assert (model.cx, model.cy) == (319.5, 239.5)
    assert model.footprint(10) == pytest.approx(8, abs=0.01)


def test_ten_metres_want_a_tag_of_about_thirty_centimetres():
    assert CameraModel().detection_range(0.3, 8) == pytest.approx(9.4, abs=0.1)


def test_a_small_tag_clips_at_a_quarter_of_a_metre():
    assert CameraModel().clip_height(0.166) == pytest.approx(0.26, abs=0.01)


def test_a_scaled_model_sees_the_same_ray_in_the_same_place():
    half = CameraModel().scaled_to(320, 240)
    assert half.fx == 300
    assert (half.cx, half.cy) == (159.5, 119.5)


def test_tag_lists():
    assert parse_tags("0:0.30 1:0.06@0.25,-0.1") == (Tag(0, 0.3), Tag(1, 0.06, 0.25, -0.1))
    for bad in ("", "0", "0:", "0:0.3@1", "0:-1", "0:0.3 0:0.2", "x:1"):
        with pytest.raises(SettingError):
            parse_tags(bad)


def test_families():
    assert parse_families("tag36h11, 16H5") == ("36h11", "16h5")
    for bad in ("", "4x4"):
        with pytest.raises(SettingError):
            parse_families(bad)


def test_from_a_tag_to_its_target():
    beside = Tag(1, 0.06, right=0.25, up=0.1)
    assert target_from(beside, (0.0, 1.0)) == pytest.approx((-0.1, -0.25))  # its right is east, its top north
    assert target_from(beside, (1.0, 0.0)) == pytest.approx((-0.25, 0.1))  # its right is north, its top west
