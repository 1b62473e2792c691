"""The answer of each verb to each fault: the tests check this table, and docs/faults.md shows it.

`python -m tests.rules.outcomes` writes that file.
"""

from __future__ import annotations

import itertools
from pathlib import Path

from mavproxy_uavapi.core.control.jobs import Ending
from mavproxy_uavapi.core.oversight import endings
from mavproxy_uavapi.core.oversight.endings import Policy
from tests.rules import outcomes_of_types
from tests.rules.faults import (
    ARM,
    BRAKE,
    ENDED,
    FAULTS,
    HEARTBEAT,
    HOLDS,
    HOME,
    LANDING,
    MODE,
    MOVING,
    NONE,
    OUTSIDE,
    PROMPT,
    RESUME,
    SPEED,
    STOP,
    TAKEOFF,
    TRACK,
    TRAVEL,
    TURN,
    TURN_RATE,
    VISION,
    VISION_LAND,
    VISION_MISSION,
    Fault,
    Verb,
)

FILE = Path(__file__).parents[2] / "docs" / "faults.md"


WHY = {
    Ending.DONE: "it is done",
    Ending.FAILED: "it failed, took too long, or the pilot has the vehicle",
    Ending.SUPERSEDED: "a newer command took over",
    Ending.ABORTED: "DELETE, or a stop at the prompt",
    Ending.CLIENT_GONE: "its client hung up",
    Ending.SCRIPT_GONE: "its script died",
    Ending.LEASE_OVER: "the lease of its client ran out",
    Ending.UNLOADED: "the API stops, or the module is unloaded",
    Ending.DEFECT: "a defect of ours",
}
BRAKES = (endings.Situation.MISSION, endings.Situation.LAND, endings.Situation.RTL)
HOW = {
    (endings.Situation.GUIDED, endings.HOLD): "zero velocity",
    **{(situation, endings.HOLD): "BRAKE" for situation in BRAKES},
}
VERBS = {
    "arm": Verb("/command/arm", 5.0, ARM),
    "takeoff": Verb("/command/takeoff", 12.0, TAKEOFF),
    "land": Verb("/command/land", 20.0, LANDING),
    "rtl": Verb("/command/rtl", 23.0, LANDING),
    "go_to_ned_wait": Verb("/movement/go_to_ned_wait", 10.0, MOVING),
    "go_to_gps_wait": Verb("/movement/go_to_gps_wait", 10.0, MOVING),
    "drive_wait": Verb("/movement/drive_wait", 10.0, MOVING),
    "drive_body_wait": Verb("/movement/drive_body_wait", 10.0, MOVING),
    "travel, with duration": Verb("/movement/travel_at_ned", 7.0, TRAVEL),
    "travel_at_body, with duration": Verb("/movement/travel_at_body", 7.0, TRAVEL),
    "fly-track": Verb("/mission/fly-track", 60.0, TRACK),
    "set_heading": Verb("/movement/set_heading", 5.0, TURN),
    "set_yaw_rate": Verb("/movement/set_yaw_rate", 3.0, TURN_RATE),
    "stop": Verb("/movement/stop", 3.0, STOP),
    "resume": Verb("/movement/resume", 2.0, RESUME),
    "brake": Verb("/command/brake", HEARTBEAT, BRAKE),
    "guided": Verb("/command/guided", HEARTBEAT, MODE),
    "set_mode": Verb("/command/set_mode", HEARTBEAT, {**MODE, "outside the envelope": OUTSIDE}),
    "set_home": Verb("/command/set_home", 2.0, HOME),
    "set_air_speed": Verb("/command/set_air_speed", 0.5, SPEED),
    "set_ground_speed": Verb("/command/set_ground_speed", 0.5, SPEED),
    "set_climb_speed": Verb("/command/set_climb_speed", 0.5, SPEED),
    "set_descent_speed": Verb("/command/set_descent_speed", 0.5, SPEED),
    "vision/land": Verb("/vision/land", 30.0, VISION_LAND),
    "vision/search": Verb("/vision/search", 60.0, VISION),
    "vision/mission": Verb("/vision/mission", 60.0, VISION_MISSION),
    "prompt: vision land": Verb("vision land", 30.0, {**VISION_LAND, **PROMPT}),
    "prompt: uavapi fly": Verb(
        "uavapi fly", 60.0, {**TRACK, **PROMPT, "outside the envelope": NONE}
    ),  # it has no job
    "script: go_to_ned_wait": Verb("/movement/go_to_ned_wait", 10.0, {**MOVING, "client gone": f"{ENDED}{HOLDS}"}),
    "script: land": Verb("/command/land", 20.0, LANDING),
    **outcomes_of_types.VERBS,
}
TABLES = (4, 11, 8, 3, 4, *outcomes_of_types.TABLES)  # verbs in each table of the page


def page() -> str:
    """docs/faults.md."""
    lines = [
        "# Faults: the answer of each verb",
        "",
        "`python -m tests.rules.outcomes` writes this page. `tests/rules/test_fault_matrix.py` flies every cell on",
        "the embedded vehicle and checks: the verb gives this answer, in time; afterwards nothing is sent until the",
        "next request: no setpoint, no mode, no command.",
        "",
        "The fault begins 3 s after the start of a flight; other verbs then wait for an acknowledgement. Setpoints",
        "of movements have no acknowledgement. A command at MAVProxy's prompt, or a script's call with",
        "`?wait=false`, has a job; the table shows the job's outcome, and the prompt prints its text. `holds` means:",
        "the vehicle is sent zero velocities until telemetry shows that it stands still, and nothing else. The",
        "tables at the end give the reason.",
        "",
        "The tables of planes, QuadPlanes and rovers have the faults that may end differently there. The others",
        "concern the exchange of commands and acknowledgements, which is the same for all types.",
        "",
        "| fault | what happens | longest time to the error, or delay of the success |",
        "| --- | --- | --- |",
    ]
    lines += [f"| {name} | {fault.meaning} | {_seconds(fault)} |" for name, fault in FAULTS.items()]
    names = iter(VERBS)
    for count in TABLES:
        groups = _alike(tuple(itertools.islice(names, count)))
        lines += ["", "| fault | " + " | ".join(", ".join(f"`{name}`" for name in group) for group in groups) + " |"]
        lines += ["| --- |" + " --- |" * len(groups)]
        shown = [name for group in groups for name in group]
        for fault in (fault for fault in FAULTS if any(VERBS[name].outcomes[fault] for name in shown)):
            lines += [f"| {fault} | " + " | ".join(VERBS[group[0]].outcomes[fault] or "–" for group in groups) + " |"]
    return "\n".join([*lines, *endings_page()]) + "\n"


def endings_page() -> list[str]:
    """How flights end: the table of `core/oversight/endings.py`."""
    columns = [policy for policy in Policy if policy is not Policy.NOTHING]
    lines = [
        "",
        "## What a vehicle does when the job that flies it ends",
        "",
        "| it ends because | policy |",
        "| --- | --- |",
        *(f"| {WHY[ending]} | {policy.value} |" for ending, policy in endings.FIXED.items()),
        f"| {WHY[Ending.CLIENT_GONE]} | `on_disconnect`: nothing, or hold |",
        f"| {WHY[Ending.SCRIPT_GONE]} | `on_script_exit`: nothing, hold, land or rtl |",
        f"| {WHY[Ending.LEASE_OVER]} | `on_lease_end`: hold, land or rtl |",
        "",
        "The policy `safe` means: a vehicle that flies by our setpoints stops and holds; a flight of the autopilot",
        "itself goes on. It also applies when a flight fails that depends on our setpoints: one of vision's, or a",
        "velocity with a duration. Situation and policy give the action, which is sent until telemetry shows it:",
        "",
        "| telemetry shows | " + " | ".join(policy.value for policy in columns) + " |",
        "| --- |" + " --- |" * len(columns),
    ]
    for situation, row in endings.WHAT_FOLLOWS.items():
        cells = [HOW.get((situation, row[policy]), row[policy]) or "nothing" for policy in columns]
        lines.append(f"| {situation.value} | " + " | ".join(cells) + " |")
    lines += [
        "",
        "A change of mode that nobody requests at that moment (the client hung up, its script died, a lease ran out,",
        "a failure, a defect) waits for the next heartbeat: if that shows a pilot's mode, nothing is sent. A zero",
        "velocity does not wait; it does nothing in a pilot's mode.",
        "",
        "A failsafe may go on in the mode that the vehicle is in: it lands or returns already, or a plane jumps to",
        "the landing of its mission in AUTO. Only the heartbeat's state tells (MAV_STATE_CRITICAL), also of a",
        "battery that only warns. In these modes the end of a client, a script or a lease sends nothing then.",
        "",
        "## What telemetry does not tell apart",
        "",
        "- An order that is written before we can have heard of the pilot's switch (the second to the next heartbeat",
        "  and its way), and arrives after it, takes the vehicle: on a link of 2 s each way up to 5 s after the",
        "  switch. It is not sent again. So may a copy that the link delays.",
        "- `disarm` that the vehicle has done, whose acknowledgement is lost, and after which the pilot arms it",
        "  again before its next heartbeat (1 s): all that arrives is as if the order had been lost. It is sent",
        "  again, and the motors stop once more: an order that stops motors is repeated when in doubt. Orders",
        "  that take, arm or begin are not.",
        "- A link that delivers copies more than 3 s late: old messages look like a reboot, and like two autopilots.",
        "- Before the first answer to TIMESYNC the vehicle's clock is not known: an order that takes, arms or",
        "  begins is sent again only after two heartbeats that came more than 6 s after it.",
    ]
    return lines


def _seconds(fault: Fault) -> str:
    return f"{fault.within:g} s" if fault.within else ""


def _alike(verbs: tuple[str, ...]) -> list[list[str]]:
    """The verbs in groups of equal outcomes."""
    groups: list[list[str]] = []
    for name in verbs:
        for group in groups:
            if VERBS[group[0]].outcomes == VERBS[name].outcomes:
                group.append(name)
                break
        else:
            groups.append([name])
    return groups


if __name__ == "__main__":
    FILE.write_text(page(), encoding="utf-8")
