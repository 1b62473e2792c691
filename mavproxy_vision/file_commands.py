"""The commands at the prompt that read or write files; each returns the line to print.

Raises:
    OSError: a file cannot be read or written.
    SettingError: the words or the files' contents are wrong.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from typing import NoReturn

import cv2

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.values import path_of
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.overlay import annotated
from mavproxy_vision.apriltag.tag_layout import Tag
from mavproxy_vision.apriltag.tag_pdf import tag_pdf
from mavproxy_vision.camera.calibration import Board, calibrate, save
from mavproxy_vision.camera.source import Image


class _Words(argparse.ArgumentParser):
    """A parser that neither prints nor exits: MAVProxy goes on."""

    def error(self, message: str) -> NoReturn:
        raise SettingError(f"tag FILE.pdf [--family 36h11] [--id 0] [--size 0.15]: {message}")


def outcome(work: Callable[[], str]) -> str:
    """The line that a command returns, or the reason why a file or OpenCV ended it.

    Raises:
        SettingError: as the command.
    """
    try:
        return work()
    except OSError as error:
        return f"{error.filename or 'a file'}: {os.strerror(error.errno or 0)}"
    except cv2.error as error:
        return str(error.err)


def calibrated(args: list[str]) -> str:
    """`FOLDER BOARD [FILE]`: make a camera model of the folder's images."""
    if len(args) not in (2, 3):
        raise SettingError("calibrate FOLDER charuco:7x5:0.03:0.022|chessboard:9x6:0.025 [FILE]")
    file = path_of(args[2] if len(args) == 3 else "camera.json", "FILE")
    result = calibrate(path_of(args[0], "FOLDER"), Board.parse(args[1]))
    save(result.model, file)
    focal = f"fx {result.model.fx:.1f}, fy {result.model.fy:.1f}"
    return (
        f"{result.views} views, error {result.error:.2f} px, {focal}; wrote {file}: `vision set calibration {file}`"
    )


def snapshot(args: list[str], result: FrameResult | None, image: Image | None) -> str:
    """`FILE`: write the newest frame, with its tags drawn in."""
    if len(args) != 1:
        raise SettingError("snapshot FILE.png")
    if result is None or image is None:
        return "there is no frame yet"
    file = path_of(args[0], "FILE")
    try:
        encoded, data = cv2.imencode(file.suffix or ".png", annotated(image, result, []))
    except cv2.error:  # the supported formats depend on OpenCV's build
        encoded = False
    if not encoded:
        raise SettingError(f"{file.name}: OpenCV writes no {file.suffix} files; .png and .jpg it does")
    file.write_bytes(data.tobytes())
    return f"wrote {file}"


def tag(args: list[str], family: str, main: Tag) -> str:
    """`FILE.pdf [--family F] [--id N] [--size M]`: write a tag to scale; `main` and `family` are the defaults."""
    parser = _Words("vision tag", add_help=False)
    parser.add_argument("file")
    parser.add_argument("--family", default=family)
    parser.add_argument("--id", type=int, default=main.id)
    parser.add_argument("--size", type=float, default=main.size)
    chosen = parser.parse_args(args)
    file = path_of(chosen.file, "FILE")
    file.write_bytes(tag_pdf(chosen.family, chosen.id, chosen.size))
    return f"wrote {file}"
