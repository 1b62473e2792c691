"""The flight modes that we request from one vehicle, and what its heartbeats say of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from mavproxy_uavapi.core.errors import ModeChanged
from mavproxy_uavapi.core.mainloop.permit import Written
from mavproxy_uavapi.core.telemetry.flight_modes import mode_name
from mavproxy_uavapi.core.telemetry.vehicle_state import HEARTBEAT_PERIOD, VehicleState

ANSWERED_WITHIN = 5.0  # s in which a heartbeat shows what came of a request; more on a slow link
SHOWN_AFTER = 2.0  # s after which any heartbeat shows it, likewise


class Overtaken(NamedTuple):
    """An order that a newer one may have overtaken: its MAV_CMD, when it was sent, until when it may arrive (s).

    `is_shown`: whether the vehicle is as the order makes it.
    """

    order: int
    sent_at: float
    until: float
    is_shown: Callable[[], bool]


class ModeRequest(NamedTuple):
    """A requested mode: when (s), by which MAV_CMD, and whether that has been written."""

    at: float
    order: int
    written: Written


class ModeRequests:
    """When each flight mode was requested.

    Args:
        state: the vehicle's state.
        clock: monotonic seconds, the clock of arrivals.
    """

    def __init__(self, state: VehicleState, clock: Callable[[], float]) -> None:
        self._state = state
        self._clock = clock
        self._noted: dict[int, ModeRequest] = {}  # by the mode's number; the newest last
        self._chosen_since = math.nan  # s; `mode_since` of a mode of ours, also when it is requested again in vain

    def note(self, mode: int, order: int, written: Written) -> None:
        """Note that this mode is requested now, by that MAV_CMD; it counts if that is written."""
        if self.chose_the_mode:
            self._chosen_since = self._state.mode_since
        self._noted.pop(mode, None)
        self._noted[mode] = ModeRequest(self._clock(), order, written)

    def forget(self, mode: int) -> None:
        """Forget a request that the autopilot refused."""
        self._noted.pop(mode, None)

    @property
    def _requested(self) -> dict[int, ModeRequest]:
        return {mode: request for mode, request in self._noted.items() if request.written.value is not False}

    @property
    def chose_the_mode(self) -> bool:
        """Whether the vehicle came into its mode by our request, which no switch to that mode had answered before."""
        mode, since = self._state.mode, self._state.mode_since
        if mode is None:
            return False
        if self._chosen_since == since:
            return True
        request = self._requested.get(mode)
        if request is None or not request.at <= since <= request.at + self._answered_within:
            return False
        return not any(shown == mode and request.at <= at < since for at, shown in self._state.mode_changes)

    def on_their_way(self) -> list[int]:
        """The recently requested modes of which no heartbeat has shown what came of them, the newest last."""
        now, shown_after = self._clock(), max(SHOWN_AFTER, self._state.trip.deadline + HEARTBEAT_PERIOD)
        recent = self._requested.items()
        requests = [(mode, request.at) for mode, request in recent if now - request.at <= self._answered_within]
        for changed_at, mode in self._state.mode_changes:
            answered = [at for requested, at in requests if requested == mode and at <= changed_at]
            if answered:
                requests = [(requested, at) for requested, at in requests if at > answered[-1]]
            else:  # a switch by the pilot or a failsafe: our earlier requests are void
                requests = [(requested, at) for requested, at in requests if at >= changed_at]
        return [mode for mode, at in requests if self._state.heartbeat_at <= at + shown_after]

    def overtaken(self, since: float) -> list[Overtaken]:
        """What was requested before `since` (s) and not shown: what was sent then may overtake it."""
        changes = self._state.mode_changes
        return [
            Overtaken(order, at, at + self._answered_within, partial(self._is_in, mode))
            for mode, (at, order, _) in self._requested.items()
            if at < since and not any(mode == shown and changed_at >= at for changed_at, shown in changes)
        ]

    def _is_in(self, mode: int) -> bool:
        return self._state.mode == mode

    @property
    def _answered_within(self) -> float:
        return max(ANSWERED_WITHIN, self._state.trip.deadline + 2 * HEARTBEAT_PERIOD)


class ModeSwitch:
    """Tells by heartbeats whether one requested switch has happened.

    Args:
        state: the vehicle's state.
        goals: the numbers of the modes that show it.
        on_their_way: the modes that were requested before it and not shown yet.
        does_more: whether its command does more than switch the mode.
    """

    def __init__(self, state: VehicleState, goals: set[int], on_their_way: list[int], *, does_more: bool) -> None:
        self._state = state
        self._goals = goals
        self._ours = {state.mode, None, *goals, *on_their_way}  # None: no heartbeat since a reboot
        # If another switch is on its way, a heartbeat in this mode may be older than both. If the vehicle is in this
        # mode already, a heartbeat does not show what else the command does.
        self.is_ambiguous = not goals.isdisjoint((state.mode, *on_their_way)) and (
            does_more or not goals.issuperset(on_their_way)
        )
        self._counts_from = math.inf if self.is_ambiguous else -math.inf  # s; older heartbeats show nothing
        self._has_shown = False

    def acknowledged(self, at: float) -> None:
        """Its command is acknowledged: from `at` on (s) heartbeats show it."""
        self._counts_from = min(self._counts_from, at)

    def holds(self) -> bool:
        """Whether the vehicle is in one of the goals."""
        return self._state.mode in self._goals

    def shown(self) -> bool:
        """Whether the vehicle is in one of the goals by this switch.

        Raises:
            ModeChanged: the pilot or a failsafe switched it elsewhere.
        """
        mode = self._state.mode
        left_again = self._has_shown and mode not in (None, *self._goals)
        if mode not in self._ours or left_again:
            name = mode_name(self._state.vehicle_type, mode)
            raise ModeChanged(f"the pilot or a failsafe switched the vehicle to {name} meanwhile")
        self._has_shown = self._has_shown or (mode in self._goals and self._state.heartbeat_at > self._counts_from)
        return self._has_shown and mode in self._goals
