"""The embedded vehicles beside ArduPilot's own: their answers, what targets do in other modes, messages, battery.

    python benchmarks/bench_sim_acks_sitl.py --ardupilot ~/ardupilot [--vehicle rover] [--speedup 10]

Results are printed as by bench_sim_types_sitl.py. A command's answer is its MAV_RESULT and the texts that come.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from functools import partial

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from sim_pair import Results, compare
from sim_station import NAN, Station, place

GUIDED = {"copter": 4, "plane": 15, "quadplane": 15, "rover": 15}
OTHER = {"copter": 17, "plane": 12, "quadplane": 12, "rover": 4}  # BRAKE, LOITER, LOITER, HOLD
# Commands of a ground station and their parameters: none ends the flight for good.
COMMANDS: dict[int, tuple[float, ...]] = {
    **dict.fromkeys((17, 20, 21, 84, 85, 92, 112, 185, 189, 191, 193, 195, 197, 300, 401, 410, 3000, 12345), ()),
    22: (0, 0, 0, 0, 0, 0, 15),
    115: (90, 0, 0, 0),
    176: (1, 99),
    177: (1, 1),
    178: (1, 5, -1),
    179: (0, 0, 0, 0, 95, 181, 0),
    181: (0, 1),
    183: (9, 1500),
    186: (40, 3),
    192: (-1, 0),
    194: (0,),
    201: (0, 0, 0, 0, -35.36, 149.16, 600),
    206: (0,),
    207: (0,),
    208: (0,),
    211: (0, 0),
    218: (0, 0),
    224: (99,),
    252: (0,),
    400: (2,),
    512: (99999,),
    520: (1,),
    2500: (),
    43000: (0, 20, 0),
}
GOING = {"copter": (10, 20.0), "rover": (10, 20.0)}  # s to a target, and m that show it; of planes more than a circle
PLANE_GOING = 30, 250.0
RESTING, MOVING = 20.0, 30.0  # s over which the current is averaged
TOLERANCE = {"A": 1.5, "m": 8.0}
PLACELESS = (178, 115, 189)  # ArduPlane's SITL stops for good (AP_HAL::panic) when such an item is for now, armed
FRAMES = {"relative": 3, "AMSL": 0, "terrain": 10, "local": 1, "body": 8, "unknown": 77}


def answers(station: Station, base: int) -> dict[int, tuple[int | None, tuple[str, ...]]]:
    """By command its answer in mode `base`, which is set again before each."""
    results = {}
    for number, parameters in COMMANDS.items():
        station.mode(base)
        station.run(0.3)
        station.texts.clear()
        result = station.command(number, *parameters)
        station.run(0.3)
        results[number] = result, tuple(text for text in station.texts if not text.startswith("PreArm"))
    station.mode(base)
    return results


def item_answer(station: Station, current: int, command: int, frame: int, *numbers: float) -> int | None:
    """The MAV_MISSION_RESULT of an item that is for now: parameters 1 to 4, m north and east of home, altitude."""
    parameters, (north, east, z) = numbers[:4], numbers[4:]
    lat, lon = place(north, east)
    station.last.pop("MISSION_ACK", None)
    spot = round(lat * 1e7), round(lon * 1e7), z
    station.send.mission_item_int_send(1, 1, 0, frame, command, current, 1, *parameters, *spot, 0)
    station.wait(lambda: "MISSION_ACK" in station.last, 30.0)
    ack = station.last.get("MISSION_ACK")
    return None if ack is None else int(ack.type)


def items(kind: str, station: Station) -> dict[str, int | None]:
    """The answers to items for now, in the present mode."""
    here = (0.0, 0.0, 0.0, 0.0, 60.0, 0.0, 40.0)
    results = {f"frame {name}": item_answer(station, 2, 16, frame, *here) for name, frame in FRAMES.items()}
    for index in range(4):
        bad = [*here]
        bad[index] = NAN
        results[f"parameter {index + 1} NaN"] = item_answer(station, 2, 16, 3, *bad)
    results["altitude NaN"] = item_answer(station, 2, 16, 3, 0, 0, 0, 0, 60, 0, NAN)
    results["altitude 1e6"] = item_answer(station, 2, 16, 3, 0, 0, 0, 0, 60, 0, 1e6)
    results["an altitude"] = item_answer(station, 3, 16, 3, *here)
    for command in (17, 19, 21, 31, 82, 12345, *(() if "plane" in kind else PLACELESS)):
        results[f"command {command}"] = item_answer(station, 2, command, 3, *here)
    return results


def uploads(station: Station) -> dict[int, int]:
    """By command the answer to a mission with an item of it."""
    flights = (16, 17, 18, 19, 20, 21, 22, 30, 31, 82, 84, 85, 92, 93, 94, 112, 113, 114, 115)
    others = (177, 178, 179, 181, 183, 184, 187, 189, 191, 194, 195, 197, 201, 203, 205, 206, 207, 208, 211, 212)
    rare = (214, 215, 222, 223, 600, 2000, 3000, 12345)
    return {one: station.upload([(16, (), (0, 0), 0), (one, (), (30, 0), 20)]) for one in (*flights, *others, *rare)}


def rates(station: Station) -> dict[str, int]:
    """Hz of each message, with all streams at 4 Hz."""
    station.send.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 4, 1)
    station.run(3)
    heard: Counter[str] = Counter()
    station.listener = heard.update
    station.run(10)
    station.listener = None
    return {name: round(count / 10) for name, count in sorted(heard.items()) if count >= 5}


def current(station: Station, seconds: float) -> float:
    """Mean current of the battery, A."""
    amperes, end = [], station.at + seconds
    while station.at < end:
        station.hear()
        amperes.append(station.last["SYS_STATUS"].current_battery / 100)
    return round(sum(amperes) / len(amperes), 1)


def after_target(station: Station, kind: str, send: Callable[[], object]) -> tuple[int, bool]:
    """The mode after a target 300 m to the north was sent in a mode that takes none, and whether it goes there."""
    seconds, nearer = GOING.get(kind, PLANE_GOING)
    station.mode(OTHER[kind])
    station.run(6)
    before = station.away(300, 0)
    for _ in range(seconds):
        send()
        station.run(1)
    return station.heartbeat[2], before - station.away(300, 0) > nearer


def in_other_mode(station: Station, kind: str) -> dict[str, tuple[int, bool]]:
    """What becomes of targets and velocities in a mode that takes none."""
    lat, lon = place(300, 0)
    sent = partial(after_target, station, kind)
    velocity = (0, 1, 1, 1, 0x0DC7, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0)
    where = (0, 1, 1, 6, 0x0DF8, round(lat * 1e7), round(lon * 1e7), 40, 0, 0, 0, 0, 0, 0, 0, 0)
    return {
        "position": sent(partial(station.drive_to, 300, 0)),
        "velocity": sent(partial(station.send.set_position_target_local_ned_send, *velocity)),
        "place": sent(partial(station.send.set_position_target_global_int_send, *where)),
        "item": sent(partial(item_answer, station, 2, 16, 3, 0, 0, 0, 0, 300, 0, 40)),
        "reposition": sent(partial(station.reposition, 300, 0, 40, 0)),
    }


def set_off(kind: str, station: Station) -> None:
    """Arm it and get it going, in GUIDED."""
    station.mode(13 if kind == "plane" else GUIDED[kind])
    assert station.arm() == 0, station.texts[-5:]
    if kind == "plane":
        station.wait(lambda: station.height > 45, 60)
        station.mode(GUIDED[kind])
    elif kind != "rover":
        station.run(4)
        station.command(22, 0, 0, 0, 0, 0, 0, 30)
        station.wait(lambda: station.height > 29, 60)


def sequence(kind: str, station: Station) -> Results:
    results: Results = {"Hz of the messages, at rest": (rates(station), 0)}
    results["current at rest, A"] = (current(station, RESTING), TOLERANCE["A"])
    results["commands, disarmed"] = (answers(station, 0), 0)
    results["items for now, disarmed in mode 0"] = (items(kind, station), 0)
    results["uploads"] = (uploads(station), 0)
    station.upload([(16, (), (0, 0), 0)])
    set_off(kind, station)
    station.reposition(-200, 0, 40)
    station.run(10)
    results["current on the way, A"] = (current(station, MOVING), TOLERANCE["A"])
    results["Hz of the messages, on the way"] = (rates(station), 0)
    battery = station.last.get("BATTERY_STATUS")
    results["mAh so far"] = (None if battery is None else round(battery.current_consumed, -1), 60)
    results["commands, armed in GUIDED"] = (answers(station, GUIDED[kind]), 0)
    results["items for now, armed in GUIDED"] = (items(kind, station), 0)
    results["mode, and whether it goes to the target, in another mode"] = (in_other_mode(station, kind), 0)
    return results


if __name__ == "__main__":
    sys.exit(compare(__doc__, {kind: partial(sequence, kind) for kind in GUIDED}))
