"""The mission of one vehicle, its fence and its rally points: read, replaced with read-back, cleared, in turns."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Collection, Iterator, Sequence
from typing import Any

from mavproxy_uavapi.core.control.start_gate import pass_gate
from mavproxy_uavapi.core.errors import Busy, LinkLost, Rejected, Superseded, TimedOut, UavApiError
from mavproxy_uavapi.core.link.link import Link
from mavproxy_uavapi.core.link.message_waiter import MessageWaiter
from mavproxy_uavapi.core.link.turns import Turns
from mavproxy_uavapi.core.mainloop.permit import Permit, permitted
from mavproxy_uavapi.core.mission.list_transfers import FENCE, MISSION, NAMES, Check, Lists, ListTransfers, with_home
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.shared_tasks import SharedTasks
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

Progress = Callable[[int, int], None]
Changed = Callable[[int, Sequence[MissionItem]], None]


async def _allow_all(_items: Sequence[MissionItem]) -> None:
    """Any mission."""


class ReadInterrupted(Exception):
    """A read ended, because a verb waits for its turn."""


class Waypoints:
    """The mission that one vehicle holds, its fence and its rally points.

    Attributes:
        changed_at: when we last changed or started it, on the clock of arrivals (s).
        changes: how often we have changed it, or have heard that another station does.

    Args:
        state: the vehicle's.
        link: the way out.
        waiting: its waits.
        allow: called with a mission's items before its upload; refuses it by raising.
        is_flown: whether the vehicle flies its mission, or may do so in a moment.
    """

    def __init__(
        self,
        state: VehicleState,
        link: Link,
        waiting: MessageWaiter,
        allow: Callable[[Sequence[MissionItem]], Awaitable[None]] = _allow_all,
        is_flown: Callable[[], bool] = lambda: False,
    ) -> None:
        self._system, self._clock = state.system, waiting.clock
        self._transfers = ListTransfers(state, link, waiting)
        self._allow = allow
        self._is_flown = is_flown
        self._turns = Turns("transfers of the mission")
        self._verbs = 0  # number of verbs that have a turn or wait for one
        self._reads = SharedTasks[list[MissionItem]]()  # by the kind of list
        self.changed_at = 0.0
        self.changes = 0
        self._begins = False  # whether a job begins to fly it
        self._uploads = False  # whether we hand over a list, for whose items the vehicle asks

    # -- verbs --------------------------------------------------------------------------------------------

    async def download(self) -> tuple[MissionItem | None, list[MissionItem]]:
        """Home (None where the vehicle has no item 0 yet), and the items from 1 on.

        Raises:
            Rejected: another ground station transfers a mission now.
            Busy: our other transfers take too long.
            TimedOut, LinkLost.
        """
        async with self._turn():
            return _home_and_items(await self._transfers.fetch(MISSION))

    async def read(self) -> tuple[MissionItem | None, list[MissionItem]]:
        """As `download`, for display: simultaneous callers share a download, which gives way to all but reads."""
        return _home_and_items(await self.read_list(MISSION))

    async def read_list(self, kind: int) -> list[MissionItem]:
        """The fence or the rally points that the autopilot itself keeps, as `read`.

        Raises:
            Rejected, Busy, TimedOut, LinkLost: as `download`; also where the vehicle has no such list.
        """
        return await self._reads.outcome(kind, lambda: self._read_in_turn(kind))

    async def upload(
        self,
        lists: Lists,
        progress: Progress = lambda done, of: None,
        check: Check = lambda: None,
        changed: Changed = lambda kind, items: None,
    ) -> None:
        """Put `lists` in place of those that the vehicle has, one after the other, and read them back.

        A mission behind a fence is checked when the fence is there: the envelope may follow it.

        After a failed upload the vehicle has its old lists: untouched if it refused at once, else put back. The error
        says which, or that this failed.

        Args:
            lists: the mission, the fence, the rally points, or several of them.
            progress: called with the number of items that were requested, and of all.
            check: called before the first item and after each; what it raises ends the upload, as a failure does.
            changed: called with each list that the vehicle has got, or has got back.

        Raises:
            Rejected: with the MAV_MISSION_RESULT as `ack`.
            OutsideEnvelope: it leaves the envelope, or the fence that comes with it.
            Busy: the vehicle flies its mission, or our other transfers take too long.
            TimedOut, LinkLost. Also what `check` raises, with what became of the old lists.
        """

        still = self._still(lists, check)
        still()
        if MISSION in lists and FENCE not in lists:
            await self._allow(lists[MISSION])
        async with self._turn():
            old = {kind: await self._transfers.items_of(kind) for kind in lists}
            await pass_gate()
            still()
            self._note_change(lists)
            begun: list[int] = []
            self._uploads = True
            try:
                # What was asked for before the pilot began the mission does not change it.
                with permitted(Permit(check=still, system=self._system)):
                    await self._put(lists, begun, still, progress, changed)
            except UavApiError as error:
                undone = [await self._undo(kind, old[kind], error) for kind in reversed(begun)]
                for kind in begun:
                    changed(kind, old[kind])
                error.args = ("".join([str(error), *undone]),)
                raise
            finally:
                self._uploads = False

    async def _put(self, lists: Lists, begun: list[int], still: Check, progress: Progress, changed: Changed) -> None:
        """Put each of them; `begun` gets those that were begun."""
        count, total = 0, sum(len(with_home(kind, items)) for kind, items in lists.items())
        for kind, items in lists.items():
            begun.append(kind)

            def report(done: int, before: int = count) -> None:
                still()
                progress(before + done, total)

            if kind == MISSION and FENCE in lists:
                await self._allow(items)
            await self._transfers.put(kind, items, report)
            changed(kind, items)
            count += len(with_home(kind, items))

    async def _undo(self, kind: int, old: Sequence[MissionItem], error: UavApiError) -> str:
        """After a failed upload restore the old list, and say whether that succeeded."""
        name = NAMES[kind]
        if isinstance(error, LinkLost):
            return f"; its {name} may be incomplete now, because the link is lost"
        try:
            if await self._transfers.holds(kind, old):
                return f"; its old {name} is unchanged"
            if old:
                await self._transfers.put(kind, old, lambda done: None)
            else:
                await self._transfers.clear(kind)
        except (Rejected, Busy, TimedOut, LinkLost) as failure:
            return f"; its {name} is incomplete now, and the old one could not be put back: {failure}"
        return f"; its old {name} ({len(old)} items) was put back" if old else f"; it has no {name}, as before"

    async def clear(self, kind: int = MISSION, check: Check = lambda: None) -> None:
        """Remove the mission, the fence or the rally points, and check that they are gone.

        Args:
            kind: which, a MAV_MISSION_TYPE.
            check: called before the removal; what it raises prevents it.

        Raises:
            Rejected: the vehicle does not want to.
            Busy: the vehicle flies its mission, or our other transfers take too long.
            TimedOut, LinkLost.
        """

        still = self._still((kind,), check)
        async with self._turn():
            still()
            self._note_change((kind,))
            with permitted(Permit(check=still, system=self._system)):
                await self._transfers.clear(kind)

    @contextlib.contextmanager
    def beginning(self, changes: int) -> Iterator[None]:
        """While a job begins to fly it: nothing changes it.

        Args:
            changes: `changes` when the job looked at it.

        Raises:
            Superseded: it has been changed since.
        """
        self.require_unchanged(changes)
        self._begins = True
        try:
            yield
        finally:
            self._begins = False

    def require_unchanged(self, changes: int) -> None:
        """Raise Superseded unless `changes` is still what it was."""
        if changes != self.changes:
            raise Superseded("the vehicle's mission was changed meanwhile")

    def require_still(self) -> None:
        """Raise Busy while the vehicle flies the mission that would be changed, or begins to."""
        if self._begins or self._is_flown():
            raise Busy("the vehicle flies its mission; /command/guided or /command/brake first")

    def overhears(self, message: Any) -> bool:
        """Whether a vehicle's MISSION_REQUEST tells that another station changes its mission."""
        foreign = not self._uploads and message.mission_type == MISSION
        self.changes += foreign
        return foreign

    def _still(self, kinds: Collection[int], check: Check) -> Check:
        """`check`, and that nobody flies the mission that would be changed."""

        def still() -> None:
            check()
            if MISSION in kinds:
                self.require_still()

        return still

    def _note_change(self, kinds: Collection[int]) -> None:
        if MISSION in kinds:
            self.changed_at, self.changes = self._clock(), self.changes + 1

    # -- turns --------------------------------------------------------------------------------------------

    @contextlib.asynccontextmanager
    async def _turn(self) -> AsyncIterator[None]:
        """A turn of a verb. Raises Busy if other verbs take too long."""
        self._verbs += 1
        try:
            async with self._turns.one():
                yield
        finally:
            self._verbs -= 1

    async def _read_in_turn(self, kind: int) -> list[MissionItem]:
        while True:
            async with self._turns.one():
                with contextlib.suppress(ReadInterrupted):
                    return await self._transfers.fetch(kind, self._yield_to_verbs)

    def _yield_to_verbs(self) -> None:
        if self._verbs:
            raise ReadInterrupted


def _home_and_items(items: list[MissionItem]) -> tuple[MissionItem | None, list[MissionItem]]:
    return (items[0], items[1:]) if items else (None, [])
