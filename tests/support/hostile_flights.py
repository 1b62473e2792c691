"""The adversaries of tests/end_to_end/test_hostile_flights.py, and what it asks of a rig."""

from __future__ import annotations

import json
import math
import threading
import time
from typing import Any

import requests

from tests.support.processes import Rig

STEERING = {"SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "COMMAND_LONG", "COMMAND_INT"}
ASKING = {511, 512}  # MAV_CMD_SET_MESSAGE_INTERVAL, MAV_CMD_REQUEST_MESSAGE
DEADLY = """
import json, os, sys, threading, time, urllib.request

path, body, lives, die = sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4])

def ask():
    data = None if body == "-" else body.encode()
    request = urllib.request.Request(os.environ["UAVAPI_URL"] + path, data, {"Content-Type": "application/json"})
    urllib.request.urlopen(request, timeout=600)
    print(os.getpid(), flush=True)

threading.Thread(target=ask, daemon=True).start()
time.sleep(lives)
os.kill(os.getpid(), die)
"""
"""A script that asks for something, says its process id when it is answered, and dies of a signal after so many s."""
WPL = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363261\t149.165230\t584\t1
1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t10\t1
2\t0\t3\t16\t0\t0\t0\t0\t-35.3600\t149.1653\t12\t1
3\t0\t3\t16\t0\t0\t0\t0\t-35.3660\t149.1653\t12\t1
"""


class Streams:
    """Clients that each ask for a velocity 20 times a second; a context."""

    def __init__(self, rig: Rig, count: int = 2, **velocity: float) -> None:
        self._url = rig.url + "/movement/travel_at_ned"
        self._velocities = [velocity or {"vx": 4 * (-1) ** n, "vy": 0, "vz": 0} for n in range(count)]
        self._ended = threading.Event()
        self.answers: list[tuple[int, str | None]] = []
        self._threads = [threading.Thread(target=self._run, args=(one,)) for one in self._velocities]

    def _run(self, velocity: dict[str, float]) -> None:
        with requests.Session() as session:
            while not self._ended.wait(0.05):
                answer = session.post(self._url, json=velocity, timeout=30)
                self.answers.append((answer.status_code, answer.json().get("code")))

    def __enter__(self) -> Streams:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        for thread in self._threads:
            thread.join(40)

    def refusals(self, since: int = 0) -> set[str | None]:
        """The codes of what was refused since that answer."""
        return {code for status, code in self.answers[since:] if status != 200}


def speed(rig: Rig) -> float:
    velocity = rig.ok(rig.get("/telemetry/ned"))["info"]["velocity"]
    return math.hypot(velocity["vx"], velocity["vy"], velocity["vz"])


def height(rig: Rig) -> float:
    return -float(rig.ned()[2])


def highest(rig: Rig, seconds: float = 4.0) -> float:
    """The greatest height (m) of so many seconds."""
    end, most = time.monotonic() + seconds, 0.0
    while time.monotonic() < end:
        most = max(most, height(rig))
        time.sleep(0.05)
    return most


def mode(rig: Rig) -> Any:
    return rig.status()["mode"]


def mark(rig: Rig) -> Any:
    """The number of what the vehicle has received last."""
    return rig.control.ask("received", since=0)["last"]


def sent(rig: Rig, since: int) -> list[Any]:
    """What the vehicle received from then on, but for what asks for telemetry."""
    messages = rig.control.ask("received", since=since)["messages"]
    return [m for m in messages if m["name"] in STEERING and m["fields"].get("command") not in ASKING]


def until_command(rig: Rig, since: int, command: int) -> Any:
    """What came from then on, up to that command; None while it has not come."""
    messages = rig.control.ask("received", since=since)["messages"]
    for number, message in enumerate(messages, 1):
        if message["name"] == "COMMAND_LONG" and message["fields"]["command"] == command:
            return messages[:number]
    return None


def job_of(rig: Rig, location: str) -> Any:
    return requests.get(rig.url + location, timeout=10).json()


def armed_on_the_ground(rig: Rig) -> None:
    rig.control.fault("pilot_sticks", throttle=1000)
    rig.ok(rig.get("/command/arm"))


def run_deadly(rig: Rig, path: str, body: str, lives: float, die: int = 9) -> None:
    """Have a script ask for that, and die of a signal after so many s."""
    args = [path, body, str(lives), str(die)]
    rig.ok(rig.post("/mission/execute-script", script_name="deadly", args=args))


def reload(rig: Rig) -> None:
    """A fresh API, which has asked for nothing yet."""
    settings = json.dumps({"port": rig.port, **rig.settings}, separators=(",", ":"))
    rig.mavproxy.ask("module unload uavapi", "Unloaded module uavapi")
    rig.mavproxy.ask(f"module load uavapi:{settings}", "uavapi: listening")
    rig.wait_until_up()
