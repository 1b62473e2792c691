"""MAVLink's mission protocol: one transfer of a list after the other, for the mission, the fence and rally points.

Messages count only if the addressed autopilot sends them to us and they are about the list that was asked for (its
MAV_MISSION_TYPE). Without an answer a request is repeated.

MAVProxy's own `wp` module receives the same messages, but answers only those of its own transfers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, TypeVar

from pymavlink import mavutil

from mavproxy_uavapi.core.errors import Rejected, TimedOut
from mavproxy_uavapi.core.link.link import Address, Link
from mavproxy_uavapi.core.link.message_waiter import MessageExchange, MessageWaiter
from mavproxy_uavapi.core.mission.mission_files import HOME, MissionItem, difference, from_message
from mavproxy_uavapi.core.shared_tasks import in_thread_if_long
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
HARMLESS = (mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_INVALID_SEQUENCE)  # acks that refuse no upload

Check = Callable[[], None]
Lists = Mapping[int, Sequence[MissionItem]]  # by MAV_MISSION_TYPE; a mission's from item 1 on


class ListTransfers:
    """Reads and writes the lists of one vehicle. Who calls it sees to it that there is one transfer at a time.

    Args:
        state: the vehicle's.
        link: the way out.
        waiting: its waits.
    """

    def __init__(self, state: VehicleState, link: Link, waiting: MessageWaiter) -> None:
        self._state = state
        self._link = link
        self._waiting = waiting
        self._changing_since: float | None = None  # s; the texts of a refusal are newer

    async def fetch(self, kind: int, check: Check = lambda: None) -> list[MissionItem]:
        """All items of a list, a mission's with home.

        Args:
            kind: MAV_MISSION_TYPE.
            check: called before each request; it may end the transfer by raising.

        Raises:
            Rejected: the vehicle has no such list, or another ground station transfers one.
            Busy: two autopilots have its id.
            TimedOut, LinkLost.
        """
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

    async def items_of(self, kind: int) -> list[MissionItem]:
        """As `fetch`, without home."""
        items = await self.fetch(kind)
        return items[1:] if kind == MISSION else items

    async def holds(self, kind: int, items: Sequence[MissionItem]) -> bool:
        """Whether its list is this one. In the middle of an upload it does not tell, and does not hold it."""
        try:
            return await self.items_of(kind) == list(items)
        except Rejected:
            return False

    async def clear(self, kind: int) -> None:
        """Remove a list, and check that it is gone.

        Raises:
            Rejected: the vehicle does not want to, or has not.
            Busy: two autopilots have its id.
            TimedOut, LinkLost.
        """
        self._changing_since = self._waiting.clock()
        question = mavlink.MAVLink_mission_clear_all_message(*self._address, kind)

        def accepted(message: Any) -> bool | None:
            if message.get_type() != "MISSION_ACK":
                return None
            if message.type != mavlink.MAV_MISSION_ACCEPTED:
                raise self._refusal(message, f"clear its {NAMES[kind]}")
            return True

        with self._talk(ANSWERS) as talk:
            await self._ask(talk, question, accepted, f"clear its {NAMES[kind]}")
            remaining = await self._ask_count(talk, kind) - len(with_home(kind, ()))
        if remaining > 0:
            held = f"its {NAMES[kind]} still has {remaining} items"
            raise Rejected(f"the vehicle accepted the clearing, but {held}")

    async def put(self, kind: int, items: Sequence[MissionItem], report: Callable[[int], None]) -> None:
        """Upload a list and read it back; try again once if the transfer itself failed.

        Args:
            kind: MAV_MISSION_TYPE.
            items: a mission's from item 1 on.
            report: called with the number of items that were requested, home among them; it may end the transfer.

        Raises:
            Rejected: the vehicle refused it, or has another list afterwards.
            Busy: two autopilots have its id.
            TimedOut, LinkLost.
        """
        self._changing_since = self._waiting.clock()
        try:
            await self._hand_over(kind, items, report)
        except (TimedOut, Rejected) as error:
            if isinstance(error, Rejected) and error.ack != CANCELLED:
                raise
            await self._hand_over(kind, items, report)
        differs = await in_thread_if_long(len(items), difference, items, await self.items_of(kind))
        if differs is not None:
            raise Rejected(f"the {NAMES[kind]} that was read back is not the one that was sent: {differs}")

    async def _hand_over(self, kind: int, items: Sequence[MissionItem], report: Callable[[int], None]) -> None:
        with self._talk(REQUESTS) as talk:
            await self._answer_requests(talk, kind, with_home(kind, items), report)

    async def _answer_requests(
        self, talk: MessageExchange[Any], kind: int, items: Sequence[MissionItem], report: Callable[[int], None]
    ) -> None:
        """Offer the items, and send each one whenever the vehicle asks for it.

        Only the offer is sent unasked: for ArduPilot an item that comes twice is an error. If the last
        acknowledgement is lost, the read-back shows the outcome.
        """
        handed_over: set[int] = set()
        offers, newest, vehicle = 0, "", f"vehicle {self._state.system}"
        while True:
            if not handed_over:
                if offers == SENDINGS:
                    raise TimedOut(f"{vehicle} did not accept the {NAMES[kind]}, offered {offers} times")
                await self._send(mavlink.MAVLink_mission_count_message(*self._address, len(items), kind))
                offers += 1
            timeout = ASKING_TIMEOUT if handed_over else self._state.trip.at_least(ANSWER_TIMEOUT)
            message = await self._next(talk, kind, timeout)
            complete = len(handed_over) == len(items)
            if message is None:
                if complete:
                    return
                if handed_over:
                    raise TimedOut(f"{vehicle} requested only {len(handed_over)} of {len(items)} items")
            elif message.get_type() == "MISSION_ACK":
                if message.type not in HARMLESS:
                    raise self._refusal(message, f"take {newest}the {NAMES[kind]}")
                if complete and message.type == mavlink.MAV_MISSION_ACCEPTED:
                    return
            elif message.seq < len(items):
                item = items[message.seq]
                await self._send(item.to(self._address, message.seq, kind))
                handed_over.add(message.seq)
                newest = "" if item is HOME else f"{_named(kind, message.seq, item)} of "
                report(len(handed_over))

    @property
    def _address(self) -> Address:
        return Address(self._state.system, self._state.component)

    def _talk(self, names: Sequence[str]) -> AbstractContextManager[MessageExchange[Any]]:
        return self._waiting.exchange(names, self._link.source)

    async def _send(self, message: Any) -> None:
        self._state.require_one(self._waiting.clock())
        await self._link.send(message, self._state.system)

    async def _next(self, talk: MessageExchange[Any], kind: int, timeout: float) -> Any | None:
        """The next message about that list; None where none comes in so many s."""
        deadline = self._waiting.clock() + timeout
        while (message := await talk.next(max(deadline - self._waiting.clock(), 0.0))) is not None:
            if message.mission_type == kind:
                return message
        return None

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
            while message := await self._next(talk, question.mission_type, deadline - self._waiting.clock()):
                value = test(message)
                if value is not None:
                    return value
                if message.get_type() == "MISSION_ACK" and message.type != mavlink.MAV_MISSION_ACCEPTED:
                    refusal = self._refusal(message, action)
        raise refusal or TimedOut(f"vehicle {self._state.system} did not {action} after {SENDINGS} requests")

    async def _ask_count(self, talk: MessageExchange[Any], kind: int) -> int:
        question = mavlink.MAVLink_mission_request_list_message(*self._address, kind)
        return await self._ask(talk, question, _count_of, f"report how many {NAMES[kind]} items it has")

    def _refusal(self, message: Any, action: str) -> Rejected:
        entry = mavlink.enums["MAV_MISSION_RESULT"].get(message.type)
        name = entry.name if entry else f"MAV_MISSION_RESULT_{message.type}"
        since = self._changing_since
        texts = [] if since is None else self._state.statustexts.since(since)
        return Rejected(f"vehicle {self._state.system} refused to {action} ({name})", name, texts)


def with_home(kind: int, items: Sequence[MissionItem]) -> list[MissionItem]:
    """The items as MAVLink numbers them: a mission's begin with home."""
    return [HOME, *items] if kind == MISSION else list(items)


def _named(kind: int, seq: int, item: MissionItem) -> str:
    """The item with its number from 1 on."""
    return f"item {seq if kind == MISSION else seq + 1} ({item.name}, command {item.command})"


def _count_of(message: Any) -> int | None:
    return int(message.count) if message.get_type() == "MISSION_COUNT" else None


def _item_number(seq: int) -> Callable[[Any], Any | None]:
    return lambda message: message if message.get_type().startswith("MISSION_ITEM") and message.seq == seq else None
