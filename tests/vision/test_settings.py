"""Settings: what is taken, what is refused with a sentence, and that a refusal changes nothing."""

from __future__ import annotations

import json

import pytest

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision.apriltag.tag_layout import FAMILIES, Tag, parse_tags
from mavproxy_vision.camera.simulated import parse_placed
from mavproxy_vision.settings import VisionModuleSettings


def refused(settings, name, value):
    """The sentence with which a value is refused, leaving all as it was."""
    before = settings.snapshot()
    with pytest.raises(SettingError) as refusal:
        settings.set(name, value)
    assert settings.snapshot() == before
    sentence = str(refusal.value)
    assert "\n" not in sentence
    return sentence


@pytest.mark.parametrize("value", ["nan", "inf", "1e400", "-361", "0,0,1e9", "1,2", "1..2", "", ",,", "1,2,3,4", "x"])
def test_a_mount_is_one_angle_or_three(value):
    assert refused(VisionModuleSettings(), "mount", value).startswith(f"mount: '{value}' ")


@pytest.mark.parametrize("value", ["nan,0,0", "inf,0,0", "1e300,0,0", "0,0,-10.1", "1", "0.1,0", "0,0,0.1.2"])
def test_an_offset_is_three_lengths(value):
    assert refused(VisionModuleSettings(), "offset", value).startswith("offset: ")


def test_mount_and_offset_are_taken():
    settings = VisionModuleSettings()
    settings.set("mount", "1, 2, 90")
    settings.set("offset", "0.1,0,-5e-2")
    mount = settings.snapshot().camera_mount
    assert (mount.roll, mount.pitch, mount.yaw, mount.offset) == (1, 2, 90, (0.1, 0, -0.05))


TAGS = {
    "0:0.3.0": "is not ID:SIZE",
    "0:.": "is not ID:SIZE",
    "0:0.3@1.2.3,4": "is not ID:SIZE",
    "0:0.3@1,4..": "is not ID:SIZE",
    "\u0662:0.3": "is not ID:SIZE",
    "0": "is not ID:SIZE",
    "": "is not ID:SIZE",
    "1" * 5000 + ":0.3": "is not ID:SIZE",
    "0:0": "a size of 0 m",
    "0:-0.3": "a size of -0.3 m",
    "0:10.1": "a size of 10.1 m",
    "0:1e400": "a size of inf m",
    "0:0.3@99999999,0": "farther than 50 m",
    "0:0.3@0,-1e400": "farther than 50 m",
    "0:0.3 1:0.1 0:0.2": "an id twice",
    "587:0.3": "36h11 has no id 587, only 0 to 586",
    "99999:0.3": "36h11 has no id 99999",
}


@pytest.mark.parametrize("value", TAGS)
def test_tags_that_there_cannot_be(value):
    assert TAGS[value] in refused(VisionModuleSettings(), "tags", value)


PLACED = {
    "0:0.3": "is not ID:SIZE@NORTH,EAST",
    "x": "is not ID:SIZE@NORTH,EAST",
    "0:0.3@8..1,2": "is not ID:SIZE@NORTH,EAST",
    "0:0.3@8,-5,9.9.9": "is not ID:SIZE@NORTH,EAST",
    "4x4:0:0.1@1,1": "is not ID:SIZE@NORTH,EAST",
    "0:0@1,1": "a size of 0 m",
    "0:11@1,1": "a size of 11 m",
    "0:0.3@1e9,1": "too far away",
    "0:0.3@1,1e400": "too far away",
    "0:0.3@1,1,361": "heads beyond 360 degrees",
    "16h5:30:0.1@0,0": "16h5 has no id 30",
    "600:0.1@0,0": "36h11 has no id 600",
}


@pytest.mark.parametrize("value", PLACED)
def test_simulated_tags_that_there_cannot_be(value):
    assert PLACED[value] in refused(VisionModuleSettings(), "sim_tags", value)


def test_placed_tags():
    (one, two) = parse_placed("0:0.30@8,-5; 16h5:1:0.1@0,0,90", "36h11")
    assert (one.family, one.north, one.east, one.heading) == ("36h11", 8, -5, 0)
    assert (two.family, two.id, two.heading) == ("16h5", 1, 90)
    assert parse_placed("", "36h11") == ()


def test_tags_are_those_of_the_main_family():
    settings = VisionModuleSettings({"sim_tags": "", "family": "36h10", "tags": "2319:0.3"})  # in whatever order
    assert (
        VisionModuleSettings({"sim_tags": "", "tags": "2319:0.3", "family": "36h10"}).snapshot()
        == settings.snapshot()
    )
    assert "36h11 has no id 2319" in refused(settings, "family", "36h11,36h10")
    settings.set("family", "36h10,36h11")
    settings.set("tags", "29:0.3")
    settings.set("sim_tags", "100:0.3@0,0")
    assert "sim_tags: 16h5 has no id 100" in refused(settings, "family", "16h5")
    settings.set("sim_tags", "36h11:100:0.3@0,0")
    settings.set("family", "16h5")
    assert settings.snapshot().tag_list == (Tag(29, 0.3),)
    assert parse_tags("99999:0.3") == (Tag(99999, 0.3),)  # without a family it is not asked
    assert all(count <= 1_000_000 for _, count in FAMILIES.values())  # as many digits as an id may have


@pytest.mark.parametrize("name", ["calibration", "directory", "source"])
def test_a_path_of_an_unknown_user_is_refused(name):
    assert "'~nobody_xyz/a'" in refused(VisionModuleSettings(), name, "~nobody_xyz/a")
    assert "zero byte" in refused(VisionModuleSettings(), name, "a\0b")


def test_a_calibration_that_is_refused_leaves_the_one_before(tmp_path):
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(json.dumps({"width": 1280, "height": 720, "fx": 1e3, "fy": 1e3, "cx": 639.5, "cy": 359.5}))
    bad.write_text('{"width": "640"}')
    settings = VisionModuleSettings({"calibration": str(good)})
    assert "is not a calibration" in refused(settings, "calibration", str(bad))
    assert settings.snapshot().model.width == 1280
    good.unlink()
    settings.set("speed", 1)  # what has nothing to do with it can still be set in flight


def test_a_setting_has_a_name_and_a_choice_its_words():
    settings = VisionModuleSettings()
    assert "did you mean family?" in refused(settings, "famly", "16h5")
    assert "it is one of rtl, land, hold" in refused(settings, "on_failure", "pray")


def test_bad_settings_at_loading_are_refused_too():
    for values in (
        {"fps": "nan"},
        {"leash": float("nan")},
        {"tags": "0:0.3.0"},
        {"offset": "inf,0,0"},
        {"source": None},
    ):
        with pytest.raises(SettingError):
            VisionModuleSettings(values)


@pytest.mark.parametrize(
    ("source", "shown"),
    [
        ("camera:0", "camera:0"),
        ("what?/0.mp4", "what?/0.mp4"),
        ("rtsp://pilot:s3cret@host/stream", "rtsp://pilot:***@host/stream"),
        ("rtspsrc location=rtsp://pilot:s3cret@host/ ! x", "rtspsrc location=rtsp://pilot:***@host/ ! x"),
        ("rtspsrc user-id=pilot user-pw=s3cret ! x", "rtspsrc user-id=pilot user-pw=*** ! x"),
        ('souphttpsrc proxy-pw = "s3 cret" ! x', "souphttpsrc proxy-pw = *** ! x"),
    ],
)
def test_source_is_shown_without_its_passwords(source, shown):
    settings = VisionModuleSettings({"source": source})
    assert settings.shown("source") == settings.snapshot().shown_source == shown
    assert settings.listing("source")[0].split(maxsplit=1)[1].startswith(shown)
    assert settings.snapshot().source == source


def test_a_tag_that_lies_on_another_vehicle_is_placed_by_its_system_id():
    (tag,) = parse_placed("0:0.60@v11", "36h11")
    assert (tag.carrier, tag.size, tag.north) == (11, 0.6, 0.0)
