from __future__ import annotations

import math
from typing import Any

import pytest

from mavproxy_gradys.http import Readings
from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.http.contract import requests
from mavproxy_uavapi.http.contract.parsing import parse


@pytest.mark.parametrize(
    ("written", "value"),
    [("30", 30), (30, 30), ("30.5", 30.5), (30.5, 30.5), ("30.0", 30.0), ("3e1", 30.0), (30.0, 30.0)],
)
def test_numbers_stay_as_the_client_wrote_them(written: Any, value: float) -> None:
    alt = parse(requests.Takeoff, "query", {"alt": written}).alt  # type: ignore[attr-defined]
    assert (alt, type(alt)) == (value, type(value))


@pytest.mark.parametrize(
    "written",
    [
        math.nan,
        math.inf,
        -math.inf,
        "nan",
        "inf",
        "-Infinity",
        "1e400",
        True,
        None,
        [],
        {},
        "",
        "ten",
        "1_0",
        "9" * 5000,
    ],
)
def test_what_is_no_finite_number_is_invalid(written: Any) -> None:
    with pytest.raises(Invalid) as caught:
        parse(requests.Takeoff, "body", {"alt": written})
    assert caught.value.problems[0]["loc"][:2] == ["body", "alt"]


def bounds() -> list[tuple[type[requests.Request], dict[str, Any], str, float, float, float, float]]:
    """Model, the other values, name, lowest and highest value, and the nearest that are out of range."""
    gps = {"lat": 0, "long": 0, "alt": 0}
    velocity = {"vx": 0, "vy": 0, "vz": 0}
    return [
        (requests.Takeoff, {}, "alt", 0.001, 1000, 0, 1000.1),
        (requests.NewSpeed, {}, "new_v", 0, 50, -0.001, 50.001),
        (requests.GpsTarget, gps, "lat", -90, 90, -90.001, 90.001),
        (requests.GpsTarget, gps, "long", -180, 180, -180.001, 180.001),
        (requests.GpsTarget, gps, "alt", -1000, 10_000, -1000.001, 10_000.001),
        (requests.NedVelocity, velocity, "vx", -50, 50, -50.001, 50.001),
        (requests.Heading, {}, "heading", 0, 360, -0.001, 360.001),
        (requests.Servo, {"pwm": 1500}, "channel", 1, 16, 0, 17),
        (requests.Servo, {"channel": 1}, "pwm", 800, 2200, 799, 2201),
    ]


@pytest.mark.parametrize(
    ("model", "others", "name", "lowest", "highest", "below", "above"),
    bounds(),
    ids=[f"{b[0].__name__}.{b[2]}" for b in bounds()],
)
def test_bounds_are_those_that_clients_know(
    model: type[requests.Request], others: Any, name: str, lowest: float, highest: float, below: float, above: float
) -> None:
    for value in (lowest, highest):
        assert getattr(parse(model, "query", {**others, name: value}), name) == value
    for value in (below, above):
        with pytest.raises(Invalid):
            parse(model, "query", {**others, name: value})


def test_defaults_are_those_of_the_contract() -> None:
    assert parse(requests.Takeoff, "query", {}).model_dump() == {"timeout": None, "alt": 15, "vtol": False}
    assert parse(requests.Disarm, "query", {}).model_dump() == {"force": False}
    target = parse(requests.NedPlace, "body", {"x": 1, "y": 2, "z": 3})
    assert (target.look_at_target, target.tolerance, target.timeout) == (False, 1.0, None)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("altitude", "there is no `altitude`; did you mean `alt`? the names are timeout, alt, vtol, pitch_deg, wait"),
        ("Alt", "there is no `Alt`; did you mean `alt`? the names are timeout, alt, vtol, pitch_deg, wait"),
        ("colour\x1b[2J", "there is no `colour\\x1b[2J`; the names are timeout, alt, vtol, pitch_deg, wait"),
    ],
)
def test_unknown_name_is_answered_with_the_nearest_and_with_all(name: str, says: str) -> None:
    with pytest.raises(Invalid) as caught:
        parse(requests.Takeoff, "query", {name: "5"}, options=["wait"])
    assert caught.value.problems == [{"loc": ["query", name], "msg": says, "type": "extra_forbidden"}]


def test_unknown_name_of_a_nested_model_is_answered_with_its_names() -> None:
    with pytest.raises(Invalid) as caught:
        parse(Readings, "body", {"readings": [{"quantity": "t", "value": 1, "sysd": 2}]})
    (problem,) = caught.value.problems
    assert problem["loc"] == ["body", "readings", 0, "sysd"]
    assert "did you mean `sysid`? the names are quantity, value" in problem["msg"]


def test_option_of_the_query_in_the_body_is_sent_there() -> None:
    with pytest.raises(Invalid, match="`wait` belongs into the query"):
        parse(requests.Takeoff, "body", {"wait": False}, options=["wait"])


def test_what_the_original_service_takes_and_ignores_is_not_kept() -> None:
    assert "pitch_deg" not in parse(requests.Takeoff, "query", {"alt": "20", "pitch_deg": "12"}).model_dump()


def test_each_problem_has_its_place_message_and_type() -> None:
    with pytest.raises(Invalid) as caught:
        parse(requests.Servo, "body", {"channel": 99})
    channel, pwm = caught.value.problems
    assert channel == {
        "loc": ["body", "channel"],
        "msg": "Input should be less than or equal to 16, not 99",
        "type": "less_than_equal",
    }
    assert (pwm["loc"], pwm["type"]) == (["body", "pwm"], "missing")


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("5,5", "'5,5'"),
        ("", "''"),
        (None, "null"),
        (True, "true"),
        ("nan", "'nan'"),
        ("9" * 99, "'" + "9" * 29 + "…"),
    ],
)
def test_a_value_that_is_no_number_is_one_problem_that_shows_it(value: Any, shown: str) -> None:
    with pytest.raises(Invalid) as caught:
        parse(requests.NedPlace, "body", {"x": value, "y": 0, "z": -5})
    (problem,) = caught.value.problems
    assert problem["loc"] == ["body", "x"]
    assert problem["msg"].endswith(f", not {shown}")
