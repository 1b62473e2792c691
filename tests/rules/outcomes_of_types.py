"""The outcomes of the verbs of planes, QuadPlanes and rovers, for the faults that may end differently there.

Not flown again: faults of acknowledgements that come late, twice or from others, and what another client's stream
does. `CommandSender` and `CommandAuthority` see to these, for all types alike.
"""

from __future__ import annotations

from tests.rules.faults import ENDED, FAULTS, GOES_ON, HEARTBEAT, NONE, OUTSIDE, TWO, Verb

SAME = dict.fromkeys(FAULTS, NONE)
CHANGED, BUSY, DISARMED = "409 mode_changed", "409 busy", "409 not_armed"
ANY = {
    **SAME,
    **TWO,
    "none": "200",
    "acks lost for good": "200",
    "refused": "500 rejected",
    "link silence": "503 link_lost",
    "main loop stands": "200",
    "told once, lost": "200",
    "pilot's mode": CHANGED,
    "client gone": ENDED,
    "during a take-off": "200",
    "in AUTO": "200",
}
FLIGHT = {**ANY, "disarmed": DISARMED, "client gone": GOES_ON}
MOVING = {**FLIGHT, "client gone": ENDED, "during a take-off": CHANGED, "in AUTO": CHANGED}
MOVING |= {"reboot": DISARMED, "another station flies it": "409 superseded", "outside the envelope": OUTSIDE}
ACKED = {"acks lost for good": "504 timeout"}
AROUND = {"during a take-off": NONE}  # a rover has none
TRAVEL = {**MOVING, **AROUND, "refused": "200", "another station flies it": "200"}  # it repeats its own
SPEED = {**ANY, **AROUND, **ACKED, "refused": "200", "pilot's mode": "200"}  # it stands: kept for the next movement
PLANE = {
    "arm": Verb("/command/arm", 5.0, {**ANY, **ACKED, "in AUTO": CHANGED, "during a take-off": CHANGED}),
    "takeoff": Verb("/command/takeoff", 90.0, {**MOVING, **ACKED, "another station flies it": NONE, "reboot": NONE}),
    "land": Verb("/command/land", 150.0, {**FLIGHT, "acks lost for good": NONE, "in AUTO": NONE}),
    "rtl": Verb("/command/rtl", 90.0, {**FLIGHT, "in AUTO": NONE}),
    "go_to_gps_wait": Verb("/movement/go_to_gps_wait", 60.0, {**MOVING, **ACKED}),
    "stop": Verb("/movement/stop", 7.0, FLIGHT),  # low over the ground it climbs first
    "guided": Verb("/command/guided", HEARTBEAT, ANY),
    "set_ground_speed": Verb(
        "/command/set_ground_speed",
        0.5,
        {**ANY, "acks lost for good": NONE, "pilot's mode": "200", "during a take-off": BUSY},
    ),
}
QUADPLANE = {
    "takeoff": Verb(
        "/command/takeoff", 40.0, {**MOVING, "during a take-off": BUSY, "another station flies it": NONE}
    ),
    "land": Verb("/command/land", 60.0, {**SAME, "none": "200", "refused": "500 rejected", "pilot's mode": CHANGED}),
    "rtl": Verb("/command/rtl", 60.0, {**SAME, "none": "200"}),
    "stop": Verb("/movement/stop", HEARTBEAT, {**SAME, "none": "200", "during a take-off": "200"}),
}
ROVER = {
    "arm": Verb("/command/arm", 5.0, {**ANY, **AROUND, "in AUTO": CHANGED}),
    "rtl": Verb("/command/rtl", 30.0, {**FLIGHT, **AROUND}),
    "go_to_ned_wait": Verb("/movement/go_to_ned_wait", 30.0, {**MOVING, **AROUND, "refused": "200"}),
    "travel, with duration": Verb("/movement/travel_at_ned", 7.0, TRAVEL),
    "stop": Verb("/movement/stop", 5.0, {**FLIGHT, **AROUND}),
    "guided": Verb("/command/guided", HEARTBEAT, {**ANY, **AROUND}),
    "set_reverse": Verb("/command/set_reverse", 0.5, {**ANY, **AROUND, **ACKED, "disarmed": DISARMED}),
    "set_ground_speed": Verb("/command/set_ground_speed", 1.2, SPEED),
}
TYPES = {"plane": PLANE, "quadplane": QUADPLANE, "rover": ROVER}
VERBS = {
    f"{type_}: {name}": verb._replace(vehicle=type_) for type_, verbs in TYPES.items() for name, verb in verbs.items()
}
TABLES = tuple(len(verbs) for verbs in TYPES.values())
