"""The order of a flight's verbs; what they do in the air is in end_to_end/test_gradys_tracks.py."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_gradys.tracks.flight import TrackFlight, flight_of
from mavproxy_gradys.tracks.formats import TrackWaypoint
from mavproxy_uavapi.core.errors import Invalid, NotSupported
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.telemetry.readings import GlobalPosition
from tests.gradys.conftest import TelemetrySource
from tests.support.messages import message_of
from tests.support.virtual_time import FastLoop

METRES_PER_DEGREE = 111318.845
HERE = SimpleNamespace(lat=-158400810, lon=-479266420)


class Copter:
    """Does what it is asked at once, and remembers it; north of `HERE` by `north` m."""

    def __init__(self, height: float = 0.0) -> None:
        self.state = SimpleNamespace(armed=height > 0, landed=height == 0, system=1)
        self.height = height
        self.did: list[Any] = []
        self.north = 0.0

    def position(self) -> Any:
        lat = HERE.lat + self.north * 1e7 / METRES_PER_DEGREE
        return GlobalPosition.of(message_of("global_position_int", lat=lat, lon=HERE.lon))

    async def arm(self, _job: Any) -> None:
        self.did.append("arm")

    async def takeoff(self, _job: Any, alt: float) -> None:
        self.height = alt
        self.did.append(("takeoff", alt))

    async def go_to(self, _job: Any, target: Any, **_: Any) -> None:
        self.north = (target.lat * 1e7 - HERE.lat) / 1e7 * METRES_PER_DEGREE
        self.height = target.alt
        self.did.append((round(self.north), target.alt))

    async def wait_for_heartbeat(self) -> None:
        """It is heard at once."""

    def held_by(self, mode: str) -> None:
        assert mode == "GUIDED"

    async def rtl(self, _job: Any) -> None:
        self.did.append("rtl")


def place(north: float, alt: float) -> TrackWaypoint:
    return TrackWaypoint(HERE.lat / 1e7 + north / METRES_PER_DEGREE, HERE.lon / 1e7, alt)


def flown(loop: FastLoop, copter: Any, *places: TrackWaypoint, **options: Any) -> list[Any]:
    job: Any = SimpleNamespace(stage={})
    loop.run(TrackFlight(copter, places, **options).fly(job))
    assert copter.did[-1] == "rtl"
    steps: list[Any] = copter.did[:-1]
    return steps


def test_a_track_that_begins_here_is_flown_from_its_first_height_on(loop: FastLoop) -> None:
    steps = flown(loop, Copter(), place(2, 2), place(30, 8))
    assert steps == ["arm", ("takeoff", 2), (2, 2), (30, 8)]


def test_track_that_begins_elsewhere_is_reached_above_the_trees(loop: FastLoop) -> None:
    steps = flown(loop, Copter(), place(3000, 2), place(3030, 50))
    assert steps == ["arm", ("takeoff", 10), (3000, 10), (3000, 2), (3030, 50)]
    assert flown(loop, Copter(), place(3000, 2), transit=40)[1:] == [("takeoff", 40), (3000, 40), (3000, 2)]
    assert flown(loop, Copter(), place(3000, 60))[1:] == [("takeoff", 60), (3000, 60), (3000, 60)]


def test_in_the_air_it_climbs_before_it_goes_there_and_never_descends(loop: FastLoop) -> None:
    assert flown(loop, Copter(3), place(3000, 2)) == [(0, 10), (3000, 10), (3000, 2)]
    assert flown(loop, Copter(80), place(3000, 2)) == [(3000, 80), (3000, 2)]


def test_no_takeoff_is_higher_than_the_verb_allows(loop: FastLoop) -> None:
    steps = flown(loop, Copter(), place(3000, 900))
    assert steps == ["arm", ("takeoff", 500), (0, 900), (3000, 900), (3000, 900)]
    assert flown(loop, Copter(), place(0, 900))[1:] == [("takeoff", 500), (0, 900)]


@pytest.mark.parametrize("reach", [999.0, float("nan")])
def test_what_is_not_within_reach_is_refused(host: Host, telemetry: TelemetrySource, reach: float) -> None:
    copter = host.registry.find(10)
    assert flight_of(copter, [place(1000, 5)], 1001.0)
    with pytest.raises(Invalid, match="waypoint 1 of the track is 1000 m away"):
        flight_of(copter, [place(1000, 5)], reach)


def test_a_vehicle_that_is_no_copter_does_not_fly_tracks(host: Host, telemetry: TelemetrySource) -> None:
    telemetry.send("heartbeat", type=1)
    with pytest.raises(NotSupported):
        flight_of(host.registry.find(10), [place(0, 5)], 1000.0)
