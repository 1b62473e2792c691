from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import pytest
from aiohttp import web

from mavproxy_uavapi.core import errors
from mavproxy_uavapi.http.contract.responses import dumps, envelope

TREE = [
    (errors.UavApiError("a"), 500, "internal"),
    (errors.BadRequest("a"), 400, "bad_request"),
    (errors.Unauthorized("a"), 401, "unauthorized"),
    (errors.Forbidden("a"), 403, "forbidden"),
    (errors.NotFound("a"), 404, "not_found"),
    (errors.NotSupported("a"), 404, "not_supported"),
    (errors.Superseded("a"), 409, "superseded"),
    (errors.ModeChanged("a"), 409, "mode_changed"),
    (errors.Busy("a"), 409, "busy"),
    (errors.NotArmed("a"), 409, "not_armed"),
    (errors.Aborted("a"), 409, "aborted"),
    (errors.OutsideEnvelope("a"), 409, "outside_envelope"),
    (errors.LinkLost("a"), 503, "link_lost"),
    (errors.NoVehicle("a"), 503, "no_vehicle"),
    (errors.Stale("a"), 503, "stale"),
    (errors.TimedOut("a"), 504, "timeout"),
]


@pytest.mark.parametrize(("error", "status", "code"), TREE, ids=[code for _, _, code in TREE])
def test_error_is_its_status_sentence_and_code(
    raising: Callable[[BaseException], Any], error: Exception, status: int, code: str
) -> None:
    answer = raising(error)
    assert (answer.status, answer.body) == (status, {"detail": "a", "code": code})
    assert answer.headers["Content-Type"].startswith("application/json")


def test_invalid_is_a_list_of_problems(raising: Callable[[BaseException], Any]) -> None:
    answer = raising(errors.Invalid("too high", "query", "alt"))
    assert answer.status == 422
    assert answer.body == {
        "detail": [{"loc": ["query", "alt"], "msg": "too high", "type": "value_error"}],
        "code": "invalid",
    }


def test_rejected_has_the_ack_and_the_texts(raising: Callable[[BaseException], Any]) -> None:
    answer = raising(errors.Rejected("no", "MAV_RESULT_DENIED", ["first", "second"]))
    assert answer.status == 500
    assert answer.body == {
        "detail": "no", "code": "rejected", "ack": "MAV_RESULT_DENIED", "statustext": ["first", "second"],
    }  # fmt: skip
    assert "ack" not in raising(errors.Rejected("no")).body


def test_timeout_has_the_texts_where_there_are_some(raising: Callable[[BaseException], Any]) -> None:
    assert raising(errors.TimedOut("late", ["low battery"])).body["statustext"] == ["low battery"]


def test_defect_of_ours_is_500_in_the_log_and_no_more(
    raising: Callable[[BaseException], Any], caplog: pytest.LogCaptureFixture
) -> None:
    answer = raising(KeyError("VFR_HUD"))
    assert (answer.status, answer.body["code"]) == (500, "internal")
    assert "a defect of this program: KeyError('VFR_HUD')" in answer.body["detail"]
    assert "Traceback" in caplog.text


def test_what_aiohttp_refuses_is_in_our_words(raising: Callable[[BaseException], Any]) -> None:
    assert raising(web.HTTPNotFound()).body == {"detail": "no such path", "code": "not_found"}
    refused = raising(web.HTTPMethodNotAllowed("GET", ["POST"]))
    assert (refused.status, refused.headers["Allow"]) == (405, "POST")
    assert refused.body["code"] == "bad_request"
    assert isinstance(refused.body["detail"], str)


def test_envelope_has_the_system_id_as_text() -> None:
    assert envelope(7, "done") == {"device": "uav", "id": "7", "result": "done"}
    assert envelope(None, "done") == {"device": "uav", "id": None, "result": "done"}


def test_json_never_has_nan_or_infinities() -> None:
    body = {"a": math.nan, "b": [math.inf, {"c": (-math.inf, 1.5)}], "d": "NaN"}
    assert json.loads(dumps(body), parse_constant=pytest.fail) == {
        "a": None,
        "b": [None, {"c": [None, 1.5]}],
        "d": "NaN",
    }
