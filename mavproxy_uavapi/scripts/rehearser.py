"""Rehearsals on the vehicle's own machine: `mavproxy-uavapi run --like` asks our own API, one at a time.

It runs beside the API with the lowest share of the processor, so that what is forwarded does not wait. What was
rehearsed well counts for the same bytes and arguments, in the same envelope, with the same parameters where these
decide where a vehicle flies.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mavproxy_uavapi.core.airspace.guard import decides_where
from mavproxy_uavapi.core.errors import Busy, NotRehearsed, UavApiError
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.files.tokens import Token, digest_of, new_token
from mavproxy_uavapi.programs.program import run_tool
from mavproxy_uavapi.scripts.manager import Scripts

RUN = [sys.executable, "-c", "from mavproxy_uavapi.commands import main; raise SystemExit(main())", "run"]
POLITE = ["prlimit", f"--data={3 * 1024**3}", "nice", "-n", "15"]  # bytes of each process
LONGEST = 900.0  # s; an hour's flight at four times real time
SAID = 500  # characters of what it printed, where it was not flown
WELL, NOT_FLOWN = 0, 3  # exit status
REQUIRE, OFF = "require", "off"


class File(NamedTuple):
    """What is rehearsed: a name, whose ending says what it is, its bytes, the digest that names it, its arguments."""

    name: str
    content: bytes
    digest: str
    args: tuple[str, ...]

    @classmethod
    def of_request(cls, path: str, body: Mapping[str, Any], settings: Mapping[str, Any]) -> File:
        """As `rehearsals.request_file`."""
        content = rehearsals.request_file(path, body, settings)
        return cls(f"{path.strip('/').replace('/', '-')}.json", content, rehearsals.digest_of(content), ())


class Conditions(NamedTuple):
    """What decides where a vehicle flies: parameters, its envelopes in words, a script's arguments."""

    parameters: dict[str, float]
    envelopes: list[str]
    args: list[str]

    @classmethod
    def of(cls, vehicle: Vehicle, args: Sequence[str]) -> Conditions:
        """Those of now."""
        known = vehicle.state.parameters.items()
        parameters = {name: value for name, value in known if decides_where(name)}
        return cls(parameters, [repr(space.envelope) for space in vehicle.guard.check.spaces], list(args))

    def fit(self, earlier: Conditions) -> bool:
        """Whether they are as they were; a parameter that was not known then does not count."""
        return earlier.parameters.items() <= self.parameters.items() and self[1:] == earlier[1:]


class RehearsalReport(NamedTuple):
    """What came of a rehearsal: the file's name, the report of `run` from its JSON, or why there is none."""

    name: str
    report: dict[str, Any] | None
    failure: str


class Rehearser:
    """Rehearses what an API's vehicles are about to fly, one at a time, and says what was not rehearsed.

    Attributes:
        under_way: the name of the file that is rehearsed now; "" for none.
        newest: what came of the one before; None before the first.

    Args:
        host: whom to warn.
        scripts: whose environment a rehearsal has.
    """

    def __init__(self, host: Host, scripts: Scripts) -> None:
        self._host, self._scripts = host, scripts
        self.under_way = ""
        self.newest: RehearsalReport | None = None
        self._token = b""  # the digest of the one by which it asks the API
        self._tasks = HeldTasks()

    def token_of(self, digest: bytes) -> Token | None:
        """The token with that hash, if the rehearsal under way has it: it may watch."""
        is_ours = self._token and hmac.compare_digest(digest, self._token)
        return Token("rehearsal", Role.WATCH, frozenset(), digest) if is_ours else None

    def begin(self, vehicle: Vehicle, file: File, options: Sequence[str]) -> None:
        """Begin to fly a file on an embedded vehicle that is as `vehicle` is now; `options` are those of `run`.

        Raises:
            Busy: another one is under way.
        """
        if self.under_way:
            raise Busy(f"{self.under_way} is being rehearsed; one at a time")
        self.under_way = file.name
        self._task = self._tasks.start(self._fly(vehicle, file, options), f"the rehearsal of {file.name}")

    async def ended(self) -> None:
        """Wait until none is under way."""
        if self.under_way:
            await asyncio.wait({self._task})

    async def end(self) -> None:
        """End the one under way; nothing comes of it."""
        await self._tasks.end()
        self.under_way = ""  # it may not have begun

    async def _fly(self, vehicle: Vehicle, file: File, options: Sequence[str]) -> None:
        token = new_token()
        self._token = digest_of(token.encode())
        folder = Path(tempfile.mkdtemp(prefix="uavapi-rehearsal-"))
        try:
            path, report = folder / file.name, folder / "report.json"
            await asyncio.to_thread(path.write_bytes, file.content)
            environment = self._scripts.environment(token, vehicle.state.system)
            like = [f"--like={environment['UAVAPI_URL']}", f"--report={report}"]
            like.append(f"--python={self._scripts.settings.python_path}")
            like += [f"--mavlink-port={port}" for port in self._host.mavlink_ports]
            command = [*POLITE, *RUN, str(path), *like, *options, "--", *file.args]
            began_in = Conditions.of(vehicle, file.args)
            done = await run_tool(command, LONGEST, folder, environment)
            conditions = Conditions.of(vehicle, file.args)  # of which MAVProxy may know more by now
            text = "null" if done.status == NOT_FLOWN else await asyncio.to_thread(report.read_bytes)
            told = json.loads(text)
            if done.status == WELL and conditions.fit(began_in) and not told["flights"][0]["faults"]:
                await asyncio.to_thread(rehearsals.vouch, file.digest, json.dumps(conditions))
            self.newest = RehearsalReport(file.name, told, (done.stderr or done.stdout).strip()[-SAID:])
        except (UavApiError, OSError) as error:
            self.newest = RehearsalReport(file.name, None, str(error))
        finally:
            self.under_way, self._token = "", b""
            await asyncio.to_thread(shutil.rmtree, folder, ignore_errors=True)

    def require(self, vehicle: Vehicle | None, what: str, digest: str, args: Sequence[str] = ()) -> None:
        """Raise NotRehearsed, or warn, unless what has that digest was rehearsed well for that vehicle. Blocking."""
        wish = self._scripts.settings.rehearse
        if wish == OFF:
            return
        vouched = rehearsals.vouched(digest)
        if vehicle and vouched and Conditions.of(vehicle, args).fit(Conditions(*json.loads(vouched))):
            return
        sentence = f"{what} was not rehearsed as it is, in this envelope with these parameters: POST /rehearsals does"
        if wish == REQUIRE:
            raise NotRehearsed(sentence)
        self._host.warn(sentence)
