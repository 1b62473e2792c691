"""Folders, posted frames, and what is decoded."""

from __future__ import annotations

import contextlib
import struct

import cv2
import numpy as np
import pytest

from mavproxy_vision.apriltag.overlay import jpeg
from mavproxy_vision.camera.opencv_capture import Capture
from mavproxy_vision.camera.source import Folder, Posted, decode, decode_any, grey
from mavproxy_vision.errors import BadImage, NoCamera
from tests.support.clock import Clock
from tests.support.pictures import chunk, picture, png_header


def test_a_folder_is_read_in_order_over_and_over(tmp_path):
    for value in (10, 20):
        cv2.imwrite(str(tmp_path / f"{value}.png"), picture(value))
    source = Folder(tmp_path, 0.05, 1000.0, Clock())
    source.open()
    frames = [source.read() for _ in range(3)]
    assert [int(frame.image[0, 0]) for frame in frames] == [10, 20, 10]
    assert frames[0].captured_at == pytest.approx(99.95)


def test_an_empty_folder_and_a_missing_camera_are_no_camera(tmp_path):
    with pytest.raises(NoCamera):
        Folder(tmp_path, 0.0, 10.0).open()
    with pytest.raises(NoCamera):
        Capture(str(tmp_path / "none.mp4"), 0.0, (64, 48), 10.0).open()


def test_a_folder_that_vanishes_is_no_camera_until_it_is_back(tmp_path, capfd):
    folder, away = tmp_path / "here", tmp_path / "away"
    folder.mkdir()
    cv2.imwrite(str(folder / "a.png"), picture(10))
    source = Folder(folder, 0.0, 1000.0)
    source.open()
    folder.rename(away)
    for requested in (source.read, source.open):
        with pytest.raises(NoCamera, match="No such file"):
            requested()
    away.rename(folder)
    source.open()
    assert source.read().image[0, 0] == 10
    assert capfd.readouterr() == ("", "")  # OpenCV says nothing into the pilot's prompt


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_does_not_turn_a_picture(orientation):
    """A camera on a vehicle writes how it was held; its mount is `mount`."""
    shot = np.zeros((48, 64), np.uint8)
    shot[:24, :32] = 200
    data = cv2.imencode(".jpg", shot)[1].tobytes()
    entry = struct.pack(">HHIHH", 0x0112, 3, 1, orientation, 0)
    exif = b"Exif\0\0" + b"MM\0*" + struct.pack(">IH", 8, 1) + entry + struct.pack(">I", 0)
    turned = data[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + data[2:]
    for seen in (decode(turned), decode_any(turned)):
        assert (seen == decode(data)).all()


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_a_damaged_picture_says_nothing_into_the_pilots_prompt(suffix, capfd):
    noise = np.random.default_rng(1).integers(0, 255, (480, 640), dtype=np.uint8)
    data = bytearray(cv2.imencode(suffix, noise)[1].tobytes())
    for damaged in (data[: len(data) // 2], data[:2000] + bytes(50) + data[2050:]):
        with contextlib.suppress(BadImage):
            decode_any(bytes(damaged))
    assert capfd.readouterr() == ("", "")


def test_a_file_that_is_no_image_is_passed_over(tmp_path):
    (tmp_path / "a.png").write_bytes(b"nonsense")
    (tmp_path / "b.png").write_bytes(png_header(40_000, 40_000))
    cv2.imwrite(str(tmp_path / "c.bmp"), picture(10))
    source = Folder(tmp_path, 0.0, 1000.0)
    source.open()
    frames = [source.read() for _ in range(3)]
    assert frames[:2] == [None, None]
    assert frames[2].image.shape == (48, 64)


def test_posted_frames_wait_and_the_oldest_gives_way():
    source = Posted(0.1, Clock())
    for value in (1, 2, 3):
        source.post(picture(value), latency=0.02 * value)
    frames = [source.read(), source.read()]
    assert [int(frame.image[0, 0]) for frame in frames] == [2, 3]
    assert frames[1].captured_at == pytest.approx(99.94)


def test_data_that_is_no_image_is_refused():
    for data in (b"", b"nonsense", b"\xff\xd8\xff", png_header(64, 48)[:20], png_header(0, 48)):
        with pytest.raises(BadImage, match="not an image"):
            decode(data)
    assert decode(jpeg(picture(50))).shape == (48, 64)


def test_an_image_that_would_fill_the_memory_is_not_decoded(monkeypatch):
    monkeypatch.setattr(cv2, "imdecode", None)
    _, small = cv2.imencode(".jpg", picture(50))
    at = small.tobytes().index(b"\xff\xc0") + 5
    large = small.tobytes()[:at] + struct.pack(">HH", 40_000, 40_000) + small.tobytes()[at + 4 :]
    for data in (png_header(40_000, 40_000), png_header(2**31 - 1, 1), large):
        with pytest.raises(BadImage, match="the limit is 40 megapixels"):
            decode(data)


def test_an_image_that_costs_more_than_its_size_suggests_is_not_decoded(monkeypatch):
    monkeypatch.setattr(cv2, "imdecode", None)
    png = cv2.imencode(".png", picture(50))[1].tobytes()
    animation = chunk(b"tEXt", b"about IDAT") + chunk(b"acTL", struct.pack(">II", 50, 0))
    with pytest.raises(BadImage, match="an animated PNG is not accepted"):
        decode(png[:33] + animation + png[33:])
    progressive = cv2.imencode(".jpg", picture(50), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    scan = progressive[progressive.rfind(b"\xff\xda") : -2]
    with pytest.raises(BadImage, match="more than 30 scans"):
        decode(progressive[:-2] + scan * 1000 + progressive[-2:])


@pytest.mark.parametrize("options", [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]])
def test_an_image_that_only_looks_costly_is_decoded(options):
    png = cv2.imencode(".png", picture(50))[1].tobytes()
    assert decode(png[:33] + chunk(b"tEXt", b"about acTL") + png[33:]).shape == (48, 64)
    colour = np.dstack([picture(50)] * 3)
    assert decode(cv2.imencode(".jpg", colour, options)[1].tobytes()).shape == (48, 64)


@pytest.mark.parametrize("kind", [".tiff", ".webp", ".bmp", ".pgm"])
def test_other_kinds_are_not_decoded_whatever_their_header_says(kind, monkeypatch):
    data = cv2.imencode(kind, picture(50))[1].tobytes()
    monkeypatch.setattr(cv2, "imdecode", None)
    with pytest.raises(BadImage, match="JPEG or PNG"):
        decode(data)


def test_what_opencv_refuses_is_no_image():
    with pytest.raises(BadImage):
        decode_any(png_header(40_000, 40_000))


def test_frames_of_all_kinds_become_grey_of_eight_bits():
    dark, light = np.array([10, 10, 10, 255], np.uint8), np.array([10, 200, 90, 255], np.uint8)
    bgra = np.stack([dark, light])[None]
    assert grey(bgra).tolist() == grey(bgra[..., :3]).tolist() == [[10, round(0.114 * 10 + 0.587 * 200 + 0.299 * 90)]]
    assert grey(np.full((4, 4), 0x1234, np.uint16)).tolist() == np.full((4, 4), 0x12).tolist()
    assert grey(np.full((4, 4, 3), 0x1234, np.uint16)).dtype == np.uint8
    assert grey(bgra[..., :1]).shape == grey(bgra[..., :2]).shape == (1, 2)
    for strange in (np.zeros((4, 4), np.float32), np.zeros((4, 4, 5), np.uint8), np.zeros((4, 4), np.int16)):
        with pytest.raises(NoCamera, match="not a picture"):
            grey(strange)
