"""The folder of flights: a file each, and beside it what is known of it (JSON). Blocking: for a thread."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
import time
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mavproxy_uavapi import __version__
from mavproxy_uavapi.core.errors import Busy, NotFound
from mavproxy_uavapi.flights.flight_file import MODE, FlightFile, claimed, metadata_of, pack

FOLDER_MODE = 0o700
RECORDING, ENDED, COMPLETE = "recording", "ended", "complete"  # the states of a record
ID = re.compile(r"[0-9]{8}-[0-9]{6}-[a-z0-9-]{1,60}")
BLOCK = 1 << 20  # bytes
LONGEST_SLUG = 40


@dataclass(frozen=True)
class Flight:
    """What is known of a flight.

    Attributes:
        id: names its file; begins with the UTC of its beginning.
        name: as somebody gave it; empty for the flight of one vehicle from arming to disarming.
        notes: as somebody gave them.
        vehicles: system ids.
        began: UTC, ISO 8601.
        ended: the same; empty while it lasts, or if the program ended before it.
        state: `recording`; `ended`: it is being packed; `complete`.
        messages: of the file.
        lost: messages that came faster than they could be written.
        bytes: size of the file.
        sha256: of the complete file.
        version: of the program that wrote it.
        versions: of the program, MAVProxy and each vehicle's autopilot, as far as they are known.
        files: the SHA-256 of each attached file, by its name.
    """

    id: str
    name: str
    notes: str
    vehicles: tuple[int, ...]
    began: str
    ended: str = ""
    state: str = RECORDING
    messages: int = 0
    lost: int = 0
    bytes: int = 0
    sha256: str = ""
    version: str = field(default=__version__)
    versions: dict[str, str] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)

    def about(self) -> dict[str, str]:
        """What its own file says of it."""
        own = ("id", "name", "notes", "began", "ended", "version")
        vehicles = ",".join(map(str, self.vehicles))
        return {"vehicles": vehicles, **{name: str(getattr(self, name)) for name in own}}


def utc(seconds: float, form: str = "%Y-%m-%dT%H:%M:%S+00:00") -> str:
    """A time in s since 1970, UTC."""
    return time.strftime(form, time.gmtime(seconds))


def _slug(words: str) -> str:
    """The words as a part of a file's name."""
    ascii_only = unicodedata.normalize("NFKD", words).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", ascii_only)[:LONGEST_SLUG].strip("-") or "flight"


@dataclass(frozen=True)
class FlightStore:
    """The flights of this machine.

    Attributes:
        folder: where they are.
    """

    folder: Path

    def begin(
        self,
        vehicles: Sequence[int],
        now: float,
        name: str = "",
        notes: str = "",
        versions: Mapping[str, str] = MappingProxyType({}),
    ) -> tuple[Flight, FlightFile]:
        """Make the file of a flight that begins `now` (s since 1970); the rest as `Flight` has it.

        Raises:
            OSError: the disk refuses.
        """
        self.folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        stem = f"{utc(now, '%Y%m%d-%H%M%S')}-{_slug(name or 'vehicle' + '-'.join(map(str, vehicles)))}"
        names = (stem if number == 1 else f"{stem}-{number}" for number in itertools.count(1))
        flight_id = next(one for one in names if not self._about(one).exists())
        flight = Flight(flight_id, name, notes, tuple(vehicles), utc(now), versions=dict(versions))
        file = FlightFile(self._journal(flight_id))
        try:
            file.note("versions", flight.versions)
            self.save(flight)
        except OSError:
            file.abandon()
            self._journal(flight_id).unlink(missing_ok=True)
            raise
        return flight, file

    @contextmanager
    def making(self, now: float, name: str) -> Iterator[tuple[Flight, FlightFile]]:
        """Make a flight of what is there already; nothing is left of it if that fails. See `begin`."""
        flight, file = self.begin([], now, name)
        try:
            yield flight, file
        except BaseException:
            file.abandon()
            self.remove(flight)
            raise

    def finish(self, flight: Flight, file: FlightFile) -> None:
        """End the file of a flight that was begun here, with what is known of it now."""
        file.close(flight.about())
        self.save(replace(flight, state=ENDED))

    def save(self, flight: Flight) -> None:
        """Keep what is known of a flight."""
        path = self._about(flight.id)
        partial = path.with_suffix(".json.new")
        partial.touch(MODE)
        partial.write_text(json.dumps(asdict(flight), indent=1), encoding="utf-8")
        partial.replace(path)

    def all(self) -> list[Flight]:
        """The flights, the newest first."""
        names = sorted((path.name[: -len(".json")] for path in self.folder.glob("*.json")), reverse=True)
        return [flight for name in names if (flight := self._read(name)) is not None]

    def find(self, name: str) -> Flight:
        """One flight.

        Raises:
            NotFound: there is none of that id.
        """
        flight = self._read(name) if ID.fullmatch(name) else None
        if flight is None:
            raise NotFound(f"there is no flight {name[:80]!r}")
        return flight

    def file(self, flight: Flight) -> Path:
        """Its file: complete, or what is written of it yet."""
        complete = self._complete(flight.id)
        return complete if complete.exists() else self._journal(flight.id)

    def pack(self, name: str) -> Flight:
        """Compress a flight that has ended, and remove its journal. Takes long: for a process of its own.

        Raises:
            Busy: somebody writes it.
            NotFound: there is none of that id.
            OSError: the disk refuses.
        """
        flight, journal, target = self.find(name), self._journal(name), self._complete(name)
        if not journal.exists():
            return flight
        with claimed(journal) as is_ours:
            if not is_ours:
                raise Busy(f"flight {name} is being written")
            messages = pack(journal, target, flight.about())
            with target.open("rb") as file:
                digest = hashlib.sha256()
                while block := file.read(BLOCK):
                    digest.update(block)
            size = target.stat().st_size
            known = metadata_of(target)
            flight = replace(flight, versions=known.get("versions", {}), files=known["manifest"])
            flight = replace(flight, state=COMPLETE, messages=messages, bytes=size, sha256=digest.hexdigest())
            self.save(flight)
            journal.unlink()
        return flight

    def unpacked(self) -> list[str]:
        """The flights whose file is a journal that nobody writes."""
        names = (path.name[: -len(".journal")] for path in self.folder.glob("*.journal"))
        return sorted(name for name in names if ID.fullmatch(name) and not self._is_written(name))

    def remove(self, flight: Flight) -> None:
        """Delete a flight.

        Raises:
            Busy: somebody writes it.
        """
        if self._is_written(flight.id):
            raise Busy(f"flight {flight.id} is being written")
        for path in (self._journal(flight.id), self._complete(flight.id), self._about(flight.id)):
            path.unlink(missing_ok=True)

    def _is_written(self, name: str) -> bool:
        """Whether somebody, perhaps another MAVProxy, writes or packs its journal."""
        with suppress(FileNotFoundError), claimed(self._journal(name)) as is_ours:
            return not is_ours
        return False

    def make_room(self, quota: int) -> list[Flight]:
        """Delete the oldest flights until all together have no more than so many bytes; returns these."""
        kept, removed = 0, []
        for flight in self.all():
            kept += self._size(flight)
            if kept > quota and flight.state == COMPLETE:
                self.remove(flight)
                removed.append(flight)
        return removed

    def _size(self, flight: Flight) -> int:
        with suppress(OSError):
            return self.file(flight).stat().st_size
        return 0

    def _read(self, name: str) -> Flight | None:
        try:
            known: dict[str, Any] = json.loads(self._about(name).read_text(encoding="utf-8"))
            flight = Flight(**{**known, "vehicles": tuple(known["vehicles"])})
        except (OSError, ValueError, TypeError, KeyError):
            return None
        return flight if flight.id == name else None

    def _journal(self, name: str) -> Path:
        return self.folder / f"{name}.journal"

    def _complete(self, name: str) -> Path:
        return self.folder / f"{name}.mcap"

    def _about(self, name: str) -> Path:
        return self.folder / f"{name}.json"
