from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision import file_commands
from mavproxy_vision.apriltag.detection import FrameResult
from mavproxy_vision.apriltag.tag_layout import Tag
from tests.support.pictures import picture


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


def test_a_file_or_opencv_that_ends_a_command_is_one_line(tmp_path: Path) -> None:
    missing = tmp_path / "none" / "t.pdf"
    tag = file_commands.outcome(lambda: file_commands.tag([str(missing)], "36h11", Tag(0, 0.1)))
    assert tag == f"{missing}: No such file or directory"

    def resize() -> str:
        return str(cv2.resize(np.zeros((0, 0)), (1, 1)))

    assert "empty" in file_commands.outcome(resize)
    assert file_commands.outcome(lambda: "wrote it") == "wrote it"
