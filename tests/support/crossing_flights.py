"""Several copters in one MAVProxy that fly across each other's ways at random, and how near they come."""

from __future__ import annotations

import asyncio
import itertools
import math
import random
from collections import Counter
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mavproxy_uavapi.api import apply
from mavproxy_uavapi.core.control.jobs import Job
from mavproxy_uavapi.sim import Options, Simulator
from mavproxy_uavapi.sim.options import Home
from tests.support.climbing import until_it_hovers
from tests.support.envelopes import place
from tests.support.virtual_time import FastLoop
from tests.support.world import MODES, PARAMETERS, TICK, World

APART = 15.0  # m between the places where they start
PAUSES = (0.0, 0.2, 1.0, 4.0)  # s


class Fleet:
    """Copters that hover side by side, or planes that circle, with the API over them.

    Attributes:
        nearest: m, the least true distance of two of them so far.
        breaches: number of times that two came nearer than `separation` to each other.
        outcomes: number of answers, by code.
        stops: number of flights that were stopped in flight.
    """

    def __init__(
        self,
        loop: FastLoop,
        count: int,
        settings: dict[str, Any],
        separation: float,
        vehicle: str = "copter",
        apart: float = APART,
    ) -> None:
        self.loop, self.separation = loop, separation
        settings = {"max_rate": 100000.0, "max_jobs": 10000, **settings}
        self.world = world = World(settings, vehicle, loop)
        self.starts = {system: (0.0, apart * (system - 1)) for system in range(1, count + 1)}
        for system in range(2, count + 1):
            home = Home(*place(*self.starts[system]))
            simulator = Simulator(
                Options(sysid=system, vehicle=vehicle, home=home, seed=system, ready_after=1.0, step=TICK)
            )
            for name, value in PARAMETERS.items():
                simulator.parameters.set(name, value)
            world.join(simulator)
        for simulator in world.simulators:
            (hover if vehicle == "copter" else circle)(simulator)
        apply(world.service.settings, world.host)
        world.go_live()
        self.nearest, self.breaches, self.stops = math.inf, 0, 0
        self.outcomes: Counter[str] = Counter()
        self._near: set[tuple[int, int]] = set()
        world.host.jobs.on_ended.append(self._ended)
        self._tasks = [loop.create_task(self._look())]

    def _ended(self, job: Job) -> None:
        self.stops += job.client == "envelope"

    def at(self, simulator: Simulator) -> tuple[float, float, float]:
        """Where one truly is, m north and east of the first one's home, and m up."""
        north, east = self.starts[simulator.options.sysid]
        n, e, d = simulator.vehicle.body.position
        return north + n, east + e, -d

    async def _look(self) -> None:
        while True:
            for a, b in itertools.combinations(self.world.simulators, 2):
                pair, gap = (a.options.sysid, b.options.sysid), math.dist(self.at(a), self.at(b))
                self.nearest = min(self.nearest, gap)
                if gap >= self.separation:
                    self._near.discard(pair)
                elif pair not in self._near:
                    self._near.add(pair)
                    self.breaches += 1
            await asyncio.sleep(TICK)

    def ask(self, system: int, verb: str, body: dict[str, Any] | None = None) -> Any:
        """A command to one of them, and its answer."""
        return self.world.ask("POST", f"/vehicles/{system}/{verb}", body)

    def begin(self, system: int, verb: str, body: dict[str, Any] | None = None) -> Any:
        """A command to one of them, whose answer is waited for later (`world.answer`)."""
        return self.world.begin("POST", f"/vehicles/{system}/{verb}", body)

    def by_hand(self, system: int, message: Any) -> None:
        """A message of another ground station."""
        self.world.arriving.append(message)
        self.loop.pass_time(0.1)

    def fly_at_random(self, half: float, seed: int) -> None:
        """Begin flights of all of them to and fro in a square; they go on until `close`."""
        for system in self.starts:
            dice = random.Random(1000 * seed + system)
            self._tasks.append(self.loop.create_task(self._fly(system, half, dice)))

    async def _fly(self, system: int, half: float, dice: random.Random) -> None:
        while True:
            await asyncio.sleep(dice.choice(PAUSES))
            if dice.random() < 0.8:
                north, east = dice.uniform(-half, half), dice.uniform(-half, half)
                lat, lon = place(north, east)
                verb, body = "go_to_gps_wait", {"lat": lat, "long": lon, "alt": dice.uniform(8, 16)}
            else:
                speed = dice.uniform(-5, 5), dice.uniform(-5, 5), 0.0
                verb, body = "travel_at_ned", dict(zip(("vx", "vy", "vz"), speed, strict=True))
                body["duration"] = dice.uniform(1, 5)
            wire = await self.world.request("POST", f"/vehicles/{system}/movement/{verb}", body)
            reply = await wire.reply
            self.outcomes["none" if reply is None else reply.outcome] += 1
            if reply is not None and reply.outcome in ("409 mode_changed", "409 too_near"):  # it may be in BRAKE
                await (await self.world.request("POST", f"/vehicles/{system}/command/guided")).reply

    def close(self) -> None:
        """End it."""
        for task in self._tasks:
            task.cancel()
        self.world.close()


def hover(simulator: Simulator, height: float = 10.0) -> None:
    """Have a copter take off, without anybody's command."""
    simulator.run(2.0)
    by_pilot(
        simulator,
        (mavlink.MAV_CMD_DO_SET_MODE, 1, MODES["GUIDED"]),
        (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1),
        (mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height),
    )
    until_it_hovers(simulator, height)


def circle(simulator: Simulator) -> None:
    """Have a plane take off and circle in GUIDED, 50 m high, without anybody's command."""
    simulator.run(2.0)
    takeoff, guided = 13, 15
    by_pilot(simulator, (mavlink.MAV_CMD_DO_SET_MODE, 1, takeoff), (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1))
    simulator.run(15.0)
    by_pilot(simulator, (mavlink.MAV_CMD_DO_SET_MODE, 1, guided))


def by_pilot(simulator: Simulator, *commands: tuple[float, ...]) -> None:
    """Commands of a pilot, each with its parameters."""
    system, cable = simulator.options.sysid, simulator.open_link("pilot")
    for command, *parameters in commands:
        rest = (0,) * (7 - len(parameters))
        simulator.receive(cable, mavlink.MAVLink_command_long_message(system, 1, command, 0, *parameters, *rest))
        simulator.step()
    simulator.close_link(cable)
