"""What is read and written: sources, calibration, tracks, printed tags, settings."""

from __future__ import annotations

import json
import math
import re
import struct
import zlib
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision import file_commands
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.overlay import annotated, jpeg
from mavproxy_vision.apriltag.tag_layout import Tag
from mavproxy_vision.apriltag.tag_pdf import POINTS_PER_METRE, tag_pdf
from mavproxy_vision.camera.calibration import Board, calibrate, load, save
from mavproxy_vision.camera.image_size import size_of
from mavproxy_vision.camera.opencv_capture import Capture
from mavproxy_vision.camera.source import Folder, Frame, Posted, decode, decode_any, grey
from mavproxy_vision.errors import BadImage, NoCamera
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.landing.flight_log import SIDE, FlightLog
from mavproxy_vision.settings import VisionModuleSettings
from mavproxy_vision.tracking.capture_worker import Watch, Worker
from mavproxy_vision.tracking.tracker import Tracker


def picture(value: int = 0) -> np.ndarray:
    return np.full((48, 64), value, np.uint8)


def png_header(width: int, height: int) -> bytes:
    """A PNG that says it is so large (px), and holds next to nothing."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    size = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", size) + chunk(b"IDAT", zlib.compress(b"\0")) + chunk(b"IEND", b"")


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def blind(detect=lambda _: ()):
    """A detector that sees nothing."""
    return SimpleNamespace(detect=detect, model=CameraModel())


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
    for asked in (source.read, source.open):
        with pytest.raises(NoCamera, match="No such file"):
            asked()
    away.rename(folder)
    source.open()
    assert source.read().image[0, 0] == 10
    assert capfd.readouterr() == ("", "")  # OpenCV says nothing into the pilot's prompt


def test_a_file_that_is_no_image_is_passed_over(tmp_path):
    (tmp_path / "a.png").write_bytes(b"nonsense")
    (tmp_path / "b.png").write_bytes(png_header(40_000, 40_000))
    cv2.imwrite(str(tmp_path / "c.bmp"), picture(10))
    source = Folder(tmp_path, 0.0, 1000.0)
    source.open()
    frames = [source.read() for _ in range(3)]
    assert frames[:2] == [None, None]
    assert frames[2].image.shape == (48, 64)


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


def test_posted_frames_wait_and_the_oldest_gives_way():
    source = Posted(0.1, Clock())
    for value in (1, 2, 3):
        source.post(picture(value), latency=0.02 * value)
    frames = [source.read(), source.read()]
    assert [int(frame.image[0, 0]) for frame in frames] == [2, 3]
    assert frames[1].captured_at == pytest.approx(99.94)


def test_what_is_no_image_is_said_so():
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
        with pytest.raises(BadImage, match="at most 40 megapixels"):
            decode(data)


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def test_an_image_that_costs_more_than_its_size_tells_is_not_decoded(monkeypatch):
    monkeypatch.setattr(cv2, "imdecode", None)
    png = cv2.imencode(".png", picture(50))[1].tobytes()
    animation = chunk(b"tEXt", b"about IDAT") + chunk(b"acTL", struct.pack(">II", 50, 0))
    with pytest.raises(BadImage, match="an animated PNG is not taken"):
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


def test_frames_of_all_kinds_become_grey_of_eight_bits():
    dark, light = np.array([10, 10, 10, 255], np.uint8), np.array([10, 200, 90, 255], np.uint8)
    bgra = np.stack([dark, light])[None]
    assert grey(bgra).tolist() == grey(bgra[..., :3]).tolist() == [[10, round(0.114 * 10 + 0.587 * 200 + 0.299 * 90)]]
    assert grey(np.full((4, 4), 0x1234, np.uint16)).tolist() == np.full((4, 4), 0x12).tolist()
    assert grey(np.full((4, 4, 3), 0x1234, np.uint16)).dtype == np.uint8
    assert grey(bgra[..., :1]).shape == grey(bgra[..., :2]).shape == (1, 2)
    for strange in (np.zeros((4, 4), np.float32), np.zeros((4, 4, 5), np.uint8), np.zeros((4, 4), np.int16)):
        with pytest.raises(NoCamera, match="no picture"):
            grey(strange)


def test_a_repeated_frame_is_not_new_and_a_silent_camera_is_noticed():
    watch = Watch(True, 100.0)
    assert watch.is_new(Frame(picture(1), 100.1, 100.1))
    assert not watch.is_new(Frame(picture(1), 100.2, 100.2))
    assert watch.verdict(100.5) == "ok"
    assert not watch.is_new(Frame(picture(1), 100.7, 100.7))
    assert watch.verdict(100.7) == "frozen"
    assert watch.verdict(102.0) == "no frames"
    assert watch.is_new(Frame(picture(2), 102.1, 102.1))
    assert watch.verdict(102.2) == "ok"


def test_a_folder_may_repeat_itself():
    watch = Watch(False, 100.0)
    assert watch.is_new(Frame(picture(1), 100.1, 100.1))
    assert watch.is_new(Frame(picture(1), 100.2, 100.2))


def test_the_worker_looks_at_the_newest_frame_and_ends(tmp_path):
    told = []
    source = Posted(0.0)
    worker = Worker(source, blind(), lambda seen, _: told.append(seen))
    worker.start()
    source.post(picture(7))
    for _ in range(500):
        if told:
            break
        worker._stop.wait(0.01)
    worker.stop()
    assert told[0].size == (64, 48)
    assert worker.health.state == "closed"
    assert worker.health.frames == 1


class Script(Posted):
    """Gives the frames of a list, one each 0.1 s, then none; None in it is no frame."""

    def __init__(self, clock, *images):
        super().__init__(0.0)
        self.clock, self.images, self.told = clock, list(images), []
        self.worker = None

    def read(self):
        self.told.append(self.worker.health)
        self.clock.now += 0.1
        image = self.images.pop(0) if self.images else None
        return None if image is None else Frame(image, self.clock.now, self.clock.now)


def watched(*images):
    """A worker that has read these frames, until there were none for too long; and the health before each of them."""
    clock = Clock()
    source = Script(clock, *images)
    worker = source.worker = Worker(source, blind(), lambda *_: None, clock)
    worker._read_until_it_fails()
    return worker, source.told


def test_what_was_wrong_is_forgotten_when_frames_come_again():
    worker, _ = watched(picture(1))
    assert worker.health.error.startswith("no frames for 1.")
    worker.source.images, worker.source.told = [picture(2), picture(3)], []
    worker._read_until_it_fails()
    states = [(health.state, health.error) for health in worker.source.told]
    assert states[0] == ("no frames", worker.health.error)
    assert states[1] == ("ok", "")


def test_frames_of_another_shape_are_not_looked_at():
    wide = np.full((720, 1280), 9, np.uint8)
    worker, told = watched(picture(1), wide, wide + 1, np.full((960, 1280), 7, np.uint8))
    assert [health.state for health in told[:5]] == ["starting", "ok", "wrong shape", "wrong shape", "ok"]
    assert told[2].error == "asked for is 640x480 px or another size of that shape, and 1280x720 came"
    assert told[4].error == ""
    assert worker._newest.image.shape == (960, 1280)
    assert worker.health.skipped == 1  # the two wide ones were not even kept


def test_a_camera_of_the_wrong_shape_is_no_camera_to_fly_by():
    worker, told = watched(np.full((720, 1280), 9, np.uint8))
    assert told[1].state == "wrong shape"
    with pytest.raises(NoCamera, match=r"the camera: wrong shape \(asked for is 640x480 px .* 1280x720 came\)"):
        Tracker.require_camera(SimpleNamespace(worker=worker, health=told[1]))


def test_a_lens_that_is_scaled_keeps_its_shape():
    for width, height in ((640, 480), (320, 240), (1296, 972), (648, 480)):
        assert CameraModel().misfit(width, height) == ""
    for width, height in ((1280, 720), (480, 640), (640, 512), (1, 1), (660, 480)):
        assert f"{width}x{height} came" in CameraModel().misfit(width, height)


def test_a_defect_is_not_forgotten():
    worker, _ = watched()
    worker._guarded(lambda: 1 / 0)
    worker._take(Frame(picture(5), 100.0, 100.0))
    assert "ZeroDivisionError" in worker.health.error


def test_a_camera_that_opens_again_but_gives_nothing_is_not_well(tmp_path):
    clock, verdicts = Clock(), []

    class Dead(Posted):
        def read(self):
            clock.now += 0.1
            verdicts.append(worker.verdict())

    worker = Worker(Dead(0.0), blind(), lambda *_: None, clock)
    worker._read_until_it_fails()
    assert (verdicts[0], verdicts[-1]) == ("starting", "no frames")  # but not for a moment "ok"
    assert "ok" not in verdicts
    verdicts.clear()
    worker._read_until_it_fails()
    assert set(verdicts) == {"no frames"}


@pytest.mark.parametrize("broken", ["camera", "detector"])
def test_a_defect_in_either_thread_is_no_camera(broken):
    def fail(*_):
        raise RuntimeError("broken")

    source = Posted(0.0)
    if broken == "camera":
        source.read = fail
    worker = Worker(source, blind(fail), lambda *_: None)
    worker.start()
    source.post(picture(7))
    for thread in worker._threads:
        thread.join(10)
    assert not any(thread.is_alive() for thread in worker._threads)
    assert worker.health.state == "closed"
    assert "RuntimeError('broken')" in worker.health.error
    worker.stop()


def test_calibration_from_rendered_chessboards(tmp_path, boards):
    true = CameraModel(640, 480, 610.0, 605.0, 325.0, 236.0, (-0.1, 0.02, 0.0, 0.0, 0.0))
    boards.draw(tmp_path, true)
    made = calibrate(tmp_path, Board.parse("chessboard:10x7:0.03"))
    assert made.views >= 5
    assert made.error < 0.3
    assert made.model.fx == pytest.approx(610, rel=0.01)
    assert made.model.fy == pytest.approx(605, rel=0.01)
    save(made.model, tmp_path / "camera.json")
    assert load(tmp_path / "camera.json") == made.model
    assert VisionModuleSettings({"calibration": str(tmp_path / "camera.json")}).snapshot().model == made.model


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
        *(({name: ...}, f"missing are .'{name}'") for name in ("width", "height", "fx", "fy", "cx", "cy")),
        ({"nonsense": 5}, "nobody knows .'nonsense'"),
        ({"width": "640"}, "width: '640' is not a number"),
        ({"height": True}, "height: True is not a number"),
        ({"width": 640.5}, "width: 640.5 is not a whole number"),
        ({"width": 0}, "a size of 0x480 px"),
        ({"height": -480}, "a size of 640x-480 px"),
        ({"width": 100_000}, "a size of 100000x480 px"),
        ({"fx": 0}, "focal lengths of 0 and"),
        ({"fy": -600}, "focal lengths of 600 and -600"),
        ({"fx": 1e5}, "focal lengths of 100000"),
        ({"cx": math.nan}, "cx: nan is not a number"),
        ({"fy": math.inf}, "fy: inf is not a number"),
        ({"fx": 10**400}, "fx: 1000"),
        ({"cy": 481}, "outside the frame"),
        ({"distortion": [0.1, 0.2, 0.3]}, "3 coefficients of distortion"),
        ({"distortion": [math.nan, 0, 0, 0, 0]}, "distortion: nan"),
        ({"distortion": "none"}, "distortion: 'none' is not a list"),
        ({"distortion": {"k1": 1}}, "is not a list"),
    ],
)
def test_a_calibration_that_makes_no_sense_is_refused(tmp_path, changed, why):
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(calibration(**changed)), encoding="utf-8")
    with pytest.raises(SettingError, match=f"is no calibration: .*{why}"):
        load(file)


@pytest.mark.parametrize("text", ["", "[]", "{}", "5", "null", "[" * 100_000, b"\xff\xfe"])
def test_a_file_that_is_no_calibration_is_refused(tmp_path, text):
    file = tmp_path / "camera.json"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(SettingError, match="is no calibration"):
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
        ("charuco:7x5:0.03:0.03", "markers less"),
        ("charuco:7x5:0.03:-0.02", "markers less"),
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


def test_images_that_determine_no_camera_are_told(tmp_path):
    squares = np.kron(np.indices((7, 10)).sum(axis=0) % 2, np.ones((40, 40))) * 200 + 30
    flat = np.pad(squares, 40, constant_values=230).astype(np.uint8)
    for index in range(5):
        cv2.imwrite(str(tmp_path / f"{index}.png"), flat)
    with pytest.raises(SettingError, match="the images make no camera: "):
        calibrate(tmp_path, Board.parse("chessboard:10x7:0.03"))


def test_a_charuco_board_is_read():
    board = Board.parse("charuco:7x5:0.03:0.022")
    image = board.charuco.generateImage((700, 500), marginSize=20)
    on_board, in_image = board.points(image)
    assert len(on_board) == len(in_image) == 24


def position(lat, lon, alt, ms):
    return SimpleNamespace(lat=round(lat * 1e7), lon=round(lon * 1e7), relative_alt=alt * 1000, time_boot_ms=ms)


def test_a_track_is_written_and_drawn(tmp_path):
    track = FlightLog(target=(-35.36319, 149.16518))
    for step in range(20):
        track.add(position(-35.363261 + 4e-6 * step, 149.165230 - 3e-6 * step, 5, 1000 + 200 * step))
    track.add(position(0, 0, 0, 500))  # out of order
    track.write(tmp_path / "track.csv")
    lines = (tmp_path / "track.csv").read_text().splitlines()
    assert lines[0] == "lat,lon,alt,time"
    assert len(lines) == 21
    assert lines[1] == "-35.3632610,149.1652300,5.000,1.000"
    track.plot(tmp_path / "track.png")
    assert cv2.imread(str(tmp_path / "track.png")).shape == (SIDE, SIDE, 3)
    assert FlightLog().drawn().min() == 255


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


def test_the_prompts_file_commands(tmp_path):
    seen = FrameResult(1, 0.0, 0.0, 0.0, (64, 48), ())
    assert file_commands.snapshot([str(tmp_path / "a.png")], seen, picture(9)).startswith("wrote ")
    assert file_commands.tag(
        [str(tmp_path / "t.pdf"), "--family", "16h5", "--id", "2"], "36h11", Tag(0, 0.1)
    ).startswith("wrote")
    assert (tmp_path / "t.pdf").read_bytes().startswith(b"%PDF")
    assert file_commands.snapshot(["a.png"], None, None) == "there is no frame yet"
    for call in (
        lambda: file_commands.snapshot([], seen, picture()),
        lambda: file_commands.tag([], "36h11", Tag(0, 0.1)),
        lambda: file_commands.tag(["a.pdf", "--size", "x"], "36h11", Tag(0, 0.1)),
        lambda: file_commands.tag([str(tmp_path / "a.pdf"), "--size", "1e-300"], "36h11", Tag(0, 0.1)),
        lambda: file_commands.tag([str(tmp_path / "a.pdf"), "--size", "nan"], "36h11", Tag(0, 0.1)),
        lambda: file_commands.tag([str(tmp_path / "a.pdf"), "--id", "587"], "36h11", Tag(0, 0.1)),
        lambda: file_commands.tag(["~nobody_xyz/a.pdf"], "36h11", Tag(0, 0.1)),
        lambda: file_commands.tag(["-h"], "36h11", Tag(0, 0.1)),
        lambda: file_commands.snapshot(["~nobody_xyz/a.png"], seen, picture()),
        lambda: file_commands.snapshot([str(tmp_path / "a.xyz")], seen, picture()),
        lambda: file_commands.snapshot(["a\0.png"], seen, picture()),
        lambda: file_commands.calibrated(["a"]),
        lambda: file_commands.calibrated(["~nobody_xyz", "charuco:7x5:0.03"]),
        lambda: file_commands.calibrated([str(tmp_path), "charuco:7x5:0.03", "~nobody_xyz/camera.json"]),
    ):
        with pytest.raises(SettingError) as refusal:
            call()
        assert "\n" not in str(refusal.value)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.png", "t.pdf"]


def test_an_annotated_frame_has_colour():
    seen = FrameResult(1, 0.0, 0.0, 0.0, (64, 48), ())
    drawn = annotated(picture(80), seen, ["camera: ok"])
    assert drawn.shape == (48, 64, 3)
    assert jpeg(drawn)[:2] == b"\xff\xd8"
