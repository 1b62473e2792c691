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
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mavproxy_uavapi.core.airspace.guard import PROTECTED
from mavproxy_uavapi.core.errors import Busy, NotRehearsed, ToolFailed
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
WELL, NOT_FLOWN = 0, 3
REQUIRE, OFF = "require", "off"


class File(NamedTuple):
    """What is rehearsed: a name, whose ending says what it is, its bytes, the digest that names it, its arguments."""

    name: str
    content: bytes
    digest: str
    args: tuple[str, ...]


class Rehearser:
    """Rehearses what an API's vehicles are about to fly, and says what was not rehearsed.

    Args:
        host: whom to warn.
        scripts: whose environment a rehearsal has.
    """

    def __init__(self, host: Host, scripts: Scripts) -> None:
        self._host, self._scripts = host, scripts
        self._under_way = ""
        self._token = b""  # the digest of the one by which it asks the API

    def token_of(self, digest: bytes) -> Token | None:
        """The token with that hash, if the rehearsal under way has it: it may watch."""
        is_ours = self._token and hmac.compare_digest(digest, self._token)
        return Token("rehearsal", Role.WATCH, frozenset(), digest) if is_ours else None

    async def fly(self, vehicle: Vehicle, file: File, options: Sequence[str]) -> dict[str, Any]:
        """Fly a file on an embedded vehicle that is as `vehicle` is now; the report of `run`, from its JSON.

        Raises:
            Busy: another one is under way.
            ToolFailed: it could not be flown.
            ToolMissing, TimedOut: as `run_tool`.
        """
        if self._under_way:
            raise Busy(f"{self._under_way} is being rehearsed; one at a time")
        self._under_way = file.name
        token = new_token()
        self._token = digest_of(token.encode())
        folder = Path(await asyncio.to_thread(tempfile.mkdtemp, prefix="uavapi-rehearsal-"))
        try:
            path, report = folder / file.name, folder / "report.json"
            await asyncio.to_thread(path.write_bytes, file.content)
            environment = self._scripts.environment(token, vehicle.state.system)
            like = [f"--like={environment['UAVAPI_URL']}", f"--report={report}"]
            command = [*POLITE, *RUN, str(path), *like, *options, "--", *file.args]
            began_in = conditions_of(vehicle, file.args)
            outcome = await run_tool(command, LONGEST, folder, environment)
            if outcome.status == NOT_FLOWN or not report.exists():
                raise ToolFailed(
                    f"{file.name} was not rehearsed: {(outcome.stderr or outcome.stdout).strip()[-500:]}"
                )
            if outcome.status == WELL and conditions_of(vehicle, file.args) == began_in:
                await asyncio.to_thread(rehearsals.vouch, file.digest, began_in)
            found: dict[str, Any] = json.loads(await asyncio.to_thread(report.read_bytes))
            return found
        finally:
            self._under_way, self._token = "", b""
            await asyncio.to_thread(shutil.rmtree, folder, ignore_errors=True)

    def require(self, vehicle: Vehicle, what: str, digest: str, args: Sequence[str] = ()) -> None:
        """Raise NotRehearsed, or warn, unless what has that digest was rehearsed well: the setting. Blocking."""
        wish = self._scripts.settings.rehearse
        if wish == OFF or rehearsals.vouched(digest) == conditions_of(vehicle, args):
            return
        sentence = f"{what} was not rehearsed as it is, in this envelope with these parameters: POST /rehearsals does"
        if wish == REQUIRE:
            raise NotRehearsed(sentence)
        self._host.warn(sentence)


def conditions_of(vehicle: Vehicle, args: Sequence[str]) -> str:
    """A digest of what decides where the vehicle flies: its envelopes, its parameters, a script's arguments."""
    parameters = {name: value for name, value in vehicle.state.parameters.items() if name.startswith(PROTECTED)}
    envelopes = [repr(space.envelope) for space in vehicle.guard.check.spaces]
    return rehearsals.digest_of(json.dumps([sorted(parameters.items()), envelopes, list(args)]).encode())
