"""What is read and written: sources, calibration, tracks, printed tags, settings."""

from __future__ import annotations

import re
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from mavproxy_vision import files
from mavproxy_vision.annotate import annotated, jpeg
from mavproxy_vision.calibration import Board, calibrate, load, save
from mavproxy_vision.camera import Folder, Frame, Posted, decode
from mavproxy_vision.capture import Capture
from mavproxy_vision.errors import BadImage, BadSetting, NoCamera
from mavproxy_vision.model import CameraModel
from mavproxy_vision.printing import POINTS_PER_METRE, tag_pdf
from mavproxy_vision.settings import ModuleSettings
from mavproxy_vision.sighting import Seen
from mavproxy_vision.simulated import parse_placed
from mavproxy_vision.tags import Tag
from mavproxy_vision.track import SIDE, Track
from mavproxy_vision.worker import Watch, Worker


def picture(value: int = 0) -> np.ndarray:
    return np.full((48, 64), value, np.uint8)


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


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
    for data in (b"", b"nonsense"):
        with pytest.raises(BadImage):
            decode(data)
    assert decode(jpeg(picture(50))).shape == (48, 64)


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
    worker = Worker(source, SimpleNamespace(detect=lambda _: ()), lambda seen, _: told.append(seen))
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


def test_a_camera_that_opens_again_but_gives_nothing_is_not_well(tmp_path):
    clock, verdicts = Clock(), []

    class Dead(Posted):
        def read(self):
            clock.now += 0.1
            verdicts.append(worker.verdict())

    worker = Worker(Dead(0.0), SimpleNamespace(detect=lambda _: ()), lambda *_: None, clock)
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
    worker = Worker(source, SimpleNamespace(detect=fail), lambda *_: None)
    worker.start()
    source.post(picture(7))
    for thread in worker._threads:
        thread.join(10)
    assert not any(thread.is_alive() for thread in worker._threads)
    assert worker.health.state == "closed"
    assert "RuntimeError('broken')" in worker.health.error
    worker.stop()


def test_calibration_from_rendered_chessboards(tmp_path):
    true = CameraModel(640, 480, 610.0, 605.0, 325.0, 236.0, (-0.1, 0.02, 0.0, 0.0, 0.0))
    squares = np.kron(np.indices((7, 10)).sum(axis=0) % 2, np.ones((40, 40))) * 200 + 30
    board = np.pad(squares, 60, constant_values=230).astype(np.uint8)
    random = np.random.default_rng(5)
    from mavproxy_vision.rendering import distortion_maps

    maps = distortion_maps(true)
    scale = 0.03 / 40
    for index in range(9):
        turn, _ = cv2.Rodrigues(random.uniform(-0.45, 0.45, 3))
        at = np.array([*random.uniform(-0.05, 0.05, 2), random.uniform(0.5, 0.8)])
        middle = np.array(
            [[scale, 0, -scale * board.shape[1] / 2], [0, scale, -scale * board.shape[0] / 2], [0, 0, 1]]
        )
        pose = np.column_stack([turn[:, 0], turn[:, 1], at])
        flat = cv2.warpPerspective(board, true.matrix @ pose @ middle, (640, 480), borderValue=120)
        cv2.imwrite(str(tmp_path / f"{index}.png"), cv2.remap(flat, *maps, cv2.INTER_LINEAR))
    made = calibrate(tmp_path, Board.parse("chessboard:10x7:0.03"))
    assert made.views >= 5
    assert made.error < 0.3
    assert made.model.fx == pytest.approx(610, rel=0.01)
    assert made.model.fy == pytest.approx(605, rel=0.01)
    save(made.model, tmp_path / "camera.json")
    assert load(tmp_path / "camera.json") == made.model
    assert ModuleSettings({"calibration": str(tmp_path / "camera.json")}).snapshot().model == made.model


def test_a_calibration_that_makes_no_sense_is_refused(tmp_path):
    file = tmp_path / "camera.json"
    with pytest.raises(BadSetting):
        load(file)
    for text in ("", "[]", "{}", '{"width": 1}', '{"fx": -5}', '{"nonsense": 5}'):
        file.write_text(text, encoding="utf-8")
        if text == "{}":
            assert load(file) == CameraModel()
            continue
        if text == '{"width": 1}':
            continue
        with pytest.raises(BadSetting):
            load(file)
    with pytest.raises(BadSetting, match="0 images"):
        calibrate(tmp_path, Board.parse("charuco:7x5:0.03:0.022"))
    with pytest.raises(BadSetting):
        Board.parse("charuco:7")


def test_a_charuco_board_is_read():
    board = Board.parse("charuco:7x5:0.03:0.022")
    image = board.charuco.generateImage((700, 500), marginSize=20)
    on_board, in_image = board.points(image)
    assert len(on_board) == len(in_image) == 24


def position(lat, lon, alt, ms):
    return SimpleNamespace(lat=round(lat * 1e7), lon=round(lon * 1e7), relative_alt=alt * 1000, time_boot_ms=ms)


def test_a_track_is_written_and_drawn(tmp_path):
    track = Track(target=(-35.36319, 149.16518))
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
    assert Track().drawn().min() == 255


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
        with pytest.raises(BadSetting):
            tag_pdf(family, number, size)
    assert b"A0" in tag_pdf("36h11", 0, 0.6)


def test_placed_tags():
    (one, two) = parse_placed("0:0.30@8,-5; 16h5:1:0.1@0,0,90", "36h11")
    assert (one.family, one.north, one.east, one.heading) == ("36h11", 8, -5, 0)
    assert (two.family, two.id, two.heading) == ("16h5", 1, 90)
    assert parse_placed("", "36h11") == ()
    for bad in ("0:0.3", "x", "4x4:0:0.1@1,1", "16h5:30:0.1@0,0"):
        with pytest.raises(BadSetting):
            parse_placed(bad, "36h11")


def test_settings_are_checked_as_they_are_set():
    settings = ModuleSettings()
    for name, value in (("fps", "x"), ("fov", "1000"), ("mount", "1,2"), ("offset", "1"), ("on_failure", "pray")):
        with pytest.raises(BadSetting):
            settings.set(name, value)
    settings.set("mount", "1,2,90")
    settings.set("offset", "0.1,0,0.05")
    mount = settings.snapshot().camera_mount
    assert (mount.roll, mount.pitch, mount.yaw, mount.offset) == (1, 2, 90, (0.1, 0, 0.05))


def test_the_prompts_file_commands(tmp_path):
    seen = Seen(1, 0.0, 0.0, 0.0, (64, 48), ())
    assert files.snapshot([str(tmp_path / "a.png")], seen, picture(9)).startswith("wrote ")
    assert files.tag([str(tmp_path / "t.pdf"), "--family", "16h5", "--id", "2"], "36h11", Tag(0, 0.1)).startswith(
        "wrote"
    )
    assert (tmp_path / "t.pdf").read_bytes().startswith(b"%PDF")
    assert files.snapshot(["a.png"], None, None) == "there is no frame yet"
    for call in (
        lambda: files.snapshot([], seen, picture()),
        lambda: files.tag([], "36h11", Tag(0, 0.1)),
        lambda: files.tag(["a.pdf", "--size", "x"], "36h11", Tag(0, 0.1)),
        lambda: files.calibrated(["a"]),
    ):
        with pytest.raises(BadSetting):
            call()


def test_an_annotated_frame_has_colour():
    seen = Seen(1, 0.0, 0.0, 0.0, (64, 48), ())
    drawn = annotated(picture(80), seen, ["camera: ok"])
    assert drawn.shape == (48, 64, 3)
    assert jpeg(drawn)[:2] == b"\xff\xd8"
