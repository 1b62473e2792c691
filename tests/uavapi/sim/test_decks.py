"""A copter on a rover: what each tells the other is MAVLink."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.sim.decks import FRESH, RADIUS
from mavproxy_uavapi.sim.options import Home, Options
from mavproxy_uavapi.sim.simulator import Simulator

STEP = 0.02
SPEED, TURN = 2.0, 0.5


class Pair:
    """A copter in the air, and a rover whose driver is the test."""

    def __init__(self) -> None:
        self.copter = Simulator(Options(ready_after=0.1, step=STEP))
        home = Home(longitude=self.copter.options.home.longitude + 5e-5)
        self.rover = Simulator(Options(vehicle="rover", sysid=2, home=home, ready_after=0.1, step=STEP))
        self.link = self.rover.open_link("the copter")
        self.decoder, self.encoder = mavlink.MAVLink(None), mavlink.MAVLink(None, srcSystem=1)
        self.deaf = False
        self.start = self.copter.vehicle.estimator.start
        self.run(2.0)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP)):
            self.rover.step()
            for message in self.decoder.parse_buffer(self.link.drain()) or []:
                if not self.deaf:
                    self._hear(message)
            self.copter.step()

    def _hear(self, message: object) -> None:
        answer = self.copter.decks.hear(message, self.copter.vehicle.now)
        if answer is not None:
            self.rover.receive(self.link, self.decoder.parse_buffer(answer.pack(self.encoder))[0])

    def drive(self, speed: float, turn: float) -> None:
        """On a circle, from now on."""
        body = self.rover.vehicle.body

        def go(*_: object) -> None:
            body.velocity_north, body.velocity_east = speed * math.cos(body.yaw), speed * math.sin(body.yaw)
            body.north, body.east = body.north + body.velocity_north * STEP, body.east + body.velocity_east * STEP
            body.yaw, body.yaw_rate = body.yaw + turn * STEP, turn

        self.rover.vehicle.move = go

    def drop(self, ahead: float) -> None:
        """The copter falls onto the deck, so many metres ahead of its middle."""
        body, rover = self.copter.copter.body, self.rover.vehicle.body
        body.north = rover.north + ahead * math.cos(rover.yaw)
        body.east = rover.east + self.apart + ahead * math.sin(rover.yaw)
        body.down, body.velocity_down = -0.1, 0.5
        self.run(1.0)
        assert body.on_ground

    @property
    def apart(self) -> float:
        """Metres from the copter's start to the rover's."""
        scale = math.cos(math.radians(self.start.latitude)) * 111318.845
        return (self.rover.options.home.longitude - self.start.longitude) * scale

    @property
    def place(self) -> tuple[float, float, float]:
        """Of the copter: metres ahead and right of the rover's middle, radians to its right."""
        body, rover = self.copter.copter.body, self.rover.vehicle.body
        north, east = body.north - rover.north, body.east - rover.east - self.apart
        ahead, right = (
            north * math.cos(rover.yaw) + east * math.sin(rover.yaw),
            east * math.cos(rover.yaw) - north * math.sin(rover.yaw),
        )
        return ahead, right, math.remainder(body.yaw - rover.yaw, math.tau)


def test_what_has_landed_on_a_rover_is_carried_and_turned_along():
    pair = Pair()
    pair.drive(SPEED, TURN)
    pair.drop(0.4)
    before = pair.place
    pair.run(5.0)
    assert pair.place == pytest.approx(before, abs=0.05)
    velocity = pair.copter.vehicle.estimator.velocity
    assert math.hypot(velocity.north, velocity.east) == pytest.approx(SPEED, abs=0.3)


@pytest.mark.parametrize("ahead", [-2 * RADIUS, 2 * RADIUS])
def test_what_lands_beside_a_rover_stays(ahead):
    pair = Pair()
    pair.drop(ahead)
    before = pair.copter.copter.body.position
    pair.drive(SPEED, 0.0)
    pair.run(3.0)
    assert pair.copter.copter.body.position == before


def test_a_rover_that_drives_under_a_standing_copter_does_not_lift_it():
    pair = Pair()
    before = pair.copter.copter.body.position
    pair.rover.vehicle.body.east -= pair.apart
    pair.drive(SPEED, 0.0)
    pair.run(3.0)
    assert pair.copter.copter.body.position == before


def test_a_rover_that_is_not_heard_carries_nobody_until_it_is_heard_again():
    pair = Pair()
    pair.drop(0.4)
    before = pair.place
    pair.drive(SPEED, 0.0)
    pair.deaf = True
    pair.run(FRESH + 1.0)
    stands = pair.copter.copter.body.position
    pair.run(1.0)
    assert pair.copter.copter.body.position == stands
    assert pair.copter.vehicle.estimator.velocity == (0.0, 0.0, 0.0)
    pair.deaf = False
    pair.run(3.0)
    assert pair.place == pytest.approx(before, abs=0.05)
