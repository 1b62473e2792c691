"""What native libraries write, and what others write meanwhile."""

from __future__ import annotations

import os

import pytest

from mavproxy_vision.camera.native_stderr import STDERR, without_native_warnings


def test_lines_of_picture_libraries_are_dropped_and_others_come_after(capfd):
    with without_native_warnings():
        os.write(
            STDERR, b"Corrupt JPEG data: premature end of data segment\nsomebody's trace\nlibpng error: bad CRC\n"
        )
        assert capfd.readouterr().err == ""
    assert capfd.readouterr().err == "somebody's trace\n"


def test_stderr_is_back_after_an_error(capfd):
    with pytest.raises(ZeroDivisionError), without_native_warnings():
        raise ZeroDivisionError
    os.write(STDERR, b"after\n")
    assert capfd.readouterr().err == "after\n"
