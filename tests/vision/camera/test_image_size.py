from __future__ import annotations

import cv2
import numpy as np
import pytest

from mavproxy_vision.camera.image_size import size_of


@pytest.mark.parametrize("options", [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 2]])
def test_the_size_is_read_from_the_header(options):
    image = np.zeros((48, 64), np.uint8)
    plain = cv2.imencode(".jpg", image, options)[1].tobytes()
    assert size_of(plain) == (64, 48)
    assert size_of(plain[:2] + b"\xff\xff\xfe\x00\x06note" + plain[2:]) == (64, 48)  # a comment, and what fills up
    assert size_of(cv2.imencode(".png", image)[1].tobytes()) == (64, 48)
    for hidden in (b"\xff\xd0", b"\xff\x00\x00\x02", b"\x00"):  # what decoders treat each in their own way
        assert size_of(plain[:2] + hidden + plain[2:]) is None
    for length in range(20):
        assert size_of(plain[:length]) is None
