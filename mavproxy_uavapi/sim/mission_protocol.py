"""MAVLink's mission protocol: upload, download, clear and set current, for missions, fences and rally points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from . import fence_and_rally
from .events import StatusTextEvent
from .mission import Item, home_item
from .mission_items import as_item, as_message, refusal, unreadable

if TYPE_CHECKING:
    from .link import PeerLink
    from .vehicle import EmbeddedVehicle

LIMIT = 724
"""What ArduCopter can store in SITL."""
RETRY_AFTER = 1.0
GIVE_UP_AFTER = 8.0
MISSION = mavlink.MAV_MISSION_TYPE_MISSION
FENCE, RALLY = mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY
GUIDED_TARGET = 2
"""Value of `current` in an item that GUIDED flies to at once."""
ALTITUDE_CHANGE = 3
"""Value of `current` in an item that changes the height; all accept it, ArduPlane alone does it."""
OTHER_LISTS = (FENCE, RALLY)
TOTALS = {FENCE: "FENCE_TOTAL", RALLY: "RALLY_TOTAL"}
"""The parameters that count the items."""


@dataclass
class Upload:
    """An upload under way from one sender; next and last are item numbers, times simulated seconds."""

    link: PeerLink
    sender: tuple[int, int]
    kind: int
    next: int
    last: int
    items: list[Item]
    heard_at: float = 0.0
    asked_at: float = 0.0


class MissionProtocol:
    """Answers MISSION_* messages for one vehicle; `lists` has its fence and rally points, which outlive a boot."""

    def __init__(self, vehicle: EmbeddedVehicle, lists: dict[int, list[Item]]) -> None:
        self.vehicle = vehicle
        self._lists = lists
        for kind in OTHER_LISTS:
            lists.setdefault(kind, [])
        vehicle.take_fence(lists[FENCE])
        self._upload: Upload | None = None
        self._warned = False
        self._handlers = {
            "MISSION_COUNT": self._count,
            "MISSION_WRITE_PARTIAL_LIST": self._partial,
            "MISSION_ITEM_INT": self._item,
            "MISSION_ITEM": self._item,
            "MISSION_REQUEST_LIST": self._request_list,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_REQUEST": self._request,
            "MISSION_CLEAR_ALL": self._clear,
        }

    def handle(self, link: PeerLink, message: Any) -> bool:
        """Answer a message on its link; False when it is not of this protocol."""
        handler = self._handlers.get(message.get_type())
        if handler is None:
            return False
        if message.mission_type not in (MISSION, *OTHER_LISTS):
            self._ack(link, message, mavlink.MAV_MISSION_UNSUPPORTED)
        else:
            handler(link, message)
        return True

    def step(self) -> None:
        """Ask again for an item that does not come, and give up in the end."""
        upload, now = self._upload, self.vehicle.now
        if upload is None:
            return
        if now - upload.heard_at > GIVE_UP_AFTER:
            self._abandon(upload)
            upload.link.send(
                mavlink.MAVLink_mission_ack_message(
                    *upload.sender, mavlink.MAV_MISSION_OPERATION_CANCELLED, upload.kind
                )
            )
        elif now - upload.asked_at > RETRY_AFTER:
            self._ask()

    def items(self, kind: int) -> list[Item]:
        """The stored list; item 0 of a mission is home as it is now."""
        if kind != MISSION:
            return self._lists[kind]
        items = self.vehicle.mission.items
        home = self.vehicle.home
        if not items or home is None:
            return items
        return [home_item(home), *items[1:]]

    def _most(self, kind: int) -> int:
        return {FENCE: self.vehicle.fence_storage // 8, RALLY: self.vehicle.most_rally_points}.get(kind, LIMIT)

    def _ack(self, link: PeerLink, message: Any, result: int) -> None:
        link.send(mavlink.MAVLink_mission_ack_message(*_sender(message), result, message.mission_type))

    def _busy(self, link: PeerLink, message: Any) -> bool:
        if self._upload is None:
            return False
        self._ack(link, message, mavlink.MAV_MISSION_DENIED)
        return True

    def _foreign_upload(self, link: PeerLink, message: Any) -> bool:
        """Another station's upload must not be disturbed; a station may restart its own."""
        if self._upload is not None and self._upload.sender != _sender(message):
            return self._busy(link, message)
        self._upload = None
        return False

    def _count(self, link: PeerLink, message: Any) -> None:
        if self._foreign_upload(link, message):
            return
        most = self._most(message.mission_type)
        if message.count > most:
            self._ack(link, message, mavlink.MAV_MISSION_NO_SPACE)
            self.vehicle.say(mavlink.MAV_SEVERITY_WARNING, f"Only {most} items are supported")
        elif message.count == 0:
            self._store(message.mission_type, [])
            self._ack(link, message, mavlink.MAV_MISSION_ACCEPTED)
        else:
            former = self.items(message.mission_type)[: message.count]
            self._begin(Upload(link, _sender(message), message.mission_type, 0, message.count - 1, former))

    def _partial(self, link: PeerLink, message: Any) -> None:
        if self._busy(link, message):
            return
        items = list(self.items(message.mission_type))
        first, last = message.start_index, message.end_index
        if not 0 <= first <= last < len(items):
            self.vehicle.emit(StatusTextEvent(mavlink.MAV_SEVERITY_WARNING, "Flight plan update rejected"))
            self._ack(link, message, mavlink.MAV_MISSION_ERROR)
            return
        self._begin(Upload(link, _sender(message), message.mission_type, first, last, items))

    def _begin(self, upload: Upload) -> None:
        upload.heard_at = self.vehicle.now
        self._upload = upload
        self._ask()

    def _ask(self) -> None:
        upload = self._upload
        if upload is not None:
            upload.asked_at = self.vehicle.now
            upload.link.send(mavlink.MAVLink_mission_request_message(*upload.sender, upload.next, upload.kind))

    def _item(self, link: PeerLink, message: Any) -> None:
        problem = unreadable(message)
        if problem is not None:
            self._ack(link, message, problem)
            return
        if message.mission_type == MISSION and message.current in (GUIDED_TARGET, ALTITUDE_CHANGE):
            self._ack(link, message, self._take_guided(message))
            return
        self._warn_of_floats(message)
        upload = self._upload
        if upload is None or upload.kind != message.mission_type:
            self._ack(link, message, mavlink.MAV_MISSION_ERROR)
        elif message.seq != upload.next:
            self._ack(link, message, mavlink.MAV_MISSION_INVALID_SEQUENCE)
        elif _sender(message) != upload.sender:
            self._ack(link, message, mavlink.MAV_MISSION_DENIED)
        else:
            self._take(link, message, upload)

    def _take_guided(self, message: Any) -> int:
        """An item that is for now and not for the mission; a MAV_MISSION_RESULT."""
        problem = refusal(message, self.vehicle.mission_commands)
        if problem is not None:
            return problem
        item = as_item(message)
        if message.current == ALTITUDE_CHANGE:
            self.vehicle.change_altitude(item)
            return int(mavlink.MAV_MISSION_ACCEPTED)
        done = self.vehicle.fly_guided_item(item)
        return int(mavlink.MAV_MISSION_ACCEPTED if done else mavlink.MAV_MISSION_ERROR)

    def _warn_of_floats(self, message: Any) -> None:
        """Say once in a boot that a MISSION_ITEM loses digits."""
        if message.get_type() == "MISSION_ITEM" and not self._warned:
            self._warned = True
            self.vehicle.say(mavlink.MAV_SEVERITY_WARNING, "got MISSION_ITEM; GCS should send MISSION_ITEM_INT")

    def _take(self, link: PeerLink, message: Any, upload: Upload) -> None:
        problem = self._refusal(upload.kind, message)
        if problem is not None:
            self._abandon(upload)
            self._ack(link, message, problem)
            return
        item = as_item(message)
        if upload.kind != MISSION:
            item = fence_and_rally.as_stored(item)
        upload.items[message.seq : message.seq + 1] = [item]
        upload.heard_at = self.vehicle.now
        upload.next += 1
        if upload.next <= upload.last:
            self._ask()
            return
        self._upload = None
        if upload.kind == FENCE and not self._is_sound(upload.items):
            self._ack(link, message, mavlink.MAV_MISSION_ERROR)
            return
        self._store(upload.kind, upload.items)
        self._ack(link, message, mavlink.MAV_MISSION_ACCEPTED)
        if upload.kind == MISSION:
            self.vehicle.say(mavlink.MAV_SEVERITY_INFO, "Flight plan received")

    def _refusal(self, kind: int, message: Any) -> int | None:
        if kind == FENCE:
            return fence_and_rally.refusal_of_fence(message)
        if kind == RALLY:
            return fence_and_rally.refusal_of_rally(message)
        return refusal(message, self.vehicle.mission_commands)

    def _is_sound(self, fence: list[Item]) -> bool:
        """Whether a fence that came whole is taken; the vehicle says why not."""
        problem = fence_and_rally.problem_of(fence, self.vehicle.fence_storage)
        if problem is not None:
            self.vehicle.say(mavlink.MAV_SEVERITY_WARNING, problem)
            self.vehicle.say(mavlink.MAV_SEVERITY_WARNING, "Fence validation failed")
        return problem is None

    def _abandon(self, upload: Upload) -> None:
        """An upload that ends early keeps the items that came and cuts the old list, as in ArduPilot; not a fence."""
        self._upload = None
        if upload.kind != FENCE:
            self._store(upload.kind, upload.items)

    def _store(self, kind: int, items: list[Item]) -> None:
        if kind == MISSION:
            self.vehicle.mission.replace(items)
        else:
            self._lists[kind] = items
            if kind == FENCE:
                self.vehicle.take_fence(items)
            self.vehicle.parameters.set(TOTALS[kind], fence_and_rally.total_of(items))

    def _request_list(self, link: PeerLink, message: Any) -> None:
        if not self._busy(link, message):
            self._send_count(link, message)

    def _send_count(self, link: PeerLink, message: Any) -> None:
        count = len(self.items(message.mission_type))
        link.send(mavlink.MAVLink_mission_count_message(*_sender(message), count, message.mission_type))

    def _request(self, link: PeerLink, message: Any) -> None:
        if self._busy(link, message):
            return
        items = self.items(message.mission_type)
        if message.seq >= len(items):
            self._send_count(link, message)
            self._ack(link, message, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            return
        link.send(as_message(items[message.seq], message))

    def _clear(self, link: PeerLink, message: Any) -> None:
        if self._foreign_upload(link, message):
            return
        cleared = True
        if message.mission_type == MISSION:
            cleared = self.vehicle.mission.clear(armed=self.vehicle.armed)
        else:
            self._store(message.mission_type, [])
        self._ack(link, message, mavlink.MAV_MISSION_ACCEPTED if cleared else mavlink.MAV_MISSION_ERROR)


def _sender(message: Any) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()
