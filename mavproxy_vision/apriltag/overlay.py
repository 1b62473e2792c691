"""Draws detections into a frame, for people. Pure."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mavproxy_vision.apriltag.detection import FrameResult

GREEN, RED, YELLOW = (80, 220, 80), (60, 60, 230), (60, 220, 230)


def annotated(image: NDArray[np.uint8], result: FrameResult, lines: list[str]) -> NDArray[np.uint8]:
    """A colour copy of a grey frame with outlined tags, a marked centre, and lines of text."""
    drawn: Any = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    height, width = image.shape
    cv2.drawMarker(drawn, (width // 2, height // 2), YELLOW, cv2.MARKER_CROSS, 24, 1, cv2.LINE_AA)
    for detection in result.detections:
        corners = np.round(np.asarray(detection.corners) * 8).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(drawn, [corners], True, GREEN, 2, cv2.LINE_AA, shift=3)
        first = tuple(int(value) for value in np.round(detection.corners[0]))
        cv2.circle(drawn, first, 4, RED, -1, cv2.LINE_AA)  # top left
        x, y = (round(value) for value in np.mean(detection.corners, axis=0))
        cv2.line(drawn, (width // 2, height // 2), (x, y), YELLOW, 1, cv2.LINE_AA)
        distance = "" if detection.distance is None else f" {detection.distance:.2f} m"
        _text(drawn, f"{detection.family} {detection.id}{distance}", (first[0] + 8, max(first[1] - 8, 16)))
    for number, line in enumerate(lines):
        _text(drawn, line, (8, 20 + 20 * number))
    return np.asarray(drawn, np.uint8)


def _text(image: Any, text: str, at: tuple[int, int]) -> None:
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    cv2.rectangle(image, (at[0] - 3, at[1] - height - 2), (at[0] + width + 3, at[1] + below), (0, 0, 0), -1)
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)


def jpeg(image: NDArray[np.uint8], quality: int = 80) -> bytes:
    """The image as JPEG."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return bytes(data.tobytes())
