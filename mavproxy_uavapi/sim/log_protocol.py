"""MAVLink's log protocol, as ArduPilot has it: one transfer at a time, for one link, and none while armed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .dataflash import Dataflash, StoredLog

if TYPE_CHECKING:
    from .link import PeerLink
    from .vehicle import EmbeddedVehicle

PIECE = 90
"""Bytes of a full LOG_DATA."""
PIECES_PER_STEP = 5


@dataclass
class Listing:
    """A list under way: the ids of the next and the last entry, and how many logs there are."""

    link: PeerLink
    next: int
    last: int
    count: int


@dataclass
class LogTransfer:
    """A log that is being sent: its id, the next byte, and the one after the last."""

    link: PeerLink
    id: int
    log: StoredLog
    next: int
    end: int


class LogProtocol:
    """Answers LOG_* messages for one vehicle, from one boot to the next."""

    def __init__(self, vehicle: EmbeddedVehicle, dataflash: Dataflash) -> None:
        self._vehicle = vehicle
        self._dataflash = dataflash
        self._transfer: Listing | LogTransfer | None = None
        self._warned = False
        self._handlers = {
            "LOG_REQUEST_LIST": self._list,
            "LOG_REQUEST_DATA": self._data,
            "LOG_REQUEST_END": self._end,
            "LOG_ERASE": self._erase,
        }

    def handle(self, link: PeerLink, message: Any) -> bool:
        """Answer a message on its link; False when it is not of this protocol."""
        handler = self._handlers.get(message.get_type())
        if handler is None:
            return False
        if not self._vehicle.armed:
            self._warned = False
            handler(link, message)
        elif not self._warned:
            self._warned = True
            self._vehicle.say(mavlink.MAV_SEVERITY_ERROR, "Disarm for log download")
        return True

    def step(self) -> None:
        """Send the next part."""
        transfer = self._transfer
        if transfer is None or self._vehicle.armed:
            return
        if isinstance(transfer, Listing):
            self._send_entry(transfer)
            return
        for _ in range(PIECES_PER_STEP):
            if self._transfer is transfer:
                self._send_piece(transfer)

    def _list(self, link: PeerLink, message: Any) -> None:
        if self._busy():
            return
        count = len(self._dataflash.logs)
        last = min(message.end, count)
        self._transfer = Listing(link, min(max(message.start, 1), last), last, count)

    def _data(self, link: PeerLink, message: Any) -> None:
        logs = self._dataflash.logs
        if self._transfer is not None:
            if self._transfer.link is not link:
                self._busy()
        elif 1 <= message.id <= len(logs):
            log = logs[message.id - 1]
            end = min(message.ofs + message.count, len(log.data))
            self._transfer = LogTransfer(link, message.id, log, message.ofs, end)

    def _busy(self) -> bool:
        if self._transfer is None:
            return False
        self._vehicle.say(mavlink.MAV_SEVERITY_INFO, "Log download in progress")
        return True

    def _end(self, link: PeerLink, message: Any) -> None:
        self._transfer = None

    def _erase(self, link: PeerLink, message: Any) -> None:
        self._end(link, message)
        self._dataflash.erase()

    def _send_entry(self, listing: Listing) -> None:
        number = listing.next
        log = self._dataflash.logs[number - 1] if number else StoredLog(0, b"")
        listing.link.send(
            mavlink.MAVLink_log_entry_message(number, listing.count, listing.last, log.began, len(log.data))
        )
        listing.next += 1
        if listing.next > listing.last:
            self._transfer = None

    def _send_piece(self, sending: LogTransfer) -> None:
        start = sending.next
        piece = sending.log.data[start : min(start + PIECE, sending.end)]
        data = list(piece.ljust(PIECE, b"\0"))
        sending.link.send(mavlink.MAVLink_log_data_message(sending.id, start, len(piece), data))
        sending.next += len(piece)
        if len(piece) < PIECE or sending.next == sending.end:
            self._transfer = None
