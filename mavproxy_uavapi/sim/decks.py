"""Vehicles to stand on: what has landed on a rover is carried along, as its SIM_STATE tells. Pure.

A deck is as high as the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.core.geodesy import from_deg_e7

from .geodesy import Location, rotate_to_ne, to_ned, wrap_pi
from .link import COMPONENT
from .physics import Body

RADIUS = 1.0
"""Metres from a rover's middle within which one stands on it."""
FRESH = 1.0
"""Seconds without a rover's SIM_STATE after which it is asked for, and carries nobody."""
INTERVAL = 20_000
"""Microseconds from one SIM_STATE to the next."""


@dataclass(frozen=True)
class Deck:
    """At `at` (s of the rider's clock): metres from the rider's start, m/s, radians, radians/s."""

    at: float
    north: float
    east: float
    velocity_north: float
    velocity_east: float
    yaw: float
    turn_rate: float

    def carried_on(self, now: float) -> Deck:
        """The same deck at the time now, by its velocity."""
        since = now - self.at
        north, east = self.north + since * self.velocity_north, self.east + since * self.velocity_east
        yaw = self.yaw + since * self.turn_rate
        return Deck(now, north, east, self.velocity_north, self.velocity_east, yaw, self.turn_rate)


class PlaceOnDeck(NamedTuple):
    """Where one stands on the deck of a system: metres ahead and right of its middle, radians to its right."""

    system: int
    ahead: float
    right: float
    yaw: float


class Decks:
    """The rovers that one vehicle hears, and its place on one of them."""

    def __init__(self, start: Location) -> None:
        self._start = start
        self._decks: dict[int, Deck] = {}
        self._place: PlaceOnDeck | None = None
        self._flies = False

    def hear(self, message: Any, now: float) -> Any | None:
        """Take a message of another vehicle; what is to be answered to a rover that tells too little, or None."""
        system = message.get_srcSystem()
        if message.get_type() == "SIM_STATE":
            place = Location(from_deg_e7(message.lat_int), from_deg_e7(message.lon_int), message.alt)
            north, east, _ = to_ned(self._start, place)
            self._decks[system] = Deck(now, north, east, message.vn, message.ve, message.yaw, message.zgyro)
            return None
        is_rover = message.get_type() == "HEARTBEAT" and message.type == mavlink.MAV_TYPE_GROUND_ROVER
        if not is_rover or self._fresh(system, now) is not None:
            return None
        parameters = mavlink.MAVLINK_MSG_ID_SIM_STATE, INTERVAL, 0, 0, 0, 0, 0
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return mavlink.MAVLink_command_long_message(system, COMPONENT, command, 0, *parameters)

    def _fresh(self, system: int, now: float) -> Deck | None:
        deck = self._decks.get(system)
        return deck if deck is not None and now - deck.at < FRESH else None

    def carry(self, body: Body, now: float) -> None:
        """Take along a body that came down on a deck, until it flies."""
        if not body.on_ground:
            self._flies, self._place = True, None
            return
        if self._flies:
            self._flies, self._place = False, self._touched(body, now)
        deck = None if self._place is None else self._fresh(self._place.system, now)
        if self._place is None or deck is None:
            return
        deck = deck.carried_on(now)
        north, east = rotate_to_ne(self._place.ahead, self._place.right, deck.yaw)
        body.north, body.east = deck.north + north, deck.east + east
        body.velocity_north = deck.velocity_north - deck.turn_rate * east
        body.velocity_east = deck.velocity_east + deck.turn_rate * north
        body.yaw, body.yaw_rate = wrap_pi(self._place.yaw + deck.yaw), deck.turn_rate

    def _touched(self, body: Body, now: float) -> PlaceOnDeck | None:
        """Its place on the first deck that is below it."""
        for system in self._decks:
            deck = self._fresh(system, now)
            if deck is None:
                continue
            deck = deck.carried_on(now)
            north, east = body.north - deck.north, body.east - deck.east
            if math.hypot(north, east) <= RADIUS:
                ahead, right = rotate_to_ne(north, east, -deck.yaw)
                return PlaceOnDeck(system, ahead, right, body.yaw - deck.yaw)
        return None
