"""Why a flight ended: the answer, the trail and the prompt say it in one sentence, with the autopilot's own words."""

from __future__ import annotations

import asyncio
from typing import NamedTuple

import pytest

from tests.support.chromium import chromium
from tests.support.page_pilot import Pilot


class Cause(NamedTuple):
    """What ends a flight: the fault, the answer's code, what its sentence says, and the kind in the trail."""

    fault: str
    fields: dict
    code: str
    says: str
    kind: str
    by: str


CAUSES = {
    "the pilot's switch": Cause(
        "pilot_mode", {"mode": "LOITER"}, "mode_changed", "switched it to LOITER", "mode", ""
    ),
    "an EKF failsafe": Cause(
        "ekf_bad",
        {},
        "mode_changed",
        "a failsafe switched it to LAND (EKF Failsafe: changed to LAND Mode)",
        "mode",
        "failsafe",
    ),
    "a low battery": Cause("low_battery", {}, "mode_changed", "a failsafe switched it to RTL (", "mode", "failsafe"),
    "a lost link": Cause("silence", {}, "link_lost", "no heartbeat from vehicle 1 for", "link", ""),
    "a reboot": Cause("reboot", {}, "not_armed", "the autopilot rebooted meanwhile", "boot", ""),
}


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def watched(request, tmp_path_factory, harness):
    """A rig whose vehicle can misbehave; its MAVProxy has a prompt."""
    directory = tmp_path_factory.mktemp(request.param)
    make = harness.embedded if request.param == "embedded" else harness.ardupilot_with_faults
    made = make(directory, speedup=4, link_timeout=5, max_age=5)
    yield made
    made.stop()


# The page's test below has the failsafe, too; the others go the same way.
@pytest.mark.parametrize(
    "name", [name if "EKF" in name else pytest.param(name, marks=pytest.mark.long) for name in CAUSES]
)
def test_answer_trail_and_prompt_say_why_a_flight_ended(watched, name):
    rig, cause = watched, CAUSES[name]
    rig.eventually(lambda: rig.status()["ready_to_arm"], 60, "its being ready")
    if cause.fault == "low_battery":
        rig.mavproxy.ask("param set BATT_FS_LOW_ACT 2", "BATT_FS_LOW_ACT")
    rig.in_the_air(20)
    x, y, z = rig.ned()
    waiting = rig.begin("POST", "/movement/go_to_ned_wait", {"x": x + 400, "y": y, "z": z})
    rig.sleep(0.5)
    rig.control.fault(cause.fault, **cause.fields)
    answer = waiting.answer(20)
    assert answer.json()["code"] == cause.code
    assert cause.says in answer.json()["detail"]
    if cause.code != "link_lost":
        change = answer.json()["change"]
        assert change["last_sent"]["verb"] == "/movement/go_to_ned_wait"
        assert cause.by in ("", change["by"])
    rig.eventually(lambda: told_of(rig, cause), 5, "the event in the trail")
    event = told_of(rig, cause)[0]
    flights = rig.ok(rig.get("/audit", kind="command", vehicle=1))["entries"]
    ended = next(entry for entry in flights if entry["verb"] == "/movement/go_to_ned_wait")
    assert ended["outcome"] == cause.code
    assert ended["detail"] == answer.json()["detail"]
    said = rig.mavproxy.ask("uavapi why", "go_to_ned_wait")
    assert event["sentence"] in said
    rig.control.ask("clear")
    if cause.fault == "low_battery":
        rig.control.fault("reboot")  # a battery's failsafe lasts until then
        rig.sleep(2)


def told_of(rig, cause):
    """The trail's events of that kind since the last flight began, the newest first."""
    entries = rig.ok(rig.get("/audit", kind=f"{cause.kind},armed", vehicle=1))["entries"]
    return [entry for entry in entries[:2] if entry["kind"] == cause.kind]


AGE = """(() => { const tiles = document.querySelector('vehicle-readings').tiles;
  return parseFloat(tiles.find(one => one.tile.firstChild.textContent === 'EKF').age.textContent); })()"""


async def look(rig, directory):
    """See on the page why a flight ended, and how old what is shown becomes."""
    rig.eventually(lambda: rig.status()["ready_to_arm"], 60, "its being ready")
    rig.in_the_air(20)
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(rig.url + "/")
        await pilot.sees_live()
        await pilot.click("History")
        await pilot.sees("history-list", "takeoff (alt")
        x, y, z = rig.ned()
        waiting = rig.begin("POST", "/movement/go_to_ned_wait", {"x": x + 400, "y": y, "z": z})
        await asyncio.sleep(0.5)
        rig.control.fault("ekf_bad")
        ekf = "changes from GUIDED to LAND, by a failsafe (EKF Failsafe: changed to LAND Mode)"
        await pilot.sees("history-list", ekf)
        await pilot.sees("history-list", "UTC")
        await pilot.finds_it_accessible()
        assert waiting.answer(20).status_code == 409
        await pilot.click("Jobs")
        await pilot.sees("job-list", "a failsafe switched it to LAND (EKF Failsafe: changed to LAND Mode)")
        rig.control.ask("clear")
        rig.control.fault("silence")
        await pilot.sees("connection-state", "link lost")
        assert await page.evaluate(AGE) >= 5  # the setting link_timeout of this rig
        rig.control.ask("clear")
        return page.complaints


@pytest.mark.needs("chromium")
def test_page_tells_why_a_flight_ended_and_how_old_it_is_what_a_silent_vehicle_shows(watched, tmp_path):
    assert asyncio.run(look(watched, tmp_path)) == []
