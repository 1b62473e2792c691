"""The link of a virtual world, and MAVProxy's main loop at its end: slow, lossy, standing, as a test wishes.

What is sent goes through the bridge, as MAVProxy's own link does, and what a vehicle says is read in turns.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable
from typing import Any

from mavproxy_uavapi.core.errors import LinkLost
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.link.link import require_finite
from mavproxy_uavapi.core.sent_messages import note_sent
from mavproxy_uavapi.rehearsal.virtual_link import VirtualLink
from mavproxy_uavapi.sim.simulator import Simulator
from tests.support.flights import Flight, Sent, the_job
from tests.support.virtual_time import FastLoop

# A third of all messages: the host keeps them for clients that ask for one by its name.
READ_BY_NOBODY = {"RAW_IMU", "SCALED_PRESSURE", "POWER_STATUS", "MEMINFO", "SERVO_OUTPUT_RAW", "SIMSTATE", "AHRS"}
READ_BY_NOBODY |= {"VIBRATION"}


def every(count: int) -> Callable[[], bool]:
    """Loses one of so many messages, both ways together."""
    passed = 0

    def loses() -> bool:
        nonlocal passed
        passed += 1
        return passed % count == 0

    return loses


def by_chance(share: float, seed: int = 1) -> Callable[[], bool]:
    """Loses a share of the messages, either way."""
    chance = random.Random(seed)
    return lambda: chance.random() < share


def nothing() -> bool:
    """Loses no message."""
    return False


class FaultyLink(VirtualLink):
    """See the file's first lines.

    Attributes:
        sent: what the host sent, oldest first; MAVProxy's own requests are not in it.
        on_send: called with each message but questions, as it goes out.
        uplink_until, downlink_until: s; until then nothing reaches the vehicle, or nothing comes from it.
        stands_until: s; until then MAVProxy's main loop stands: it reads and writes nothing.
        burst: s from one reading of MAVProxy's to the next, though it turns: a machine that is too busy.
        at_once: how many messages it reads in a turn, as one datagram after the other.
        way, jitter: s that each message takes either way, and at most so many more by chance: some are overtaken.
        held_up: s that what is sent takes besides, so that what is sent later may overtake it.
        loses: whether the next message is lost, either way.
        to_lose: how many messages of a name are lost, of what the vehicle says.
        nan: names of messages whose numbers are none.
        reaches, hears: whether a message reaches the vehicle, and whether one of it reaches the host.
    """

    def __init__(self, loop: FastLoop) -> None:
        super().__init__(())
        self.loop = loop
        self.host: Host
        self.flights: dict[str, Flight] = {}
        self.sent: list[Sent] = []
        self.on_send: list[Callable[[Sent], None]] = []
        self.uplink_until = self.downlink_until = self.stands_until = -math.inf
        self.burst, self.at_once = 0.0, 10_000
        self.way = self.jitter = self.held_up = 0.0
        self.loses: Callable[[], bool] = nothing
        self.to_lose = Counter[str]()
        self.nan: set[str] = set()
        self.reaches: Callable[[Any], bool] = lambda _message: True
        self.hears: Callable[[Any], bool] = lambda _message: True
        self._unread: list[Any] = []
        self._woken = False
        self._read_at = -math.inf
        self._chance = random.Random(1)

    def join(self, simulator: Simulator) -> None:
        """Put a vehicle on the link, whose streams have what the host reads."""
        super().join(simulator)
        _, cable = self._cables[-1]
        cable._groups = {
            group: tuple(name for name in names if name not in READ_BY_NOBODY)
            for group, names in cable._groups.items()
        }
        cable.restart()

    # -- what happens to it ---------------------------------------------------------------------------------------

    def delay(self, seconds: float, jitter: float = 0.0, seed: int = 1) -> None:
        """Each message takes so many s, and up to `jitter` s more by chance."""
        self.way, self.jitter, self._chance = seconds, jitter, random.Random(seed)

    def cut(self, until: float) -> None:
        """Nothing goes either way until then (s)."""
        self.uplink_until = self.downlink_until = until

    def stand(self, whether: bool) -> None:
        """Let MAVProxy's main loop stand still, or go on; what the vehicle says meanwhile waits on the link."""
        self.stands_until = math.inf if whether else -math.inf

    def link_is_well(self) -> None:
        """End all that happens to it."""
        self.uplink_until = self.downlink_until = -math.inf
        self.stands_until = min(self.stands_until, self.loop.time())
        self.way = self.jitter = self.held_up = 0.0
        self.loses, self.nan = nothing, set()
        self.to_lose.clear()

    # -- to the vehicle -------------------------------------------------------------------------------------------

    async def send(self, message: Any, system: int) -> None:
        """See `core.link.link.Link.send`."""
        require_finite(message)
        if system not in self.systems:
            raise LinkLost(f"there is no vehicle {system}")
        job = the_job.get()
        self.wake()
        await self.host.bridge.on_main(lambda: self._write(message, system, job and self.flights.get(job.id)))

    @property
    def systems(self) -> set[int]:
        """The system ids of the vehicles on it."""
        return {simulator.options.sysid for simulator in self.simulators}

    def _write(self, message: Any, system: int, flight: Flight | None) -> None:
        note_sent(message.get_type())
        state = self.host.fleet.vehicles.get(system)
        mode = "UNKNOWN" if state is None else self.host.registry.find(system).mode
        wired = self.wired(message)
        sent = Sent(self.loop.time(), wired, flight, mode, None if state is None else state.armed)
        self.sent.append(sent)
        if not sent.asks:
            for look in self.on_send:
                look(sent)
            if flight is not None:
                flight.sent.append(sent)
        if not self.loses() and self.reaches(wired):
            self._after(self.held_up, self.arrive, message)

    def arrive(self, message: Any) -> None:
        """Let a message be at the vehicle with its next step."""
        self.arriving.append(message)

    def deliver(self, message: Any) -> None:
        """Let a message arrive, unless nothing does now."""
        if self.loop.time() >= self.uplink_until:
            super().deliver(message)

    def _after(self, more: float, arrive: Callable[[Any], object], message: Any) -> None:
        late = self.way + more
        if late:
            self.loop.call_later(late + self._chance.uniform(0.0, self.jitter), arrive, message)
        else:
            arrive(message)

    # -- from the vehicle -----------------------------------------------------------------------------------------

    def hear(self, message: Any) -> None:
        """What a vehicle says."""
        name = message.get_type()
        if self.loop.time() < self.downlink_until or self.loses():
            return
        if self.to_lose[name] > 0:
            self.to_lose[name] -= 1
            return
        for field in ("x", "y", "z", "yaw", "vx") if name in self.nan else ():
            if isinstance(getattr(message, field, None), float):
                setattr(message, field, math.nan)
        if self.hears(message):
            self._after(0.0, self.come, message)

    def come(self, message: Any) -> None:
        """Let a message be on the link, to be read by MAVProxy."""
        self._unread.append(message)
        self.wake()

    def wake(self) -> None:
        """Have MAVProxy's main loop turn: what comes in one moment is read in one turn."""
        if not self._woken:
            self._woken = True
            self.loop.call_soon(self._turn_if_woken)

    def _turn_if_woken(self) -> None:
        if self._woken:
            self.turn()

    def turn(self) -> None:
        """A turn of MAVProxy's main loop, unless it stands: the idle tasks, and then all that can be read."""
        self._woken = False
        now, bridge = self.loop.time(), self.host.bridge
        if now < self.stands_until:
            return
        bridge.turn()
        if not self._unread or now - self._read_at < self.burst:
            return
        self._read_at = now
        unread, self._unread[:] = self._unread[: self.at_once], self._unread[self.at_once :]
        for message in unread:
            bridge.feed(message)
        bridge.turn()
