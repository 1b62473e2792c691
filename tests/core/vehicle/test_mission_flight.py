from __future__ import annotations

from typing import Any

import pytest
from pymavlink import mavutil

from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.core.errors import Busy, ModeChanged, NotArmed, Stale
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.telemetry.trip import INITIAL
from mavproxy_uavapi.core.vehicle import mission_flight
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.drone import Drone
from tests.support.pilotage import Pilotage
from tests.support.virtual_time import FastLoop

mavlink = mavutil.mavlink

ITEMS = [MissionItem(number, 3, (0.0, 0.0, 0.0, 0.0), 0, 0, 10.0) for number in (22, 16, 20)]


class Flight:
    """A mission on the scripted drone: what it holds, and what it tells of it."""

    def __init__(
        self, loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self._loop, self._drone, self._pilotage, self._copter = loop, drone, pilotage, copter
        self.items = ITEMS
        monkeypatch.setattr(copter.waypoints, "download", self._download)

    async def _download(self) -> Any:
        return None, self.items

    def tell(self, seq: int, state: int = mavlink.MISSION_STATE_ACTIVE, total: int = 3) -> None:
        self._drone.send("mission_current", seq=seq, total=total, mission_state=state)
        self._loop.settle()

    def under_way(self) -> Job:
        """As `start`, for a client who waits for its end; a second later."""
        job = self.start(until_complete=True)
        self._loop.pass_time(1.0)
        return job

    def start(self, **kwargs: Any) -> Job:
        async def fly(job: Job) -> None:
            await mission_flight.fly(self._copter, job, **kwargs)

        return self._pilotage.start(fly)


@pytest.fixture
def flight(
    loop: FastLoop, drone: Drone, copter: Vehicle, pilotage: Pilotage, monkeypatch: pytest.MonkeyPatch
) -> Flight:
    return Flight(loop, drone, copter, pilotage, monkeypatch)


def orders(drone: Drone) -> list[int]:
    return [message.command for message in drone.orders() if message.get_type() == "COMMAND_LONG"]


def test_start_is_from_the_first_item_in_auto(
    loop: FastLoop, flying: Drone, flight: Flight, pilotage: Pilotage
) -> None:
    job = flight.start()
    loop.pass_time(1.0)
    expected = [mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, mavlink.MAV_CMD_MISSION_START]  # which switches to AUTO
    assert orders(flying) == expected
    assert flying.commands(expected[0])[0].param1 == 1
    assert flying.mode == "AUTO"
    flight.tell(1)
    assert pilotage.result(job) == "done"


def test_start_needs_an_armed_vehicle_a_mission_and_no_pilot(
    loop: FastLoop, drone: Drone, flight: Flight, pilotage: Pilotage
) -> None:
    with pytest.raises(NotArmed):
        pilotage.result(flight.start())
    drone.fly()
    loop.settle()
    flight.items = []
    with pytest.raises(Busy, match="no mission"):
        pilotage.result(flight.start())
    flight.items = ITEMS
    drone.pilot("LOITER")
    loop.settle()
    with pytest.raises(ModeChanged, match="LOITER"):
        pilotage.result(flight.start())
    assert drone.orders() == []


def test_nothing_is_sent_to_who_took_guided_while_the_mission_was_read(
    loop: FastLoop,
    flying: Drone,
    flight: Flight,
    pilotage: Pilotage,
    copter: Vehicle,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def read(_job: Any) -> list[MissionItem]:
        for mode in ("LOITER", "GUIDED"):
            flying.pilot(mode)
            await copter.waiting.heartbeat_after(copter.clock())
        return ITEMS

    monkeypatch.setattr(copter, "mission_to_fly", read)
    with pytest.raises(ModeChanged, match="meanwhile"):
        pilotage.result(flight.start())
    assert flying.orders() == []


def test_wait_ends_when_the_mission_is_complete(
    loop: FastLoop, flying: Drone, flight: Flight, pilotage: Pilotage
) -> None:
    job = flight.under_way()
    for seq in (1, 2, 3):
        flight.tell(seq)
    assert job.running
    assert job.progress["item"] == 3
    flight.tell(3, mavlink.MISSION_STATE_COMPLETE)
    assert job.running, "it may have been overtaken by the answer to the start"
    loop.pass_time(INITIAL)
    flight.tell(3, mavlink.MISSION_STATE_COMPLETE)
    assert pilotage.result(job) == "done"


def landed(flying: Drone, loop: FastLoop) -> None:
    flying.armed = False
    flying.tell("HEARTBEAT")
    loop.settle()


def test_disarming_in_the_landing_item_is_the_end(
    loop: FastLoop, flying: Drone, flight: Flight, pilotage: Pilotage
) -> None:
    job = flight.under_way()
    flight.tell(3)
    landed(flying, loop)
    flight.tell(0, mavlink.MISSION_STATE_NOT_STARTED)
    assert pilotage.result(job) == "done"


def test_first_item_that_comes_before_the_disarmed_heartbeat_is_no_failure(
    loop: FastLoop, flying: Drone, flight: Flight, pilotage: Pilotage
) -> None:
    job = flight.under_way()
    flight.tell(3)
    loop.pass_time(1.0)
    flight.tell(1)
    loop.pass_time(0.5)
    landed(flying, loop)
    assert pilotage.result(job) == "done"


@pytest.mark.parametrize(
    ("items", "told", "waits"),
    [(ITEMS, (3, 1), 6.0), (ITEMS, (2,), 0.0), (ITEMS[:2], (2,), 0.0)],
    ids=["long after a final item", "before it", "in a last item that is no landing"],
)
def test_disarming_anywhere_else_is_a_failure(
    loop: FastLoop,
    flying: Drone,
    flight: Flight,
    pilotage: Pilotage,
    items: list[MissionItem],
    told: tuple[int, ...],
    waits: float,
) -> None:
    flight.items = items
    job = flight.under_way()
    for seq in told:
        flight.tell(seq, total=len(items))
    loop.pass_time(waits)
    landed(flying, loop)
    with pytest.raises(NotArmed):
        pilotage.result(job)


@pytest.mark.parametrize("velocity", [(12.0, 0.0, 0.0), (0.0, 0.0, 9.0)])
def test_disarming_in_the_landing_item_at_speed_is_a_failure(
    loop: FastLoop, flying: Drone, flight: Flight, pilotage: Pilotage, velocity: tuple[float, float, float]
) -> None:
    job = flight.under_way()
    flight.tell(3)
    flying.mute.add("GLOBAL_POSITION_INT")
    north, east, down = (round(100 * speed) for speed in velocity)
    flying.send("global_position_int", relative_alt=20_000, vx=north, vy=east, vz=down)
    landed(flying, loop)
    with pytest.raises(NotArmed, match="disarmed in flight"):
        pilotage.result(job)


def test_pilot_who_leaves_auto_ends_the_wait(
    loop: FastLoop, flying: Drone, flight: Flight, pilotage: Pilotage
) -> None:
    job = flight.under_way()
    flight.tell(1)
    sent = len(flying.orders())
    flying.pilot("LOITER")
    with pytest.raises(ModeChanged, match="LOITER"):
        pilotage.result(job)
    loop.pass_time(5.0)
    assert len(flying.orders()) == sent


def test_older_autopilot_without_a_state_is_understood(
    loop: FastLoop, flying: Drone, flight: Flight, pilotage: Pilotage
) -> None:
    job = flight.under_way()
    flight.tell(3, mavlink.MISSION_STATE_UNKNOWN)
    assert job.running
    flying.send("mission_item_reached", seq=3)
    assert pilotage.result(job) == "done"


def test_progress_is_reported_and_a_mission_before_this_one_is_not(
    loop: FastLoop, flying: Drone, copter: Vehicle
) -> None:
    with pytest.raises(Stale):
        mission_flight.progress(copter)
    flying.send("mission_item_reached", seq=9)
    flying.send("mission_current", seq=2, total=65535, mission_state=mavlink.MISSION_STATE_PAUSED)
    loop.pass_time(0.5)
    copter.waypoints.changed_at = loop.time()
    reported = mission_flight.progress(copter)
    assert reported == {
        "current": 2,
        "total": None,
        "last_reached": None,
        "state": "paused",
        "mode": "GUIDED",
        "distance_m": None,
    }
    flying.send("mission_item_reached", seq=1)
    flying.send("nav_controller_output", wp_dist=14)
    flying.pilot("AUTO")
    loop.settle()
    assert (mission_flight.progress(copter)["last_reached"], mission_flight.progress(copter)["distance_m"]) == (1, 14)


def test_an_old_report_is_not_told_as_a_new_one(loop: FastLoop, flying: Drone, copter: Vehicle) -> None:
    assert mission_flight.recent_progress(copter) is None
    flying.send("mission_current", seq=2, total=3, mission_state=mavlink.MISSION_STATE_ACTIVE)
    flying.send("nav_controller_output", wp_dist=14)
    flying.pilot("AUTO")
    loop.settle()
    recent = mission_flight.recent_progress(copter)
    assert recent is not None and recent["distance_m"] == 14
    flying.mute |= {"MISSION_CURRENT", "NAV_CONTROLLER_OUTPUT"}
    loop.pass_time(10.0)
    assert mission_flight.recent_progress(copter) is None
    assert mission_flight.progress(copter)["distance_m"] is None
