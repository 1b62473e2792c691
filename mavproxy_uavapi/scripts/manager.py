"""The scripts of one API: upload, execute, watch, stop. Files are read in an executor, never on the loop."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import logging
import os
import signal
import sys
import time
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

from mavproxy_uavapi.core.errors import BadRequest, NoVehicle, ToolFailed
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.host import Host
from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.core.timeout import kept
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.files.tokens import SCRIPT, Token, digest_of, new_token
from mavproxy_uavapi.scripts import aerpaw, clients, names, on_exit, runner, runs, tmux
from mavproxy_uavapi.scripts.runs import Run
from mavproxy_uavapi.scripts.store import ScriptStore
from mavproxy_uavapi.settings import ApiSettings

log = logging.getLogger("uavapi.script")

LOOK_EVERY = 0.25  # s between looks at a running script's lock and record, because files do not signal changes
DIES_AT_ONCE = 0.5  # s in which a script that cannot even begin (a wrong import) has mostly ended
START_TIMEOUT = 10.0  # s until the runner must have started the script
PRINTED = 1_000_000  # bytes of each log of a script in the record of a flight, from its end
PRINTED_BY = "script-"  # begins the names of these
LOOPBACK = ("localhost", "127.0.0.1", "::1")


class Scripts:
    """The scripts of the API: stored files and runs. A script goes on when the API ends; the next API finds it again.

    Attributes:
        settings: the snapshot in force.

    Args:
        host: the vehicles that they fly.
        settings: the snapshot in force.
    """

    def __init__(self, host: Host, settings: ApiSettings) -> None:
        self._host = host
        self.renew(settings)
        self._watched: dict[str, Run] = {}
        self._tasks = HeldTasks()
        self._watches: dict[str, asyncio.Task[None]] = {}  # by session
        self._launching = asyncio.Lock()
        self._trusted: dict[str, Run] = {}  # by session: those that have begun, from before their first call

    def renew(self, settings: ApiSettings) -> None:
        """Use other settings. Running scripts go on as they were started."""
        self.settings = settings
        self.store = ScriptStore(
            Path(settings.scripts_path).expanduser().absolute(),
            settings.script_size * 1024,
            settings.script_quota * 1024 * 1024,
        )
        self.logs = Path(settings.script_logs).expanduser().absolute()

    # -- life ---------------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Find the running scripts of an earlier API on this port, whichever vehicle it flew, by their sessions."""
        try:
            records = await tmux.sessions(names.SESSIONS)
        except ToolFailed as error:
            log.info("%s", error)  # execute will say so too
            return
        for session, record in records.items():
            if record is None or session in self._watched:
                continue
            try:
                run = await asyncio.to_thread(runs.load, record)
            except (OSError, ValueError) as error:
                log.warning("session %s has no readable record: %s", session, error)
                continue
            if run.running and run.port == self.settings.port:
                log.info("%s still runs in session %s", run.script, session)
                self._watch(run)

    async def stop(self) -> None:
        """Stop watching. The scripts go on."""
        await self._tasks.end()

    # -- verbs --------------------------------------------------------------------------------------------

    async def save(self, name: str, data: bytes) -> Path:
        """As `Store.save`.

        Raises:
            BadRequest: see there.
            ToolFailed: the folder cannot be written to.
        """
        try:
            return await asyncio.to_thread(self.store.save, name, data)
        except OSError as error:
            raise ToolFailed(f"cannot save {name} in {self.store.folder}: {error.strerror}") from error

    async def execute(
        self, name: str, args: Sequence[str], operator: str = "", system: int = 0, content: bytes | None = None
    ) -> Run:
        """Start a script in its own session; returns when it has run for DIES_AT_ONCE s, or has ended before.

        Args:
            name: of the uploaded file.
            args: its command-line arguments.
            operator: in whose name it calls.
            system: the vehicle whose API it finds in UAVAPI_URL; 0: that of this API.
            content: what runs in its name, from a copy, whatever the file holds by now; None for the file.

        Raises:
            BadRequest: it is already running, or `name` is not a valid script name.
            NotFound: no such script.
            ToolFailed: there is no tmux, or the script could not be started; nothing is left behind.
        """
        path = await asyncio.to_thread(self.store.find, name)
        if content is not None:
            path = await self._copied(path.name, content)
        # A client that hangs up now leaves neither an unwatched script nor the lock: it may ask again at once.
        return await kept(self._launch_alone(path, args, operator, system))

    async def _copied(self, name: str, content: bytes) -> Path:
        """The script with these bytes, in a folder of its own beside the logs."""
        folder = self.logs / f"rehearsed-{rehearsals.digest_of(content)}"
        try:
            return await asyncio.to_thread(replace(self.store, folder=folder).save, name, content)
        except OSError as error:
            raise ToolFailed(f"cannot write {folder}: {error.strerror}") from error

    async def _launch_alone(self, path: Path, args: Sequence[str], operator: str, system: int) -> Run:
        async with self._launching:
            if self.running_run(path.name) is not None:
                raise BadRequest(f"{path.name} is already running")
            return await self._launch(path, args, operator, system)

    async def _launch(self, path: Path, args: Sequence[str], operator: str, system: int) -> Run:
        run = self._trusted_run(await self._create(path, args, operator, system))
        try:
            await tmux.start(run.session, [sys.executable, "-I", runner.__file__, str(run.path)], run.path)
            run = await self._started(run)
        except ToolFailed:
            await tmux.kill(run.session, run.path)
            self._trusted.pop(run.session, None)
            await asyncio.to_thread(runs.discard, run.path)
            raise
        self._watch(run)
        log.info("%s runs in session %s", run.script, run.session)
        return await self._begun(run)

    async def _begun(self, run: Run) -> Run:
        """The run after DIES_AT_ONCE s, or at its end."""
        until = time.monotonic() + DIES_AT_ONCE
        while run.running and time.monotonic() < until:
            await asyncio.sleep(0.05)
            run = await asyncio.to_thread(runs.refreshed, run)
        return run

    async def _create(self, path: Path, args: Sequence[str], operator: str, system: int) -> Run:
        token = new_token() if self.settings.tokens else ""
        try:
            command = await asyncio.to_thread(aerpaw.command_of, path, self.settings.python_path)
            return await asyncio.to_thread(
                runs.create,
                self.logs,
                path.name,
                args,
                self.sysid,
                command=[*command, *args],
                cwd=self.store.folder,
                port=self.settings.port,
                grace=self.settings.script_grace,
                environment=self.environment(token, system),
                operator=operator,
                token=digest_of(token.encode()).hex() if token else "",
            )
        except OSError as error:
            raise ToolFailed(f"cannot write logs in {self.logs}: {error.strerror}") from error

    async def _started(self, run: Run) -> Run:
        deadline = time.monotonic() + START_TIMEOUT
        while time.monotonic() < deadline:
            run = await asyncio.to_thread(runs.refreshed, run)
            if run.error is not None:
                raise ToolFailed(run.error)
            if run.pid is not None:
                return run
            await asyncio.sleep(0.05)
        raise ToolFailed(f"session {run.session} did not start {run.script} within {START_TIMEOUT:g} s")

    async def halt(self, name: str) -> Run:
        """Stop a script by Ctrl-C, then by a kill after the grace period; returns when it has ended.

        A client that hangs up does not change this.

        Raises:
            NotFound, BadRequest: no such script; it is not running.
        """
        script = names.resolved(name)
        run = self.running_run(script)
        if run is None:
            await asyncio.to_thread(self.store.find, name)
            raise BadRequest(f"{script} is not running")
        assert run.pid is not None
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            os.kill(run.pid, signal.SIGTERM)  # to its runner, which stops the script
        await kept(self._watches[run.session])
        return await asyncio.to_thread(runs.refreshed, run)

    async def running(self) -> list[Run]:
        """The scripts that run now, oldest first."""
        running = [await asyncio.to_thread(runs.refreshed, run) for run in list(self._watched.values())]
        return sorted((run for run in running if run.running), key=lambda run: run.started_at)

    def running_run(self, script: str) -> Run | None:
        """The running run of a script, as of the last look."""
        return next((run for run in self._watched.values() if run.script == script), None)

    async def newest(self, script: str) -> Run | None:
        """The newest run of a script, running or ended."""
        running = self.running_run(script)
        if running is not None:
            return await asyncio.to_thread(runs.refreshed, running)
        script_runs = await asyncio.to_thread(runs.of_script, self.logs, script)
        return script_runs[0] if script_runs else None

    def printed(self, systems: Collection[int], since: float) -> list[tuple[str, str, bytes]]:
        """What the scripts of vehicles have printed that ran since then (s since 1970): name, media type, the end.

        With it the newest rehearsal of each that has the same bytes. Blocking.
        """
        found = []
        for run in runs.since(self.logs, since):
            if run.sysid in (0, *systems):
                for path in (run.out_log, run.err_log):
                    text = runs.tail(path, PRINTED)
                    if text:
                        found.append((f"{PRINTED_BY}{path.name}", "text/plain", text.encode()))
                with contextlib.suppress(OSError):  # the script has been deleted
                    report = rehearsals.find(rehearsals.digest_of((self.store.folder / run.script).read_bytes()))
                    if report is not None:
                        # it has the output of the rehearsed script: for whoever may read that of this one
                        found.append((f"{PRINTED_BY}rehearsal-{run.script}.json", rehearsals.KIND, report))
        return found

    async def session_of(self, peer: tuple[str, int] | None) -> str | None:
        """The session of the script whose connection a request came by, from the client's end of it; else None."""
        running = list(self._watched.values())
        if peer is None or not running:
            return None
        return await asyncio.to_thread(clients.session_of, *peer, running)

    # -- the scripts' environment -------------------------------------------------------------------------

    @property
    def sysid(self) -> int:
        """The vehicle's system id; 0 while no vehicle is known and none is set."""
        try:
            return self._host.registry.find(self.settings.sysid).state.system
        except NoVehicle:
            return self.settings.sysid

    def environment(self, token: str = "", system: int = 0) -> dict[str, str]:
        """Our own environment, and the variables by which a script reaches the API, by that token and no proxy."""
        url = self.settings.local_url
        return {
            **os.environ,
            **dict.fromkeys(("NO_PROXY", "no_proxy"), self._not_by_proxy()),
            "PYTHONUNBUFFERED": "1",  # so that its output reaches the logs and the session at once
            "UAVAPI_URL": f"{url}/vehicles/{system}" if system else url,
            "UAVAPI_TOKEN": token or self.settings.token,
            "UAVAPI_SYSID": str(system or self.sysid),
        }

    def _not_by_proxy(self) -> str:
        """The hosts that programs reach without a proxy: those of our own environment, and the API's."""
        own = os.environ.get("no_proxy") or os.environ.get("NO_PROXY", "")
        return ",".join(filter(None, [own, urlsplit(self.settings.local_url).hostname, *LOOPBACK]))

    def token_of(self, digest: bytes) -> Token | None:
        """The token with that hash, if a script that runs has it: that of an admin, because scripts run as us."""
        for run in self._trusted.values():
            if run.token and hmac.compare_digest(digest.hex().encode(), run.token.encode()):
                return Token(f"{run.operator}{SCRIPT}{names.stem(run.script)}", Role.ADMIN, frozenset(), digest)
        return None

    def _trusted_run(self, run: Run) -> Run:
        self._trusted[run.session] = run
        return run

    # -- watching -----------------------------------------------------------------------------------------

    def _watch(self, run: Run) -> None:
        self._watched[run.session] = self._trusted_run(run)
        self._watches[run.session] = self._tasks.start(self._until_ended(run), f"the watch over {run.script}")

    async def _until_ended(self, run: Run) -> None:
        try:
            while run.running:
                await asyncio.sleep(LOOK_EVERY)
                run = await asyncio.to_thread(runs.refreshed, run)
                self._watched[run.session] = run
        finally:
            self._watched.pop(run.session, None)
            self._trusted.pop(run.session, None)
            self._watches.pop(run.session, None)
        log.info("%s ended with status %s", run.script, run.exit_status)
        if run.died:
            self._tasks.start(self._after_death(run), f"what follows the death of {run.script}")

    async def _after_death(self, run: Run) -> None:
        others = [other.script for other in self._watched.values() if other.sysid in (0, run.sysid)]
        done = await on_exit.after_death(self._host, run.sysid or self.settings.sysid, run, others)
        log.warning("%s died (status %s): %s", run.script, run.exit_status, done)
