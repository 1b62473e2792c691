"""What each type of vehicle flies or drives, and what is measured meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from sim_pair import Results
from sim_station import Station


def acknowledgements(station: Station, numbers: tuple[int, ...]) -> dict[int, int | None]:
    return {number: station.command(number) for number in numbers}


def modes(station: Station, numbers: tuple[int, ...]) -> dict[int, tuple[Any, ...]]:
    """By mode: the acknowledgement, base mode and mode after it, that of arming."""
    answers = {}
    for number in numbers:
        result = station.mode(number)
        station.run(0.3)
        beat = station.heartbeat
        answers[number] = (result, beat[1], beat[2], station.arm())
        station.disarm()
    return answers


def rover(station: Station) -> Results:
    results: Results = {"heartbeat": (station.heartbeat, 0), "landed state": (station.landed_state, 0)}
    results["streams"] = (station.streams(), 0)
    results["modes"] = (modes(station, (0, 1, 3, 4, 5, 6, 8, 10, 11, 12, 15, 16, 2)), 0)
    numbers = (22, 21, 115, 193, 178, 194, 213, 17, 195, 185, 189, 84, 300, 401)
    results["commands"] = (acknowledgements(station, numbers), 0)
    station.mode(15)
    station.arm()
    station.drive_to(60, 0)
    station.reached.clear()
    results["60 m in GUIDED, s"] = (station.wait(lambda: bool(station.reached), 60), 2)
    station.drive_to(60, 30)
    station.run(9)
    results["a right angle: aside of the line after 9 s, m"] = (round(abs(station.position[0] - 60), 1), 2)
    for name, number in (("HOLD", 4), ("LOITER", 5)):
        station.mode(15)
        station.drive_to(-200, 30)
        station.run(14)
        start = station.position
        station.mode(number)
        station.wait(lambda: station.speed < 0.1, 30)
        results[f"{name} from 5 m/s, m"] = (round(station.away(*start), 1), 1.5)
    station.mode(15)
    station.drive_to(0, 0)
    station.run(8)
    results["disarm on the way"] = (station.disarm(), 0)
    start = station.position
    station.wait(lambda: station.speed < 0.1, 30)
    results["it rolls, m"] = (round(station.away(*start), 1), 1.5)
    station.arm()
    station.run(5)
    results["armed again it goes on"] = (station.speed > 2, 0)
    station.texts.clear()
    station.mode(11)
    results["RTL brings it within, m"] = (_come_home(station), 1)
    station.reached.clear()
    station.upload(
        [
            (16, (), (0, 0), 0),
            (16, (), (30, 0), 0),
            (178, (1, 2), None, 0),
            (16, (), (30, 30), 0),
            (194, (1,), None, 0),
            (16, (3,), (0, 30), 0),
            (194, (0,), None, 0),
            (93, (2, -1, -1, -1), None, 0),
            (19, (2,), (0, 0), 0),
            (20, (), None, 0),
        ]
    )
    station.command(mavlink.MAV_CMD_MISSION_START)
    results["mission, s"] = (station.wait(lambda: "Mission Complete" in station.texts, 200), 8)
    station.run(1)
    results["mission, items told"] = (list(station.reached), 0)
    return results


def _come_home(station: Station) -> float:
    station.wait(lambda: "Reached destination" in station.texts, 120)
    station.run(2)
    return round(station.away(0, 0), 1)


def plane(station: Station) -> Results:
    results: Results = {"heartbeat": (station.heartbeat, 0), "landed state": (station.landed_state, 0)}
    results["streams"] = (station.streams(), 0)
    results["modes"] = (modes(station, (0, 1, 2, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15, 16, 17, 20)), 0)
    station.mode(0)
    numbers = (22, 21, 115, 193, 178, 194, 195, 185, 189, 191, 17, 20, 300, 401)
    results["commands"] = (acknowledgements(station, numbers), 0)
    station.mode(13)
    station.arm()
    results["take-off to 48 m, s"] = (station.wait(lambda: station.height > 48, 40), 1.5)
    results["landed state then"] = (station.landed_state, 0)
    station.run(40)
    results["disarm in flight"] = (station.disarm(), 0)
    results["reposition"] = (station.reposition(500, 0, 100), 0)
    results["climb from 50 m to 98 m, s"] = (station.wait(lambda: station.height > 98, 60), 4)
    station.run(20)
    radius, speed = station.circle(500, 0)
    results["circle of WP_LOITER_RAD 80, m"] = (radius, 4)
    results["speed over ground at 22 m/s, m/s"] = (speed, 0.5)
    station.reposition(500, 0, 100, radius=120)
    station.run(40)
    results["circle of radius 120, m"] = (station.circle(500, 0)[0], 5)
    station.reposition(500, 0, 100, radius=1)
    station.run(40)
    results["circle of radius 1 after it, m"] = (station.circle(500, 0)[0], 4)
    station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 0, 26, -1)
    station.run(15)
    results["airspeed of 26, m/s"] = (round(station.last["VFR_HUD"].airspeed, 1), 0.7)
    station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 0, -2, -1)
    results["RTL"] = (station.mode(11), 0)
    results["home within 150 m, s"] = (station.wait(lambda: station.away(0, 0) < 150, 90), 5)
    station.parameter("RTL_AUTOLAND", 2)
    station.reached.clear()
    station.texts.clear()
    station.upload(
        [
            (16, (), (0, 0), 0),
            (16, (), (400, 0), 100),
            (178, (0, 26, -1), None, 0),
            (16, (), (400, 400), 120),
            (18, (1, 0, 60), (0, 400), 100),
            (19, (20,), (-200, 400), 100),
            (31, (1, 80), (-400, 0), 60),
            (189, (), None, 0),
            (16, (), (-700, 0), 40),
            (16, (), (-400, 0), 20),
            (21, (), (0, 0), 0),
        ]
    )
    station.command(mavlink.MAV_CMD_MISSION_START)
    results["mission with a landing, s"] = (station.wait(lambda: not station.armed, 500), 12)
    station.run(1)
    results["mission, items told"] = (list(station.reached), 0)
    results["it stops from the landing point, m"] = (round(station.away(0, 0), 1), 20)
    results["arming after it"] = (station.arm(), 0)
    return results


def quadplane(station: Station) -> Results:
    results: Results = {"heartbeat": (station.heartbeat, 0), "landed state": (station.landed_state, 0)}
    results["modes"] = (modes(station, (0, 15, 17, 18, 19, 20, 21)), 0)
    station.mode(15)
    results["take-off disarmed"] = (station.command(22, 0, 0, 0, 0, 0, 0, 20), 0)
    station.arm()
    station.run(4)
    results["take-off"] = (station.command(22, 0, 0, 0, 0, 0, 0, 20), 0)
    results["20 m, s"] = (station.wait(lambda: station.height > 19.5, 40), 1.5)
    station.run(3)
    results["landed state there"] = (station.landed_state, 0)
    results["take-off again"] = (station.command(22, 0, 0, 0, 0, 0, 0, 30), 0)
    station.reposition(300, 0, 50)
    results["transition, s"] = (station.wait(lambda: "Transition done" in station.texts, 40), 2)
    station.run(30)
    results["circle of WP_LOITER_RAD 60, m"] = (station.circle(300, 0)[0], 4)
    results["QRTL"] = (station.mode(21), 0)
    results["QRTL to disarming, s"] = (station.wait(lambda: not station.armed, 200), 12)
    results["it lands from home, m"] = (round(station.away(0, 0), 1), 1)
    station.mode(15)
    station.arm()
    station.run(4)
    station.command(22, 0, 0, 0, 0, 0, 0, 20)
    station.run(15)
    station.mode(20)
    results["QLAND from 20 m, s"] = (station.wait(lambda: not station.armed, 120), 4)
    station.texts.clear()
    station.reached.clear()
    station.upload(
        [
            (16, (), (0, 0), 0),
            (84, (), None, 30),
            (16, (), (300, 0), 50),
            (16, (), (300, 300), 50),
            (85, (), (0, 0), 0),
        ]
    )
    station.mode(10)
    station.arm()
    results["mission with take-off and landing, s"] = (
        station.wait(lambda: "Land complete" in station.texts, 300),
        15,
    )
    station.run(1)
    results["mission, items told"] = (list(station.reached), 0)
    return results


SEQUENCES: dict[str, Callable[[Station], Results]] = {"rover": rover, "plane": plane, "quadplane": quadplane}
