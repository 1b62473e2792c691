"""What MAVProxy itself knows, handed over to the asyncio side. Everything here runs in MAVProxy's main loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from mavproxy_uavapi.core.airspace.store import Envelopes
from mavproxy_uavapi.core.mainloop.bridge import Bridge
from mavproxy_uavapi.core.mainloop.link_keeper import LinkKeeper
from mavproxy_uavapi.core.mainloop.link_loads import LinkLoads
from mavproxy_uavapi.core.mission.mission_watch import LoadedMissions, MissionWatch
from mavproxy_uavapi.core.telemetry.fence_watch import FenceWatch
from mavproxy_uavapi.core.telemetry.parameter_watch import ParameterWatch
from mavproxy_uavapi.core.telemetry.vehicle_states import VehicleStates
from mavproxy_uavapi.core.vehicle.registry import VehicleRegistry

LOOK_EVERY = 0.2  # s between two looks at what MAVProxy knows and which of its links are up


class MavproxyWatch:
    """Looks at MAVProxy's settings, links, parameters, fences and missions.

    Args:
        mpstate: MAVProxy's state.
        bridge: the way to the asyncio side.
        registry, fleet, envelopes, missions: what is told.
        take_fences: takes fences as envelopes; the items by system id.
    """

    def __init__(
        self,
        mpstate: Any,
        bridge: Bridge,
        *,
        registry: VehicleRegistry,
        fleet: VehicleStates,
        envelopes: Envelopes,
        missions: MissionWatch,
        take_fences: Callable[[dict[int, list[Any]]], None],
    ) -> None:
        self._mpstate, self._bridge = mpstate, bridge
        self._registry, self._fleet, self._envelopes, self._missions = registry, fleet, envelopes, missions
        self._take_fences = take_fences
        self._announced_target = 0
        self._next_look = -math.inf
        self._link_keeper = LinkKeeper(registry.clock)
        self._link_loads = LinkLoads()
        self._parameters = ParameterWatch()
        self._fences = FenceWatch()
        self._loaded = LoadedMissions()

    def is_due(self) -> bool:
        """Whether the next look is due."""
        return self._registry.clock() >= self._next_look

    def look(self) -> None:
        """Hand over what has changed since the last look."""
        self._next_look = self._registry.clock() + LOOK_EVERY
        self._link_keeper.turn(self._mpstate.mav_master)
        for share in (
            self._share_streamrate,
            self._share_load,
            self._share_parameters,
            self._share_fences,
            self._share_missions,
        ):
            share()

    def release(self) -> None:
        """Give MAVProxy's links back."""
        self._link_keeper.release()

    def note_fence(self, system: int, fence: list[Any]) -> None:
        """Take a fence that we have put into a vehicle for MAVProxy's, until MAVProxy loads another one."""
        self._fences.note(system, fence)

    def share_target(self) -> None:
        """Hand over which vehicle MAVProxy's own commands go to."""
        target = self._mpstate.settings.target_system
        if target != self._announced_target:
            self._announced_target = target
            self._set("current", target)

    def _set(self, attribute: str, value: Any) -> None:
        self._bridge.call_soon(setattr, self._registry, attribute, value)

    def _share_streamrate(self) -> None:
        """Hand over whether MAVProxy requests streams; `streamrate2` is for its second link and further ones."""
        settings = self._mpstate.settings
        are_off = min(settings.streamrate, settings.streamrate2) <= 0
        if are_off != self._registry.streams_are_off:
            self._set("streams_are_off", are_off)

    def _share_load(self) -> None:
        """Hand over whether a serial link is full, by the bytes that went over it since the last look."""
        is_full = self._link_loads.any_is_full(self._mpstate.mav_master, self._registry.clock())
        if is_full != self._registry.link_is_full:
            self._set("link_is_full", is_full)

    def _share_parameters(self) -> None:
        """Hand over the parameters that MAVProxy has learnt, in order with the messages: a later PARAM_VALUE wins.

        With `--continue` MAVProxy's tables hold a file of an earlier session, not the vehicle's own values.
        """
        if self._mpstate.continue_mode:
            return
        changes = self._parameters.changes(self._mpstate.mav_param_by_sysid)
        if changes:
            self._bridge.feed_call(lambda: self._fleet.learn(changes))

    def _share_fences(self) -> None:
        """Hand over the fences that MAVProxy has loaded, where they are the vehicles' envelopes."""
        if not self._envelopes.expects_fences:
            self._fences.forget()
            return
        changes = self._fences.changes(self._mpstate.public_modules)
        if changes:
            self._bridge.feed_call(lambda: self._take_fences(changes))

    def _share_missions(self) -> None:
        """Hand over the missions that MAVProxy has loaded or sent."""
        for system, items in self._loaded.changes(self._mpstate.public_modules):
            self._bridge.feed_call(partial(self._missions.put, system, items))
