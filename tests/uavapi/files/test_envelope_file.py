"""The operator's envelope: taken up at once, read again when it changes, kept where it cannot be read."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from mavproxy_uavapi.core.airspace.store import API, OPERATOR, Envelopes, Key
from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.files.envelope_file import EnvelopeFile
from mavproxy_uavapi.files.watched_file import LOOK_EVERY
from mavproxy_uavapi.http.contract.route import AREAS as ENVELOPE
from mavproxy_uavapi.rehearsal.virtual_time import AtOnce
from mavproxy_uavapi.settings import ApiModuleSettings
from tests.support.virtual_time import FastLoop


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "field.geojson"
    path.write_text(json.dumps(ENVELOPE))
    return path


def in_force(envelopes: Envelopes) -> list[tuple[str, float | None]]:
    return [(key.by, space.envelope.limits.height) for key, space in envelopes.all()]


def test_file_is_taken_up_and_read_again_and_kept_when_it_breaks(loop: FastLoop, file: Path) -> None:
    loop.set_default_executor(AtOnce())
    envelopes, said, told = Envelopes(), list[str](), list[str]()
    kept = EnvelopeFile(envelopes, said.append, told.append)
    kept.use(str(file))
    assert in_force(envelopes) == [(OPERATOR, 60.0)]
    assert told == [f"envelope: {file} is in force: {next(iter(envelopes.all()))[1].envelope.summary()}"]
    watch = loop.create_task(kept.watch())
    for text, height, warnings in (
        (json.dumps({**ENVELOPE, "limits": {"height": 30}}), 30.0, 0),
        ("{", 30.0, 1),
        (json.dumps({**ENVELOPE, "limits": {"height": 20}}), 20.0, 1),
    ):
        other = file.with_suffix(".new")
        other.write_text(text)
        os.replace(other, file)
        loop.pass_time(2 * LOOK_EVERY)
        assert in_force(envelopes) == [(OPERATOR, height)]
        assert len(said) == warnings
    file.unlink()
    loop.pass_time(2 * LOOK_EVERY)
    assert in_force(envelopes) == [(OPERATOR, 20.0)] and "stays in force" in said[-1]
    watch.cancel()
    kept.use("")
    assert in_force(envelopes) == []


HOSTILE = [
    json.dumps({**ENVELOPE, "limits": {"height": 10**401}}).encode(),
    b"<kml>" + b"<a>" * 5000,
    b'<?xml version="1.0" encoding="klingon"?><kml/>',
    b"\xff",
    b"[" * 100_000,
    b'{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": {"type": []}}]}',
]


@pytest.mark.parametrize("hostile", HOSTILE, ids=range(len(HOSTILE)))
def test_no_file_ends_the_watch_and_the_correction_takes_effect(loop: FastLoop, file: Path, hostile: bytes) -> None:
    loop.set_default_executor(AtOnce())
    envelopes, said = Envelopes(), list[str]()
    kept = EnvelopeFile(envelopes, said.append)
    kept.use(str(file))
    watch = loop.create_task(kept.watch())
    file.write_bytes(hostile)
    loop.pass_time(2 * LOOK_EVERY)
    assert len(said) == 1 and "the one before stays in force" in said[0]
    file.write_text(json.dumps({**ENVELOPE, "limits": {"height": 20}}))
    loop.pass_time(2 * LOOK_EVERY)
    assert in_force(envelopes) == [(OPERATOR, 20.0)]
    assert not watch.done()
    watch.cancel()


def test_a_defect_of_ours_ends_no_watch_and_is_told_once(
    loop: FastLoop, file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    loop.set_default_executor(AtOnce())
    envelopes, said = Envelopes(), list[str]()
    kept = EnvelopeFile(envelopes, said.append)
    kept.use(str(file))
    watch = loop.create_task(kept.watch())
    with monkeypatch.context() as patch:
        patch.setattr("mavproxy_uavapi.files.envelope_file.read", lambda _name: {}["nothing"])
        file.write_text("{}")
        loop.pass_time(5 * LOOK_EVERY)
    assert len(said) == 1 and "by a defect" in said[0]
    assert "KeyError" in caplog.text
    file.write_text(json.dumps({**ENVELOPE, "limits": {"height": 20}}))
    loop.pass_time(2 * LOOK_EVERY)
    assert in_force(envelopes) == [(OPERATOR, 20.0)]
    watch.cancel()


def test_file_that_is_gone_at_the_start_lets_nothing_move(loop: FastLoop, tmp_path: Path) -> None:
    envelopes, said = Envelopes(), list[str]()
    EnvelopeFile(envelopes, said.append).use(str(tmp_path / "none"))
    assert envelopes.of(1)[0].missing and "nothing that moves a vehicle is sent" in said[0]


def test_fences_are_missing_until_mavproxy_has_loaded_them() -> None:
    envelopes = Envelopes()
    EnvelopeFile(envelopes, print).use("vehicle")
    assert "fence list" in envelopes.of(3)[0].missing
    EnvelopeFile(envelopes, print)
    envelopes.put(API, 3, None)
    assert Key(OPERATOR, 3) not in dict(envelopes.all())


def test_setting_takes_a_file_that_can_be_read_only(file: Path, tmp_path: Path) -> None:
    settings = ApiModuleSettings({"envelope": str(file)}, environ={})
    assert settings.snapshot().envelope == str(file)
    (tmp_path / "bad").write_text("{")
    for bad in (str(tmp_path / "none"), str(tmp_path / "bad"), str(tmp_path)):
        with pytest.raises(SettingError):
            settings.set("envelope", bad)
    assert settings.snapshot().envelope == str(file)
    settings.set("envelope", "vehicle")
