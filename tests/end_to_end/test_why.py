"""Why a flight ended: the answer, the trail, the prompt and the page say it, in the autopilot's own words."""

from __future__ import annotations

import asyncio
import os
import signal
from typing import Any, NamedTuple

import pytest

from tests.support.chromium import chromium
from tests.support.page_pilot import Pilot
from tests.support.sitl_types import ardupilot_type

pytestmark = pytest.mark.long


class Cause(NamedTuple):
    """What ends a flight, and what is said of it.

    `fault` is the embedded vehicle's, `typed` what does the same to ArduPilot's at MAVProxy's prompt.
    """

    fault: dict[str, Any]
    typed: str
    code: str
    says: str
    kind: str


SILENCE = "silence"
CAUSES = {
    "another station": Cause(
        {"name": "pilot_mode", "mode": "LOITER"}, "mode LOITER", "mode_changed", "switched it to LOITER", "mode"
    ),
    "an EKF failsafe": Cause(
        {"name": "ekf_bad"},
        "param set SIM_GPS1_ENABLE 0",
        "mode_changed",
        "EKF Failsafe: changed to LAND Mode)",
        "mode",
    ),
    "a lost link": Cause({"name": SILENCE}, SILENCE, "link_lost", "no heartbeat from vehicle 1 for", "link"),
    "a low battery": Cause(
        {"name": "low_battery"},
        "param set SIM_BATT_VOLTAGE 9.9",
        "mode_changed",
        "a failsafe switched it to RTL (Battery 1 is low",
        "mode",
    ),
    "a reboot": Cause(
        {"name": "reboot"},
        "long PREFLIGHT_REBOOT_SHUTDOWN 1 0 0 0 0 20190226 0",
        "not_armed",
        "the autopilot rebooted meanwhile",
        "boot",
    ),
}
REMEDIES = ("param set SIM_GPS1_ENABLE 1", "param set SIM_BATT_VOLTAGE 12.6")


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def watched(request, tmp_path_factory, harness):
    """A rig that flies, and whose vehicle can misbehave."""
    directory, settings = tmp_path_factory.mktemp(request.param), {"link_timeout": 5, "max_age": 5}
    if request.param == "embedded":
        made = harness.embedded(directory, speedup=4, **settings)
    else:
        made = ardupilot_type(directory, "copter", speedup=2, **settings)
        made.mavproxy.says("Received", timeout=60)  # the parameters, without which MAVProxy sets none
        for name, value in {"DISARM_DELAY": 120, "BATT_LOW_VOLT": 10.5, "BATT_FS_LOW_ACT": 2}.items():
            made.mavproxy.type(f"param set {name} {value}")
    yield made
    made.stop()


def fly(rig):
    """A flight to a place far away, which waits for its answer."""
    rig.until(lambda: rig.status()["ready_to_arm"] or rig.status()["armed"], 90, "its being ready")
    rig.in_the_air(10)
    x, y, z = rig.ned()
    waiting = rig.begin("POST", "/movement/go_to_ned_wait", {"x": x + 400, "y": y, "z": z})
    rig.pass_time(1.0)
    return waiting


def provoke(rig, cause):
    if rig.control is not None:
        rig.control.fault(**cause.fault)
    elif cause.typed == SILENCE:
        os.kill(rig.processes[0].pid, signal.SIGSTOP)
    else:
        rig.mavproxy.type(cause.typed)


def mend(rig, cause):
    """Have the vehicle fit to fly again."""
    if rig.control is None:
        os.kill(rig.processes[0].pid, signal.SIGCONT)
        for line in REMEDIES:
            rig.mavproxy.type(line)
        rig.mavproxy.type("long COMPONENT_ARM_DISARM 0 21196 0 0 0 0 0")
    else:
        rig.control.ask("clear")
        rig.control.fault("pilot_disarm")
        if cause.fault["name"] == "low_battery":
            rig.control.fault("reboot")  # its failsafe lasts until then
    rig.pass_time(3)


# The page's test below has the failsafe, too; the others go the same way.
@pytest.mark.parametrize(
    "name", [name if "EKF" in name else pytest.param(name, marks=pytest.mark.long) for name in CAUSES]
)
def test_answer_trail_and_prompt_say_why_a_flight_ended(watched, name):
    rig, cause = watched, CAUSES[name]
    if cause.kind == "mode" and rig.control is not None:
        rig.control.ask("parameter", name="BATT_FS_LOW_ACT", value=2)
    waiting = fly(rig)
    provoke(rig, cause)
    answer = waiting.answer(40)
    try:
        assert answer.json()["code"] == cause.code
        late = cause.kind == "boot" and rig.control is None  # ArduPilot says that it starts after its first heartbeat
        assert cause.says in answer.json()["detail"] or (late and "disarmed meanwhile" in answer.json()["detail"])
        if cause.code != "link_lost":
            assert answer.json()["change"]["last_sent"]["verb"] == "/movement/go_to_ned_wait"
        rig.until(lambda: told_of(rig, cause), 5, "the event in the trail")
        event = told_of(rig, cause)[0]
        flights = rig.ok(rig.get("/audit", kind="command", vehicle=1))["entries"]
        ended = next(entry for entry in flights if entry["verb"] == "/movement/go_to_ned_wait")
        assert (ended["outcome"], ended["detail"]) == (cause.code, answer.json()["detail"])
        said = rig.mavproxy.ask("uavapi why", "fails after")
        assert event["sentence"] in said
    finally:
        mend(rig, cause)


def told_of(rig, cause):
    """The trail's events of that kind since the last flight began, the newest first."""
    entries = rig.ok(rig.get("/audit", kind=f"{cause.kind},armed", vehicle=1))["entries"]
    return [entry for entry in entries[:2] if entry["kind"] == cause.kind]


AGE = """(() => { const tiles = document.querySelector('vehicle-readings').tiles;
  return parseFloat(tiles.find(one => one.tile.firstChild.textContent === 'EKF').age.textContent); })()"""


async def look(rig, directory):
    """See on the page why a flight ended, and how old what is shown becomes."""
    rig.until(lambda: rig.status()["ready_to_arm"], 90, "its being ready")
    async with chromium(directory) as page:
        pilot = Pilot(page, rig)
        await page.visit(rig.url + "/")
        await pilot.sees_live()
        await pilot.click("History")
        waiting = await asyncio.to_thread(fly, rig)
        await pilot.sees("history-list", "takeoff (alt 10) of 127.0.0.1 is done after")
        provoke(rig, CAUSES["an EKF failsafe"])
        await pilot.sees("history-list", "vehicle 1 changes from GUIDED to LAND, by a failsafe (EKF")
        await pilot.sees("history-list", "UTC")
        await pilot.finds_it_accessible()
        assert waiting.answer(40).status_code == 409
        await pilot.click("Jobs")
        await pilot.sees("job-list", "EKF Failsafe: changed to LAND Mode)")
        provoke(rig, CAUSES["a lost link"])
        await pilot.sees("connection-state", "link lost")
        await page.until(f"{AGE} >= 5")  # the setting link_timeout of this rig
        return page.complaints


@pytest.mark.needs("chromium")
def test_page_tells_why_a_flight_ended_and_how_old_it_is_what_a_silent_vehicle_shows(watched, tmp_path):
    try:
        assert asyncio.run(look(watched, tmp_path)) == []
    finally:
        mend(watched, CAUSES["a lost link"])
