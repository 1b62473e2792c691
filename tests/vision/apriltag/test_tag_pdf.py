from __future__ import annotations

import io
import re

import cv2
import numpy as np
import pypdf
import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision.apriltag.tag_pdf import POINTS_PER_METRE, tag_pdf


def test_a_printed_tag_is_to_scale_and_can_be_read():
    text = tag_pdf("36h11", 3, 0.15).decode("latin-1")
    squares = np.array([[float(v) for v in m] for m in re.findall(r"([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+) re f", text)])
    assert "A4" in text
    assert np.ptp(np.append(squares[:, 0], squares[:, 0] + squares[:, 2])) == pytest.approx(
        0.15 * POINTS_PER_METRE, abs=0.1
    )
    canvas = np.full((842, 595), 255, np.uint8)
    for x, y, width, height in squares:
        cv2.rectangle(canvas, (round(x), round(842 - y - height)), (round(x + width), round(842 - y)), 0, -1)
    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    assert cv2.aruco.ArucoDetector(words).detectMarkers(canvas)[1].ravel().tolist() == [3]


def test_a_pdf_reader_finds_one_page_of_the_papers_size_with_the_tags_name():
    (page,) = pypdf.PdfReader(io.BytesIO(tag_pdf("36h11", 3, 0.15)), strict=True).pages
    millimetres = [float(points) / 72 * 25.4 for points in page.mediabox]
    assert millimetres == pytest.approx([0, 0, 210, 297], abs=0.01)
    assert "AprilTag 36h11 id 3: black square 150 mm" in page.extract_text()


def test_tags_that_cannot_be_printed():
    for family, number, size in (
        ("4x4", 0, 0.1),
        ("16h5", 30, 0.1),
        ("16h5", -1, 0.1),
        ("36h11", 0, 0),
        ("36h11", 0, 1),
    ):
        with pytest.raises(SettingError):
            tag_pdf(family, number, size)
    assert b"A0" in tag_pdf("36h11", 0, 0.6)
