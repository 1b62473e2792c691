"""A few cells of the fault matrix with real processes, sockets and clocks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
import requests

from tests.rules import outcomes
from tests.support import processes
from tests.support.processes import Rig

GUARD = 1.8  # s; a command would be sent again after 1.5 s
MODE, HOME, SPEED = 176, 179, 178  # MAV_CMD_DO_SET_MODE, DO_SET_HOME, DO_CHANGE_SPEED
# What MAVProxy asks on its own account.
QUESTIONS = {
    "PARAM_REQUEST_READ",
    "PARAM_REQUEST_LIST",
    "REQUEST_DATA_STREAM",
    "HEARTBEAT",
    "TIMESYNC",
    "SYSTEM_TIME",
}
INTERVAL = 511  # MAV_CMD_SET_MESSAGE_INTERVAL: our watch over the telemetry


def long(*values: Any) -> Any:
    """A case that goes the way of another one."""
    return pytest.param(*values, marks=pytest.mark.long)


@pytest.fixture(scope="module", params=["embedded", pytest.param("ardupilot", marks=pytest.mark.sitl)])
def rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A vehicle that misbehaves, and a MAVProxy with the API."""
    directory = tmp_path_factory.mktemp("faults")
    made = (
        processes.embedded(directory) if request.param == "embedded" else processes.ardupilot_with_faults(directory)
    )
    yield made
    made.stop()


def outcome(answer: requests.Response) -> str:
    code = answer.json().get("code")
    return f"{answer.status_code} {code}" if code else str(answer.status_code)


def expected(verb: str, fault: str) -> str:
    return outcomes.VERBS[verb].outcomes[fault]


def assert_nothing_is_sent(rig: Rig) -> None:
    since = rig.control.ask("received", since=0)["last"]
    time.sleep(GUARD)
    received = rig.control.ask("received", since=since)["messages"]
    orders = [m for m in received if m["name"] not in QUESTIONS and m["fields"].get("command") != INTERVAL]
    assert orders == []


def running(rig: Rig, verb: str) -> bool:
    jobs = rig.ok(rig.get("/jobs"))["jobs"]
    return any(job["state"] == "running" and job["verb"].endswith(verb) for job in jobs)


def answer_of(rig: Rig, method: str, verb: str, body: dict[str, Any] | None = None, **fault: Any) -> Any:
    """The answer to a request whose job meets a fault."""
    waiting = rig.begin(method, verb, body)
    processes.eventually(lambda: running(rig, verb), what=f"a job of {verb}")
    rig.control.fault(**fault)
    return waiting.answer(60)


@pytest.mark.parametrize(
    ("verb", "query", "fault", "how"),
    [
        ("set_ground_speed", "?new_v=5", "refused", {"name": "refuse", "result": 2}),
        long("set_ground_speed", "?new_v=5", "foreign refusal", {"name": "foreign_ack", "result": 2, "system": 1}),
        long("set_home", "", "acks lost for good", {"name": "lose_acks"}),
        ("brake", "", "acks lost for good", {"name": "lose_acks"}),
    ],
)
def test_command_meets_fault(rig: Rig, verb: str, query: str, fault: str, how: dict[str, Any]) -> None:
    rig.in_the_air(10)
    rig.control.fault(command={"set_home": HOME, "brake": MODE}.get(verb, SPEED), **how)
    answer = rig.get(outcomes.VERBS[verb].path + query)
    rig.control.ask("clear")
    assert outcome(answer) == expected(verb, fault)
    assert_nothing_is_sent(rig)


@pytest.mark.parametrize(("fault", "how"), [("pilot's mode", {"name": "pilot_mode", "mode": "LOITER"})])
def test_flight_meets_fault(rig: Rig, fault: str, how: dict[str, Any]) -> None:
    rig.in_the_air(10)
    x, y, z = rig.ned()
    answer = answer_of(rig, "POST", "/movement/go_to_ned_wait", {"x": x + 4000, "y": y, "z": z}, **how)
    assert outcome(answer) == expected("go_to_ned_wait", fault)
    assert_nothing_is_sent(rig)


def test_client_that_is_gone_ends_its_travel(rig: Rig) -> None:
    rig.in_the_air(10)
    verb = "/movement/travel_at_ned"
    with rig.unanswered("POST", verb, {"vx": 1, "vy": 0, "vz": 0, "duration": 3600}):
        processes.eventually(lambda: running(rig, verb), what="its job")
    assert expected("travel, with duration", "client gone") == outcomes.ENDED
    processes.eventually(lambda: all(job["state"] != "running" for job in rig.get("/jobs").json()["jobs"]), 60)
    assert_nothing_is_sent(rig)


@pytest.mark.long
def test_motors_that_stop_in_flight_are_no_landing(rig: Rig) -> None:
    rig.in_the_air(120)
    rig.ok(rig.get("/command/set_sim_speedup", sim_factor=1))  # a busy machine might miss a faster fall
    try:
        assert outcome(answer_of(rig, "GET", "/command/rtl", name="pilot_disarm")) == expected("rtl", "disarmed")
        assert_nothing_is_sent(rig)
    finally:
        rig.ok(rig.get("/command/set_sim_speedup", sim_factor=10))
