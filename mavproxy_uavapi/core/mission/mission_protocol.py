"""MAVLink's mission protocol: upload with read-back, download, clear; for the mission, the fence and rally points.

Messages count only if the addressed autopilot sends them to us and they are about the list that was asked for (its
MAV_MISSION_TYPE). Without an answer a request is repeated.

MAVProxy's own `wp` module receives the same messages, but answers only those of its own transfers.
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, TypeVar

from pymavlink import mavutil

from mavproxy_uavapi.core.control.start_gate import pass_gate
from mavproxy_uavapi.core.errors import Busy, LinkLost, Rejected, Superseded, TimedOut, UavApiError
from mavproxy_uavapi.core.link.link import Address, Link
from mavproxy_uavapi.core.link.message_waiter import MessageExchange, MessageWaiter
from mavproxy_uavapi.core.link.turns import Turns
from mavproxy_uavapi.core.mainloop.permit import Permit, permitted
from mavproxy_uavapi.core.mission.mission_files import HOME, MissionItem, difference, from_message
from mavproxy_uavapi.core.shared_tasks import SharedTasks, in_thread_if_long
from mavproxy_uavapi.core.telemetry.vehicle_state import VehicleState

T = TypeVar("T")
mavlink = mavutil.mavlink

ANSWER_TIMEOUT = 1.5  # s until we ask again; more on a slow link
SENDINGS = 4  # the first one and three more
ASKING_TIMEOUT = 9.0  # s; an ArduPilot asks again for an item after 1 s, and gives an upload up after 8 s
CANCELLED = "MAV_MISSION_OPERATION_CANCELLED"  # the vehicle waited too long for an item
MISSION, FENCE = mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_FENCE
RALLY = mavlink.MAV_MISSION_TYPE_RALLY
NAMES = {MISSION: "mission", FENCE: "fence", RALLY: "list of rally points"}
ANSWERS = ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM", "MISSION_ACK")
REQUESTS = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK")

Progress = Callable[[int, int], None]
Check = Callable[[], None]
Changed = Callable[[int, Sequence[MissionItem]], None]
Lists = Mapping[int, Sequence[MissionItem]]  # by MAV_MISSION_TYPE; a mission's from item 1 on


async def _allow_all(_items: Sequence[MissionItem]) -> None:
    """Any mission."""


class ReadInterrupted(Exception):
    """A read ended, because a verb waits for its turn."""


class Waypoints:
    """The mission that one vehicle holds, its fence and its rally points.

    Attributes:
        changed_at: when we last changed or started it, on the clock of arrivals (s).
        changes: how often we have changed it.

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
        self._state = state
        self._link = link
        self._waiting = waiting
        self._allow = allow
        self._is_flown = is_flown
        self._turns = Turns("transfers of the mission")
        self._verbs = 0  # number of verbs that have a turn or wait for one
        self._reads = SharedTasks[list[MissionItem]]()  # by the kind of list
        self._sent_at = 0.0  # s; when we last began to change a list
        self.changed_at = 0.0
        self.changes = 0
        self._begins = False  # whether a job begins to fly it

    # -- verbs --------------------------------------------------------------------------------------------

    async def download(self) -> tuple[MissionItem | None, list[MissionItem]]:
        """Home (None where the vehicle has no item 0 yet), and the items from 1 on.

        Raises:
            Rejected: another ground station transfers a mission now.
            Busy: our other transfers take too long.
            TimedOut, LinkLost.
        """
        async with self._turn():
            return await self._download()

    async def read(self) -> tuple[MissionItem | None, list[MissionItem]]:
        """As `download`, for display: simultaneous callers share a download, which gives way to all but reads."""
        return _home_and_items(await self._read(MISSION))

    async def read_list(self, kind: int) -> list[MissionItem]:
        """The fence or the rally points that the autopilot itself keeps, as `read`.

        Raises:
            Rejected, Busy, TimedOut, LinkLost: as `download`; also where the vehicle has no such list.
        """
        return await self._read(kind)

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
            OutsideEnvelope: it leaves the envelope; nothing was sent.
            Busy: the vehicle flies its mission, or our other transfers take too long.
            TimedOut, LinkLost. Also what `check` raises, with what became of the old lists.
        """

        def still() -> None:
            check()
            if MISSION in lists:
                self.require_still()

        still()
        if MISSION in lists and FENCE not in lists:
            await self._allow(lists[MISSION])
        async with self._turn():
            old = {kind: await self._items_of(kind) for kind in lists}
            await pass_gate()
            still()
            self._note_change(lists)
            count, total, begun = 0, sum(len(_with_home(kind, items)) for kind, items in lists.items()), []
            try:
                # What was asked for before the pilot began the mission does not change it.
                with permitted(Permit(check=still, system=self._state.system)):
                    for kind, items in lists.items():
                        begun.append(kind)

                        def report(done: int, before: int = count) -> None:
                            still()
                            progress(before + done, total)

                        if kind == MISSION and FENCE in lists:
                            await self._allow(items)
                        await self._put(kind, items, report)
                        changed(kind, items)
                        count += len(_with_home(kind, items))
            except UavApiError as error:
                undone = [await self._undo(kind, old[kind], error) for kind in reversed(begun)]
                for kind in begun:
                    changed(kind, old[kind])
                error.args = ("".join([str(error), *undone]),)
                raise

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

        def still() -> None:
            check()
            if kind == MISSION:
                self.require_still()

        async with self._turn():
            still()
            self._note_change({kind: ()})
            with permitted(Permit(check=still, system=self._state.system)), self._talk(ANSWERS) as talk:
                await self._clear(talk, kind)
                remaining = await self._ask_count(talk, kind) - len(_with_home(kind, ()))
            if remaining > 0:
                held = f"its {NAMES[kind]} still has {remaining} items"
                raise Rejected(f"the vehicle accepted the clearing, but {held}")

    @contextlib.contextmanager
    def beginning(self, changes: int) -> Iterator[None]:
        """While a job begins to fly it: nothing changes it.

        Args:
            changes: `changes` when the job looked at it.

        Raises:
            Superseded: it has been changed since.
        """
        if changes != self.changes:
            raise Superseded("the vehicle's mission was changed meanwhile")
        self._begins = True
        try:
            yield
        finally:
            self._begins = False

    def require_still(self) -> None:
        """Raise Busy while the vehicle flies the mission that would be changed, or begins to."""
        if self._begins or self._is_flown():
            raise Busy("the vehicle flies its mission; /command/guided or /command/brake first")

    def _note_change(self, lists: Lists) -> None:
        self._sent_at = self._waiting.clock()
        if MISSION in lists:
            self.changed_at, self.changes = self._sent_at, self.changes + 1

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

    async def _read(self, kind: int) -> list[MissionItem]:
        return await self._reads.outcome(kind, lambda: self._read_in_turn(kind))

    async def _read_in_turn(self, kind: int) -> list[MissionItem]:
        while True:
            async with self._turns.one():
                with contextlib.suppress(ReadInterrupted):
                    return await self._fetch(kind, self._yield_to_verbs)

    def _yield_to_verbs(self) -> None:
        if self._verbs:
            raise ReadInterrupted

    # -- the protocol -------------------------------------------------------------------------------------

    @property
    def _address(self) -> Address:
        return Address(self._state.system, self._state.component)

    def _talk(self, names: Sequence[str]) -> AbstractContextManager[MessageExchange[Any]]:
        return self._waiting.exchange(names, self._link.source)

    async def _send(self, message: Any) -> None:
        await self._link.send(message, self._state.system)

    async def _ask(
        self, talk: MessageExchange[Any], question: Any, test: Callable[[Any], T | None], action: str
    ) -> T:
        """Ask until `test` of an answer is not None.

        Raises:
            Rejected: the vehicle answered with errors only. A single one may belong to an upload that has just ended.
        """
        refusal = None
        for _ in range(SENDINGS):
            await self._send(question)
            deadline = self._waiting.clock() + self._state.trip.at_least(ANSWER_TIMEOUT)
            while (message := await talk.next(max(deadline - self._waiting.clock(), 0.0))) is not None:
                if message.mission_type != question.mission_type:
                    continue
                value = test(message)
                if value is not None:
                    return value
                if message.get_type() == "MISSION_ACK" and message.type != mavlink.MAV_MISSION_ACCEPTED:
                    refusal = self._refusal(message, action)
        raise refusal or TimedOut(f"vehicle {self._state.system} did not {action} after {SENDINGS} requests")

    async def _ask_count(self, talk: MessageExchange[Any], kind: int = MISSION) -> int:
        question = mavlink.MAVLink_mission_request_list_message(*self._address, kind)
        return await self._ask(talk, question, _count_of, f"report how many {NAMES[kind]} items it has")

    async def _download(self) -> tuple[MissionItem | None, list[MissionItem]]:
        return _home_and_items(await self._fetch(MISSION))

    async def _items_of(self, kind: int) -> list[MissionItem]:
        items = await self._fetch(kind)
        return items[1:] if kind == MISSION else items

    async def _fetch(self, kind: int, check: Check = lambda: None) -> list[MissionItem]:
        """All items of a list; `check` is called before each request, and may end the transfer."""
        with self._talk(ANSWERS) as talk:
            items = []
            check()
            for seq in range(await self._ask_count(talk, kind)):
                check()
                question = mavlink.MAVLink_mission_request_int_message(*self._address, seq, kind)
                message = await self._ask(talk, question, _item_number(seq), f"send {NAMES[kind]} item {seq}")
                items.append(from_message(message))
            await self._send(mavlink.MAVLink_mission_ack_message(*self._address, mavlink.MAV_MISSION_ACCEPTED, kind))
        return items

    async def _clear(self, talk: MessageExchange[Any], kind: int) -> None:
        question = mavlink.MAVLink_mission_clear_all_message(*self._address, kind)

        def accepted(message: Any) -> bool | None:
            if message.get_type() != "MISSION_ACK":
                return None
            if message.type != mavlink.MAV_MISSION_ACCEPTED:
                raise self._refusal(message, f"clear its {NAMES[kind]}")
            return True

        await self._ask(talk, question, accepted, f"clear its {NAMES[kind]}")

    async def _put(self, kind: int, items: Sequence[MissionItem], report: Callable[[int], None]) -> None:
        """Upload and read back; try again once if the transfer itself failed.

        Raises:
            Rejected: the vehicle refused it, or has another list afterwards.
        """
        try:
            await self._hand_over(kind, items, report)
        except (TimedOut, Rejected) as error:
            if isinstance(error, Rejected) and error.ack != CANCELLED:
                raise
            await self._hand_over(kind, items, report)
        differs = await in_thread_if_long(len(items), difference, items, await self._items_of(kind))
        if differs is not None:
            raise Rejected(f"the {NAMES[kind]} that was read back is not the one that was sent: {differs}")

    async def _hand_over(self, kind: int, items: Sequence[MissionItem], report: Callable[[int], None]) -> None:
        with self._talk(REQUESTS) as talk:
            await self._answer_requests(talk, kind, _with_home(kind, items), report)

    async def _answer_requests(
        self, talk: MessageExchange[Any], kind: int, items: Sequence[MissionItem], report: Callable[[int], None]
    ) -> None:
        """Offer the items, and send each one whenever the vehicle asks for it.

        Only the offer is sent unasked: for ArduPilot an item that comes twice is an error. If the last
        acknowledgement is lost, the read-back shows the outcome.
        """
        handed_over: set[int] = set()
        offers, newest = 0, ""
        while True:
            if not handed_over:
                if offers == SENDINGS:
                    what = f"did not accept the {NAMES[kind]}, offered {offers} times"
                    raise TimedOut(f"vehicle {self._state.system} {what}")
                await self._send(mavlink.MAVLink_mission_count_message(*self._address, len(items), kind))
                offers += 1
            timeout = ASKING_TIMEOUT if handed_over else self._state.trip.at_least(ANSWER_TIMEOUT)
            message = await self._next_request(talk, kind, timeout, f"take {newest}the {NAMES[kind]}")
            complete = len(handed_over) == len(items)
            if message is None and complete:
                return
            if message is None and handed_over:
                raise TimedOut(
                    f"vehicle {self._state.system} requested only {len(handed_over)} of {len(items)} items"
                )
            if message is None:
                continue
            if message.get_type() == "MISSION_ACK":
                if complete and message.type == mavlink.MAV_MISSION_ACCEPTED:
                    return
            elif message.seq < len(items):
                item = items[message.seq]
                await self._send(item.to(self._address, message.seq, kind))
                handed_over.add(message.seq)
                newest = "" if item is HOME else f"{_named(kind, message.seq, item)} of "
                report(len(handed_over))

    async def _next_request(self, talk: MessageExchange[Any], kind: int, timeout: float, action: str) -> Any | None:
        """The next message of an upload; `action` is what the vehicle does not want if it refuses.

        Raises:
            Rejected: it says that the vehicle does not want the list.
        """
        deadline = self._waiting.clock() + timeout
        while (message := await talk.next(max(deadline - self._waiting.clock(), 0.0))) is not None:
            if message.mission_type != kind:
                continue
            harmless = (mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            if message.get_type() == "MISSION_ACK" and message.type not in harmless:
                raise self._refusal(message, action)
            return message
        return None

    async def _undo(self, kind: int, old: Sequence[MissionItem], error: UavApiError) -> str:
        """After a failed upload restore the old list, and say whether that succeeded."""
        name = NAMES[kind]
        if isinstance(error, LinkLost):
            return f"; its {name} may be incomplete now, because the link is lost"
        try:
            if await self._holds(kind, old):
                return f"; its old {name} is unchanged"
            if old:
                await self._put(kind, old, lambda done: None)
            else:
                with self._talk(ANSWERS) as talk:
                    await self._clear(talk, kind)
        except (Rejected, TimedOut, LinkLost) as failure:
            return f"; its {name} is incomplete now, and the old one could not be put back: {failure}"
        return f"; its old {name} ({len(old)} items) was put back" if old else f"; it has no {name}, as before"

    async def _holds(self, kind: int, items: Sequence[MissionItem]) -> bool:
        """Whether its list is this one. In the middle of an upload it does not tell, and does not hold it."""
        try:
            return await self._items_of(kind) == list(items)
        except Rejected:
            return False

    def _refusal(self, message: Any, action: str) -> Rejected:
        entry = mavlink.enums["MAV_MISSION_RESULT"].get(message.type)
        name = entry.name if entry else f"MAV_MISSION_RESULT_{message.type}"
        texts = self._state.statustexts_since(self._sent_at) if self._sent_at else []
        return Rejected(f"vehicle {self._state.system} refused to {action} ({name})", name, texts)


def _home_and_items(items: list[MissionItem]) -> tuple[MissionItem | None, list[MissionItem]]:
    return (items[0], items[1:]) if items else (None, [])


def _with_home(kind: int, items: Sequence[MissionItem]) -> list[MissionItem]:
    """The items as MAVLink numbers them: a mission's begin with home."""
    return [HOME, *items] if kind == MISSION else list(items)


def _named(kind: int, seq: int, item: MissionItem) -> str:
    """The item with its number from 1 on."""
    return f"item {seq if kind == MISSION else seq + 1} ({item.name}, command {item.command})"


def _count_of(message: Any) -> int | None:
    return int(message.count) if message.get_type() == "MISSION_COUNT" else None


def _item_number(seq: int) -> Callable[[Any], Any | None]:
    return lambda message: message if message.get_type().startswith("MISSION_ITEM") and message.seq == seq else None
