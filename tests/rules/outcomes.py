"""The answer of each verb to each fault: the tests check this table, and docs/faults.md shows it.

`python tests/rules/outcomes.py` writes that file.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

from mavproxy_uavapi.core.vehicle import endings
from mavproxy_uavapi.core.vehicle.endings import Policy
from mavproxy_uavapi.core.vehicle.jobs import Ending

FILE = Path(__file__).parents[2] / "docs" / "faults.md"


class Fault(NamedTuple):
    """A fault: what happens, and how soon after it an error is the answer (s)."""

    meaning: str
    within: float


class Verb(NamedTuple):
    """A verb: its path or typed command, the duration of a success without faults (s), and its outcome by fault."""

    path: str
    takes: float
    outcomes: dict[str, str]


HEARTBEAT = 1.1  # s until the next heartbeat arrives

FAULTS = {
    "none": Fault("No fault.", 0.0),
    "ack lost": Fault(
        "The first acknowledgement of each command is lost; of a command that may be repeated the second one, too. A "
        "command is sent up to three times more. Effects that a heartbeat shows need no acknowledgement.",
        4.5,
    ),
    "acks lost for good": Fault(
        "No acknowledgement arrives. Telemetry shows modes, arming and a takeoff; it does not show a speed or a new "
        "home.",
        6.5,
    ),
    "late ack": Fault("Each acknowledgement takes 2 s, so the command is sent again before it arrives.", 4.5),
    "foreign acceptance": Fault(
        "Another component of the vehicle answers ACCEPTED, the autopilot DENIED. The autopilot's answer counts.",
        2.0,
    ),
    "foreign refusal": Fault("Another component answers DENIED, the autopilot ACCEPTED.", 0.2),
    "refused": Fault("The autopilot answers DENIED, with a reason.", 2.0),
    "busy once": Fault(
        "The autopilot answers TEMPORARILY_REJECTED once. Arming and set_home are repeated, because the estimator "
        "may be settling; other commands are the client's to repeat.",
        2.0,
    ),
    "in progress": Fault("The autopilot answers IN_PROGRESS for 4 s, then ACCEPTED.", 4.5),
    "link silence": Fault("No message passes in either direction; detected after the link timeout of 5 s.", 5.2),
    "reboot": Fault(
        "The autopilot reboots and is back 2 s later, disarmed, in STABILIZE. A command without an answer is sent "
        "again and reaches it then: it can arm and set home; a speed is stored for the next flight.",
        2.0 + HEARTBEAT,
    ),
    "pilot's mode": Fault(
        "The pilot switches to another mode. A speed is stored until the vehicle flies in GUIDED again.",
        HEARTBEAT,
    ),
    "disarmed": Fault(
        "The pilot stops the motors: in flight the vehicle falls, which is not a landing. Arming that a heartbeat "
        "has shown is done, and is not repeated.",
        HEARTBEAT,
    ),
    "client gone": Fault(
        "The client hangs up: the verb ends, and the vehicle keeps its last setpoint. Verbs that land, return or "
        "stop the vehicle go on, and so do vision's flights. A script does not hang up but fails: its movements end, "
        "and the vehicle follows `on_script_exit` (here the default); a landing or return goes on.",
        0.1,
    ),
    "another client streams": Fault(
        "Another client sends velocities five times a second, before and after. A verb that stops the vehicle "
        "outranks them. Of two movements the newer one counts. A turn ends with its setpoint.",
        0.5,
    ),
    "another station flies it": Fault(
        "Another ground station gives the vehicle a target elsewhere; the vehicle's telemetry reports it.", 4.0
    ),
    "during a take-off": Fault("The vehicle has been climbing for 3 s, for another client.", 0.5),
    "in AUTO": Fault("The vehicle flies its mission.", 0.5),
    "outside the envelope": Fault(
        "An envelope is put around the place where the vehicle is; it ends 1.5 m beside and 0.5 m above it. What "
        "leads out of it is refused. A flight of `vision` sees its velocities refused, and holds.",
        5.0,
    ),
}

OUTSIDE = "409 outside_envelope"
REFUSAL = 2.0  # s for the autopilot's own answer, after a repetition
ENDED, GOES_ON = "ended", "goes on"  # no client is left to get an answer
HOLDS = "; holds"  # after an outcome: the vehicle is commanded to hold until telemetry shows it; nothing else is sent
NONE = ""  # where it cannot happen

SUCCESS = dict.fromkeys(FAULTS, "200")
LOST = {"link silence": "503 link_lost", "client gone": ENDED}
REFUSED = {
    "foreign acceptance": "500 rejected",
    "refused": "500 rejected",
    "busy once": "500 rejected",
}
FLIGHT = {"reboot": "409 not_armed", "pilot's mode": "409 mode_changed", "disarmed": "409 not_armed"}
GUIDED_ONLY = {"during a take-off": "409 busy", "in AUTO": "409 mode_changed"}
OTHERS = {"another client streams": "409 superseded", "another station flies it": "409 superseded"}
MOVING = {
    **SUCCESS,
    **LOST,
    **FLIGHT,
    **OTHERS,
    **GUIDED_ONLY,
    "outside the envelope": OUTSIDE,
}  # by setpoints, which nobody acknowledges
TRACK = {**MOVING, **REFUSED}  # of the gradys module: movements, and a return
SEES = f"{OUTSIDE}; holds"
VISION = {
    **MOVING,
    "client gone": GOES_ON,
    "another station flies it": "200",
    "outside the envelope": SEES,
}  # it repeats its own
VISION_LAND = {**VISION, **dict.fromkeys(REFUSED, f"500 rejected{HOLDS}")}  # LAND is refused, in GUIDED
VISION_MISSION = {**VISION_LAND, "another station flies it": "409 superseded", "outside the envelope": OUTSIDE}
TRAVEL = {**MOVING, "another station flies it": "200"}  # it repeats its own
MODE = {**SUCCESS, **LOST, **REFUSED, "reboot": "409 mode_changed", "pilot's mode": "409 mode_changed"}
LANDING = {**SUCCESS, **LOST, **REFUSED, **FLIGHT, "client gone": GOES_ON}
BRAKE = {**MODE, "client gone": GOES_ON}
ARM = {**MODE, "busy once": "200", "reboot": "200", "another station flies it": NONE, "in AUTO": "409 mode_changed"}
TAKEOFF = {**SUCCESS, **LOST, **REFUSED, **FLIGHT, **GUIDED_ONLY, "another station flies it": NONE}
TAKEOFF |= {"outside the envelope": OUTSIDE}
ACKED = {**SUCCESS, **LOST, **REFUSED, **FLIGHT, **GUIDED_ONLY}
STOP = {**ACKED, "in AUTO": "200", "during a take-off": "200", "client gone": GOES_ON}
RESUME = {
    **ACKED,
    "acks lost for good": "504 timeout",
    "reboot": "409 mode_changed",
    "disarmed": "200",
    "in AUTO": "200",
}
TURN = {**ACKED, "acks lost for good": "504 timeout", "another client streams": "409 superseded"}
TURN_RATE = {**MOVING, "another station flies it": "200", "outside the envelope": "200"}
PROMPT = {"client gone": NONE}  # nobody hangs up there
HOME = {**SUCCESS, **LOST, **REFUSED, "busy once": "200", "acks lost for good": "504 timeout"}
HOME |= {"outside the envelope": OUTSIDE}
SPEED = {
    **SUCCESS,
    **LOST,
    **REFUSED,
    "acks lost for good": "504 timeout",
    "during a take-off": "409 busy",
}

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
    "rtl": Verb("/command/rtl", 20.0, LANDING),
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
    "resume": Verb("/movement/resume", 0.5, RESUME),
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
}
TABLES = (4, 11, 8, 3, 4)  # verbs in each table of the page


def page() -> str:
    """docs/faults.md."""
    lines = [
        "# Faults: the answer of each verb",
        "",
        "`python tests/rules/outcomes.py` writes this page. `tests/rules/test_fault_matrix.py` flies every cell on",
        "the embedded vehicle and checks: the verb gives this answer, in time; afterwards nothing is sent until the",
        "next request: no setpoint, no mode, no command.",
        "",
        "The fault begins 3 s after the start of a flight; other verbs then wait for an acknowledgement. Setpoints",
        "of movements have no acknowledgement. A command at MAVProxy's prompt, or a script's call with",
        "`?wait=false`, has a job; the table shows the job's outcome, and the prompt prints its text. `holds` means:",
        "the vehicle is sent zero velocities until telemetry shows that it stands still, and nothing else. The",
        "tables at the end give the reason.",
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
        for fault in FAULTS:
            lines += [f"| {fault} | " + " | ".join(VERBS[group[0]].outcomes[fault] or "–" for group in groups) + " |"]
    return "\n".join([*lines, *endings_page()]) + "\n"


def endings_page() -> list[str]:
    """How flights end: the table of `core/vehicle/endings.py`."""
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
