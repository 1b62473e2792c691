"""A flight that is being recorded: what has come and waits for the disk, and what else belongs to it."""

from __future__ import annotations

import asyncio
import hashlib
import time
from dataclasses import dataclass, field, replace

from mavproxy_uavapi.core.airspace import formats
from mavproxy_uavapi.core.airspace.store import ALL
from mavproxy_uavapi.core.geotag import Geotag
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.mission.mission_files import MissionItem
from mavproxy_uavapi.core.mission.mission_watch import wpl
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.flights.flight_file import TRAIL, FlightFile, FlightMessage
from mavproxy_uavapi.flights.flight_store import Flight, utc
from mavproxy_uavapi.flights.topics import Topics, of_picture
from mavproxy_uavapi.http.contract.responses import dumps
from mavproxy_uavapi.http.stream.stream_event import Event, When, of_info

BEFORE = 10.0  # s before a beginning from which the trail is in the record
MOST_PICTURE, MOST_PENDING = 16_000_000, 64_000_000  # bytes of a picture, and of those that wait for the disk
MOST_MISSIONS = 100  # of a record
TEXT, GEOJSON = "text/plain", "application/geo+json"

AttachedFile = tuple[str, str, bytes]  # name, media type, what is in it


@dataclass
class FlightRecord:
    """See the module's text. Asyncio thread only, but for `write`."""

    flight: Flight
    file: FlightFile
    began_at: float  # s since 1970
    topics: Topics = field(default_factory=Topics)
    pending: list[FlightMessage] = field(default_factory=list)
    attachments: list[AttachedFile] = field(default_factory=list)
    pictures: list[tuple[int, Geotag, bytes]] = field(default_factory=list)
    parameters: dict[int, bytes] = field(default_factory=dict)  # by system: as they were attached last
    missions: dict[int, list[MissionItem]] = field(default_factory=dict)  # the same
    digests: dict[str, str] = field(default_factory=dict)  # of the missions, by the names of their files
    mission_count: int = 0
    messages: int = 0
    quiet_since: float | None = None  # since when its vehicle is disarmed, or not heard (s)
    is_over: bool = False
    ended: asyncio.Event = field(default_factory=asyncio.Event)  # its file is closed, or abandoned

    @property
    def since(self) -> float:
        """s since 1970: what is older is no part of it."""
        return self.began_at - BEFORE

    def take(self, event: Event) -> None:
        """Keep an event that is of it."""
        if event.at.time >= self.since and event.system in (0, *self.flight.vehicles):
            self.pending += self.topics.records(event)

    def take_picture(self, system: int, tag: Geotag, jpeg: bytes) -> None:
        """Keep a picture of one of its vehicles (0: of nobody knows which), unless too much waits for the disk."""
        waiting = sum(len(picture) for _, _, picture in self.pictures)
        if system and system not in self.flight.vehicles:
            return
        if len(jpeg) > MOST_PICTURE or waiting + len(jpeg) > MOST_PENDING:
            self.lose(1)
        else:
            self.pictures.append((system, tag, jpeg))

    def lose(self, count: int) -> None:
        """Count what is not in it."""
        self.flight = replace(self.flight, lost=self.flight.lost + count)

    def attach_what_is_known(self, host: Host) -> None:
        """Attach parameters, missions and envelopes, and the trail of the last moments."""
        self.attach_parameters(host, "parameters")
        self.attach_missions(host)
        for number, (key, space) in enumerate(host.envelopes.all(), 1):
            if key.system in (ALL, *self.flight.vehicles) and not space.missing:
                areas = dumps(formats.geojson(space.envelope)).encode()
                self.attachments.append((f"envelope-{number}.geojson", GEOJSON, areas))
        since = utc(self.since, "%Y-%m-%dT%H:%M:%S")
        for entry in list(host.audit.newest):
            if entry.time >= since and entry.system in (0, *self.flight.vehicles):
                at = When(time.time(), host.clock())
                self.pending += self.topics.records(of_info("event", TRAIL, entry.system, at, entry.report()))

    def attach_parameters(self, host: Host, name: str) -> None:
        """Attach the parameters of its vehicles that have changed since they were attached last."""
        for system in self.flight.vehicles:
            state = host.fleet.vehicles.get(system)
            known = {} if state is None else state.parameters
            text = "".join(f"{parameter} {known[parameter]:.9g}\n" for parameter in sorted(known)).encode()
            if text and self.parameters.get(system) != text:
                self.parameters[system] = text
                self.attachments.append((f"{name}-{system}.param", TEXT, text))

    def attach_missions(self, host: Host) -> None:
        """Attach the missions of its vehicles that have changed since they were attached last."""
        for system in self.flight.vehicles:
            items = host.missions.newest.get(system, [])
            if items != self.missions.get(system, []) and self.mission_count < MOST_MISSIONS:
                self.missions[system] = items
                self.mission_count += 1
                name = f"mission-{system}-{self.mission_count}.waypoints"
                self.attachments.append((name, TEXT, wpl(items).encode()))
                self.digests[name] = rehearsals.digest_of_mission(items[1:])

    def rehearsed(self) -> list[AttachedFile]:
        """The newest rehearsals of its missions, each by its file's name. Blocking."""
        found = ((name, rehearsals.find(digest)) for name, digest in self.digests.items())
        return [(f"rehearsal-{name}.json", rehearsals.KIND, report) for name, report in found if report]

    def write(self) -> None:
        """Bring what is pending to the disk. Blocking."""
        pending, self.pending = self.pending, []
        attachments, self.attachments = self.attachments, []
        pictures, self.pictures = self.pictures, []
        for name, kind, data in attachments:
            self.file.attach(name, kind, data, time.time_ns())
            self.flight.files[name] = hashlib.sha256(data).hexdigest()
        for picture in pictures:
            pending += of_picture(*picture)
        self.messages += len(pending)
        self.file.write(pending)
