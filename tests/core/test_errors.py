from __future__ import annotations

import re

import pytest

from mavproxy_uavapi.core import errors
from mavproxy_uavapi.core.errors import Invalid, LinkLost, Rejected, TimedOut, UavApiError


def tree(cls: type[UavApiError] = UavApiError) -> list[type[UavApiError]]:
    """Every error of the module."""
    return [
        cls,
        *(leaf for child in cls.__subclasses__() for leaf in tree(child) if leaf.__module__ == errors.__name__),
    ]


def test_docstring_is_the_tree_itself() -> None:
    rows = re.findall(r"(\w+) +(\d{3}) (\w+)", errors.__doc__ or "")
    drawn = {name: f"{status} {code}" for name, status, code in rows}
    for cls in tree():
        if cls.__subclasses__() and cls.code in ("conflict", "unavailable"):
            continue
        assert drawn[cls.__name__] == f"{cls.status} {cls.code}"


def test_codes_are_the_contracts_each_with_its_status() -> None:
    assert {cls.code: cls.status for cls in tree() if cls.code not in ("conflict", "unavailable")} == {
        "internal": 500,
        "bad_request": 400,
        "unauthorized": 401,
        "forbidden": 403,
        "not_found": 404,
        "not_supported": 404,
        "superseded": 409,
        "mode_changed": 409,
        "busy": 409,
        "paused": 409,
        "not_armed": 409,
        "not_rehearsed": 409,
        "aborted": 409,
        "outside_envelope": 409,
        "too_near": 409,
        "expired": 409,
        "too_many_requests": 429,
        "tool_failed": 500,
        "tool_missing": 503,
        "invalid": 422,
        "rejected": 500,
        "link_lost": 503,
        "no_vehicle": 503,
        "stale": 503,
        "timeout": 504,
    }


def test_no_code_is_there_twice() -> None:
    codes = [vars(cls)["code"] for cls in tree() if "code" in vars(cls)]  # SettingError has its parent's
    assert len(codes) == len(set(codes))


def test_detail_is_the_sentence() -> None:
    assert LinkLost("gone").detail == "gone"
    assert LinkLost("gone").extras() == {}


def test_invalid_lists_its_problems() -> None:
    invalid = Invalid("too high", "query", "alt")
    assert invalid.detail == [{"loc": ["query", "alt"], "msg": "too high", "type": "value_error"}]
    assert str(invalid) == "query.alt: too high"
    problems = [{"loc": ["body", 0], "msg": "a", "type": "t"}, {"loc": ["body", "b"], "msg": "c", "type": "t"}]
    assert str(Invalid(problems)) == "body.0: a; body.b: c"


@pytest.mark.parametrize(
    ("error", "extras"),
    [
        (Rejected("no"), {"statustext": []}),
        (Rejected("no", "MAV_RESULT_DENIED", ("a",)), {"ack": "MAV_RESULT_DENIED", "statustext": ["a"]}),
        (TimedOut("late"), {}),
        (TimedOut("late", ["a"]), {"statustext": ["a"]}),
    ],
)
def test_the_autopilots_texts_go_along(error: UavApiError, extras: dict[str, object]) -> None:
    assert error.extras() == extras
