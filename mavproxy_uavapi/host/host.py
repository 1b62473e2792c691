"""One host per MAVProxy: whichever of our modules loads first makes it, the last to unload ends it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable
from typing import Any

from mavproxy_uavapi.errors import LinkLost
from mavproxy_uavapi.host.bridge import Bridge
from mavproxy_uavapi.host.link import MavproxyLink
from mavproxy_uavapi.host.parameters import ParameterWatch
from mavproxy_uavapi.host.pending import Pending
from mavproxy_uavapi.host.state import Fleet, VehicleState
from mavproxy_uavapi.vehicle.endings import FlightEndings
from mavproxy_uavapi.vehicle.hangar import Hangar
from mavproxy_uavapi.vehicle.jobs import JobBook

log = logging.getLogger("uavapi.copter")

ATTRIBUTE = "uavapi_host"  # on MAVProxy's state, so that a module loaded anew finds it


class Host:
    """The shared half of our modules: bridge, link, fleet, waits, the vehicles and the jobs that fly them.

    Everything but `bridge` belongs to the asyncio thread.

    Attributes:
        listeners: called with each vehicle message, after the state has taken it and the waits have seen it.
        api_address: where `uavapi` listens; None while it does not.
        extensions: HTTP routes of the other modules, by path; `uavapi` serves them while it is loaded.
        commands: words after `uavapi` at the prompt that other modules serve.
        last_words: called before the host ends: the messages to be sent then, and the systems that they go to.
        newest_frame: gives the newest camera frame as JPEG; None while no module has a camera.

    Args:
        mpstate: MAVProxy's state.
        clock: monotonic seconds.
    """

    def __init__(self, mpstate: Any, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock = clock
        self.fleet = Fleet()
        self.pending = Pending()
        self.bridge = Bridge(mpstate.select_extra, self._receive)
        self.link = MavproxyLink(self.bridge, mpstate)
        self.link_timeout = 5.0
        self.target = 0  # the system id that MAVProxy's own commands go to; 0 before it knows one
        self.hangar = Hangar(self)
        self.jobs = JobBook()
        self.endings = FlightEndings(self.jobs)
        self.listeners: list[Callable[[VehicleState, Any, float], None]] = []
        self.extensions: dict[str, Any] = {}
        self.commands: dict[str, Callable[[list[str]], None]] = {}
        self.newest_frame: Callable[[], Awaitable[bytes]] | None = None
        self.api_address: tuple[str, int] | None = None
        self.members: list[Any] = []
        self.last_words: list[Callable[[], list[tuple[Any, int]]]] = [self.endings.last_words]
        self._mpstate = mpstate
        self._told_target = 0
        self._parameters = ParameterWatch()
        self._lost: set[int] = set()
        self._link_timers: dict[int, asyncio.TimerHandle] = {}

    # -- MAVProxy's main loop ---------------------------------------------------------------------------

    def feed(self, member: Any, message: Any) -> None:
        """Hand a message over; of several loaded modules only the first one's counts."""
        if self.members[:1] == [member]:
            self.bridge.feed(message)

    def idle(self, member: Any) -> None:
        """MAVProxy's idle task: start at the first one, then send what is to be sent."""
        if self.members[:1] != [member]:
            return
        if not self.bridge.running:
            self.bridge.start()
        target = self._mpstate.settings.target_system
        if target != self._told_target:
            self._told_target = target
            self.bridge.call_soon(setattr, self, "target", target)
        self._tell_parameters()
        self.bridge.turn()

    def end(self) -> None:
        """Say the last words, and end the asyncio thread.

        MAVProxy's main loop waits for us, or has ended: nobody else sends. So this thread does, here only.
        """

        async def said() -> list[tuple[Any, int]]:
            return [word for words in self.last_words for word in words()]

        if self.bridge.running:
            for message, system in self.bridge.run(said()):
                with contextlib.suppress(LinkLost):  # nobody hears us anyhow
                    self.link.write(message, system)
        self.bridge.stop()

    def _tell_parameters(self) -> None:
        """Hand over what MAVProxy has learnt of parameters, in order with the messages: a later PARAM_VALUE wins.

        With `--continue` MAVProxy's tables hold a file of an earlier session: those are not the vehicle's word.
        """
        if self._mpstate.continue_mode:
            return
        changes = self._parameters.changes(self._mpstate.mav_param_by_sysid, self.clock())
        if changes:
            self.bridge.feed_call(lambda: self.fleet.learn(changes))

    # -- the asyncio thread -----------------------------------------------------------------------------

    def is_alive(self, state: VehicleState) -> bool:
        """Whether a heartbeat came within the link timeout."""
        return self.clock() - state.heartbeat_at < self.link_timeout

    def _receive(self, message: Any) -> None:
        now = self.clock()
        state = self.fleet.update(message, now)
        if state is None:
            return
        self.pending.feed(state.system, message.get_type(), message)
        if state.system not in self._link_timers:
            self._watch_link(state)
        for listener in list(self.listeners):
            listener(state, message, now)

    def _watch_link(self, state: VehicleState) -> None:
        """End the waits on a vehicle when its heartbeats have been missing for the link timeout."""
        silent_for = self.clock() - state.heartbeat_at
        lost = silent_for >= self.link_timeout
        if lost != (state.system in self._lost):
            self._lost ^= {state.system}
            log.warning("vehicle %d: %s", state.system, "link lost" if lost else "link is back")
        if lost:
            self.pending.fail(state.system, lambda: LinkLost.since(state.system, silent_for))
            delay = self.link_timeout / 5
        else:
            delay = self.link_timeout - silent_for
        timer = self.bridge.loop.call_later(max(delay, 0.05), self._watch_link, state)
        self._link_timers[state.system] = timer


def join(mpstate: Any, member: Any) -> Host:
    """The host of this MAVProxy, made if need be; `member` is the module that uses it."""
    host = getattr(mpstate, ATTRIBUTE, None)
    if host is None:
        host = Host(mpstate)
        setattr(mpstate, ATTRIBUTE, host)
    host.members.append(member)
    return host


def leave(mpstate: Any, member: Any) -> None:
    """Give the host back; the last one ends it."""
    host: Host = getattr(mpstate, ATTRIBUTE)
    host.members.remove(member)
    if not host.members:
        delattr(mpstate, ATTRIBUTE)
        host.end()
