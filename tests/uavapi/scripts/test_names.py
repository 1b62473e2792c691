from __future__ import annotations

import pytest

from mavproxy_uavapi.core.errors import BadRequest
from mavproxy_uavapi.scripts import names

BAD = [
    "",
    ".",
    "..",
    ".py",
    "-x.py",
    ".hidden.py",
    "../x.py",
    "a/b.py",
    "/etc/x.py",
    "a b.py",
    "a;b.py",
    "x$(touch PWN).py",
    "x`id`.py",
    "x\n.py",
    "x.py\n",
    "x\0.py",
    "ü.py",
    "a" * 98 + ".py",
]


@pytest.mark.parametrize("name", BAD)
def test_names_that_are_not_plain_are_refused(name: str) -> None:
    with pytest.raises(BadRequest):
        names.checked(name)


@pytest.mark.parametrize("name", ["a.txt", "a", "a.PY", "py", "a.py.exe"])
def test_other_extensions_are_refused(name: str) -> None:
    with pytest.raises(BadRequest, match=r"neither a \.py nor a \.sh"):
        names.checked(name)


@pytest.mark.parametrize("name", ["a.py", "a.sh", "A-b_c.1.py", "a" * 97 + ".py", "7.sh"])
def test_plain_names_are_taken_as_they_are(name: str) -> None:
    assert names.checked(name) == name


@pytest.mark.parametrize(("name", "script"), [("a", "a.py"), ("a.py", "a.py"), ("a.sh", "a.sh"), ("v1.2", "v1.2.py")])
def test_py_is_added_where_no_extension_is_given(name: str, script: str) -> None:
    assert names.resolved(name) == script


def test_session_names_hold_nothing_that_tmux_would_change() -> None:
    assert names.session_name(7, "v1.2_20260102_030405") == "uavapi_7_v1+2_20260102_030405"


def test_names_that_differ_in_a_dot_have_sessions_of_their_own() -> None:
    assert names.session_name(7, "v1.2_20260102_030405") != names.session_name(7, "v1_2_20260102_030405")


def test_every_vehicles_sessions_share_a_prefix() -> None:
    assert [names.session_name(sysid, "a") for sysid in (0, 7)] == ["uavapi_a", "uavapi_7_a"]
    assert names.SESSIONS == "uavapi_"
