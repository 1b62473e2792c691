"""Every fault of a rehearsal, as the API sees it: a copter hovers in GUIDED when it begins."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from mavproxy_uavapi.rehearsal.faults import OF_THE_VEHICLE, fault_of
from mavproxy_uavapi.rehearsal.flight import Rehearsal
from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.rehearsal.virtual_time import run_in_virtual_time


class Seen(NamedTuple):
    """How often it booted; its mode, whether it is armed; what the autopilot said; whether its link was ever lost."""

    reboots: int
    mode: str
    armed: bool
    texts: list[str]
    was_lost: bool


async def seen(fault: str) -> Seen:
    rehearsal = Rehearsal(Order((Path("a.py"),), location="CMAC"))
    async with rehearsal.up():
        for path, body in (("/command/arm", {}), ("/command/takeoff", {"alt": 8})):
            status, answer = await rehearsal.ask("POST", path, json=body)
            assert status == 200, answer
        state = rehearsal._companion.host.fleet.vehicles[1]
        rehearsal.waiting.append(fault_of(fault))
        lost = False
        for _ in range(60):
            await rehearsal._passed(rehearsal._samples[-1].at + 0.5)
            lost = lost or not rehearsal._companion.host.link_watch.is_alive(state)
        _, status_now = await rehearsal.ask("GET", "/telemetry/status")
        assert not rehearsal.waiting
        texts = [one.text for one in rehearsal.record.said if one.kind == "statustext"]
        info = status_now["info"]
        return Seen(state.reboots, info["mode"], info["armed"], texts, lost)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("gps_loss", (0, "LAND", False, "EKF Failsafe: changed to LAND Mode", False)),
        ("gps_frozen:20", (0, "GUIDED", True, "", False)),
        ("link_loss:12", (0, "GUIDED", True, "", True)),
        ("radio_loss:2", (0, "RTL", False, "Radio Failsafe", False)),
        ("low_battery", (0, "GUIDED", True, "Battery 1 is low", False)),
        ("pilot_mode=LOITER", (0, "LOITER", True, "", False)),
        ("pilot_disarm", (0, "GUIDED", False, "", False)),
        ("reboot", (1, "STABILIZE", False, "ArduCopter", False)),
        ("wind_gust=12:5", (0, "GUIDED", True, "", False)),
    ],
)
def test_api_sees_what_happens_and_nothing_else(fault: str, expected: tuple[int, str, bool, str, bool]) -> None:
    reboots, mode, armed, text, was_lost = expected
    told = run_in_virtual_time(seen(fault), 10.0)
    assert (told.reboots, told.mode, told.armed, told.was_lost) == (reboots, mode, armed, was_lost), told
    assert not text or any(one.startswith(text) for one in told.texts), told


def test_each_fault_of_the_vehicle_is_looked_at() -> None:
    (marker,) = (one for one in test_api_sees_what_happens_and_nothing_else.pytestmark if one.name == "parametrize")
    assert {fault_of(fault).name for fault, _ in marker.args[1]} == set(OF_THE_VEHICLE)
