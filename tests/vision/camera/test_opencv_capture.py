from __future__ import annotations

import cv2
import pytest

from mavproxy_vision.camera.opencv_capture import Capture
from tests.support.pictures import picture


def test_a_video_file_is_read(tmp_path):
    file = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"MJPG"), 20, (64, 48))
    for value in (10, 200):
        writer.write(cv2.cvtColor(picture(value), cv2.COLOR_GRAY2BGR))
    writer.release()
    source = Capture(str(file), 0.0, (64, 48), 1000.0)
    source.open()
    assert int(source.read().image.mean()) == pytest.approx(10, abs=4)
    assert int(source.read().image.mean()) == pytest.approx(200, abs=4)
    assert source.read() is None
    source.close()
