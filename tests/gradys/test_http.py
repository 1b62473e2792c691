from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_gradys.http import LONGEST_LIST, LONGEST_TEXT, MOST_READINGS, GradysHandlers, Readings
from mavproxy_gradys.service import Gradys
from mavproxy_gradys.tracks.request import TrackRequest
from mavproxy_uavapi.core.errors import Invalid
from mavproxy_uavapi.http.call import Call
from mavproxy_uavapi.http.caller import CALLER, Caller
from mavproxy_uavapi.http.requests import parse


def readings(body: Any) -> list[Any]:
    found = parse(Readings, "body", body)
    assert isinstance(found, Readings)
    return found.readings


@pytest.mark.parametrize("value", [1, 0, 2**63 - 1, 2.5, True, False, "yes", "12", [1, 2.5], ""])
def test_a_value_stays_what_it_was(value: Any) -> None:
    (found,) = readings({"quantity": "a", "value": value})
    assert found.value == value and type(found.value) is type(value)


@pytest.mark.parametrize(
    "value",
    [
        None,
        float("nan"),
        float("inf"),
        {},
        [1, "a"],
        2**63,
        -(2**63) - 1,
        [10**400],
        [float("nan")],
        "x" * (LONGEST_TEXT + 1),
        [0] * (LONGEST_LIST + 1),
    ],
)
def test_a_value_that_cannot_be_stored_is_refused_once(value: Any) -> None:
    with pytest.raises(Invalid) as raised:
        readings({"readings": [{"quantity": "a", "value": value}]})
    assert len(raised.value.problems) == 1


@pytest.mark.parametrize(
    "body",
    [
        {"quantity": "a/b", "value": 1},
        {"quantity": "", "value": 1},
        {"quantity": "a" * 65, "value": 1},
        {"quantity": "a", "value": 1, "time": float("nan")},
        {"quantity": "a", "value": 1, "sysid": 256},
        {"quantity": "a", "value": 1, "device": "#"},
        {"readings": []},
        {"readings": [{"quantity": "a", "value": 1}] * (MOST_READINGS + 1)},
        {},
    ],
)
def test_what_is_no_reading_is_refused(body: Any) -> None:
    with pytest.raises(Invalid):
        readings(body)


def test_nobody_poses_as_a_vehicle(loop: Any, host: Any, telemetry: Any, settings: Any, at_once: Any) -> None:
    gradys = Gradys(host)
    loop.run(gradys.start(settings(quantities="position@1,alt=VFR_HUD.alt")))
    service: Any = SimpleNamespace(host=host, settings=SimpleNamespace(sysid=0))

    def post(**body: Any) -> Any:
        call = Call(service, {CALLER: Caller(None)}, parse(Readings, "body", {"value": 1, **body}))  # type: ignore[arg-type]
        return loop.run(GradysHandlers(gradys).readings(call))

    for body in ({"quantity": "position"}, {"quantity": "alt", "device": "uav-1"}):
        with pytest.raises(Invalid, match="from the vehicle itself only"):
            post(**body)
    for body in ({"quantity": "status"}, {"quantity": "status", "device": "buoy"}):
        with pytest.raises(Invalid, match="take another name"):
            post(**body)
    assert post(quantity="position", device="buoy")["result"] == "Kept 1 reading"
    assert post(quantity="temperature")["result"] == "Kept 1 reading"
    loop.run(gradys.stop())


def test_nobody_poses_as_a_vehicle_of_the_devices_name(
    loop: Any, host: Any, telemetry: Any, settings: Any, at_once: Any
) -> None:
    gradys = Gradys(host)
    loop.run(gradys.start(settings(device="north", sink="http://a/r")))
    service: Any = SimpleNamespace(host=host, settings=SimpleNamespace(sysid=0))

    def post(**body: Any) -> Any:
        call = Call(service, {CALLER: Caller(None)}, parse(Readings, "body", {"value": 1, **body}))  # type: ignore[arg-type]
        return loop.run(GradysHandlers(gradys).readings(call))

    for device in (None, "north-1", "uav-1"):
        with pytest.raises(Invalid, match="from the vehicle itself only"):
            post(quantity="position", device=device)
    assert post(quantity="position", device="north")["result"] == "Kept 1 reading"
    loop.run(gradys.stop())


def test_a_track_has_limits() -> None:
    for body in (
        {},
        {"track": ""},
        {"track": "x", "reach": 0},
        {"track": "x", "ground": 1e6},
        {"track": "x", "transit": 501},
    ):
        with pytest.raises(Invalid):
            parse(TrackRequest, "body", body)
