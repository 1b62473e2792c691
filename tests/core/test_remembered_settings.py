from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi.core.remembered_settings import RememberedSettings


def loaded(mpstate: SimpleNamespace, name: str = "demo", **keywords: Any) -> RememberedSettings:
    """What a module does that takes everything."""
    remembered = RememberedSettings(mpstate, name, keywords)
    remembered.keep(lambda setting: f"<{remembered.combined[setting]}>")
    return remembered


def test_load_without_keywords_takes_over_the_last_ones_and_changes(
    mpstate: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    assert loaded(mpstate).combined == {"origins": {}}
    loaded(mpstate, config="a b.ini", sysid=2, port=1, origins={"sysid": "launcher"}).change("port", "2")
    assert capsys.readouterr().out == ""
    again = loaded(mpstate)
    origins = {"sysid": "launcher", "port": "demo set"}
    assert again.combined == {"config": "a b.ini", "sysid": 2, "port": "2", "origins": origins}
    assert capsys.readouterr().out == (
        "demo: as before: config=a b.ini, sysid=<2>, port=<2> (keywords at `module load` replace all that)\n"
    )
    again.change("max_age", "3")
    origins["max_age"] = "demo set"
    assert loaded(mpstate).combined == again.combined == {**again.combined, "max_age": "3", "origins": origins}


def test_load_with_keywords_replaces_all(mpstate: SimpleNamespace, capsys: pytest.CaptureFixture[str]) -> None:
    loaded(mpstate, sysid=2, port=1).change("port", "2")
    assert loaded(mpstate, port=3).combined == {"port": 3, "origins": {}}
    assert capsys.readouterr().out == ""
    assert loaded(mpstate).combined == {"port": 3, "origins": {}}


def test_keywords_that_the_module_refuses_are_not_remembered(mpstate: SimpleNamespace) -> None:
    loaded(mpstate, port=1)
    RememberedSettings(mpstate, "demo", {"prot": 2})
    assert loaded(mpstate).combined == {"port": 1, "origins": {}}


def test_modules_have_nothing_to_do_with_each_other(mpstate: SimpleNamespace) -> None:
    loaded(mpstate, port=1)
    assert loaded(mpstate, "other").combined == {"origins": {}}
