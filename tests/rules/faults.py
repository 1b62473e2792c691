"""Faults, and the outcomes that verbs have in common; `outcomes.py` has the table."""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """A fault: what happens, and how soon after it an error is the answer (s)."""

    meaning: str
    within: float


class Verb(NamedTuple):
    """A verb of a type of vehicle: its path or typed command, a success's duration (s), and its outcome by fault."""

    path: str
    takes: float
    outcomes: dict[str, str]
    vehicle: str = "copter"


HEARTBEAT = 1.1  # s until the next heartbeat arrives
WORDS = 0.1  # s that an answer waits for what the autopilot says about a change

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
    "main loop stands": Fault(
        "MAVProxy's main loop stands for 8 s: it reads and writes nothing. What was sent before is done; what is "
        "sent then is too old afterwards, but for what stops the vehicle.",
        12.0,
    ),
    "told once, lost": Fault(
        "What the vehicle tells once, when it is asked or when it changes, is lost the first time: home, a "
        "parameter, an item of its mission, a text.",
        12.0,
    ),
    "reboot": Fault(
        "The autopilot reboots and is back 2 s later, disarmed, in STABILIZE. A command without an answer is sent "
        "again and reaches it then: it can set home; a speed is stored for the next flight. Arming is not sent "
        "again.",
        2.0 + HEARTBEAT + WORDS,
    ),
    "pilot's mode": Fault(
        "The pilot switches to another mode. A speed is stored until the vehicle flies in GUIDED again.",
        HEARTBEAT + WORDS,
    ),
    "disarmed": Fault(
        "The pilot stops the motors: in flight the vehicle falls, which is not a landing. Arming that a heartbeat "
        "has shown is done, and is not repeated.",
        HEARTBEAT + WORDS,
    ),
    "client gone": Fault(
        "The client hangs up: the verb ends, and the vehicle keeps its last setpoint. Verbs that land, return, "
        "stop or resume go on, and so do vision's flights. A script does not hang up but fails: its movements end, "
        "and the vehicle follows `on_script_exit` (here the default); a landing or return goes on.",
        0.1,
    ),
    "another client streams": Fault(
        "Another client sends velocities five times a second, before and after. A verb that stops the vehicle "
        "outranks them. Of two movements the newer one counts. A turn ends with its setpoint.",
        0.5,
    ),
    "another station flies it": Fault(
        "Another ground station gives the vehicle a target elsewhere; the vehicle's telemetry reports it. The next "
        "one of our velocities hides it (here at once): they end if a report comes before that, or if the "
        "acknowledgement of a DO_REPOSITION passes.",
        4.0,
    ),
    "two autopilots": Fault(
        "A second autopilot with the same system id has been on the link for some seconds. It is said at the prompt, "
        "on the page and in the answer, and nothing is sent until there is one.",
        0.5,
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

TWO = {"two autopilots": "409 busy"}
SUCCESS = {**dict.fromkeys(FAULTS, "200"), **TWO}
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
VISION_LAND |= {"main loop stands": "409 aborted"}  # it comes down meanwhile, and nobody knows why
VISION_MISSION = {
    **VISION_LAND,
    "main loop stands": "200",
    "another station flies it": "409 superseded",
    "outside the envelope": OUTSIDE,
}
TRAVEL = {**MOVING, "another station flies it": "200"}  # it repeats its own
MODE = {**SUCCESS, **LOST, **REFUSED, "reboot": "409 mode_changed", "pilot's mode": "409 mode_changed"}
LANDING = {**SUCCESS, **LOST, **REFUSED, **FLIGHT, "client gone": GOES_ON}
BRAKE = {**MODE, "client gone": GOES_ON}
ARM = {
    **MODE,
    "busy once": "200",
    "reboot": "504 timeout",
    "another station flies it": NONE,
    "in AUTO": "409 mode_changed",
}
TAKEOFF = {**SUCCESS, **LOST, **REFUSED, **FLIGHT, **GUIDED_ONLY, "another station flies it": NONE}
TAKEOFF |= {"outside the envelope": OUTSIDE}
ACKED = {**SUCCESS, **LOST, **REFUSED, **FLIGHT, **GUIDED_ONLY}
STOP = {**ACKED, "in AUTO": "200", "during a take-off": "200", "client gone": GOES_ON}
RESUME = {
    **ACKED,
    "client gone": GOES_ON,
    "acks lost for good": "504 timeout",
    "reboot": "409 mode_changed",
    "disarmed": "200",
    "in AUTO": "200",
}
TURN = {**ACKED, "acks lost for good": "504 timeout", "another client streams": "409 superseded"}
TURN_RATE = {**MOVING, "outside the envelope": "200"}
TURN_RATE |= {"main loop stands": "409 expired"}  # it asks what is flown before it sends
PROMPT = {"client gone": NONE, "two autopilots": NONE}  # nobody hangs up there; it is refused before it has a job
HOME = {**SUCCESS, **LOST, **REFUSED, "busy once": "200", "acks lost for good": "504 timeout"}
HOME |= {"outside the envelope": OUTSIDE}
SPEED = {
    **SUCCESS,
    **LOST,
    **REFUSED,
    "acks lost for good": "504 timeout",
    "during a take-off": "409 busy",
}
