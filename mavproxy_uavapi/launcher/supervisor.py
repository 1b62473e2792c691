"""Starts the processes of a run, waits for the first one to end or for a signal, and ends them all."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
import uuid
from asyncio.subprocess import DEVNULL, PIPE, STDOUT, Process
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from mavproxy_uavapi.core.addresses import is_loopback, urls_of
from mavproxy_uavapi.core.terminal import say, say_text
from mavproxy_uavapi.launcher import command_lines, environment, processes
from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.launcher.fleet import SimulatedVehicle
from mavproxy_uavapi.launcher.options import RunOptions
from mavproxy_uavapi.launcher.probe import answers

VEHICLE_START_S = 30.0
API_START_S = 90.0

# The unload of our modules ends the verbs in flight, each with its last messages to the vehicle, and closes what
# vision and gradys have open. Uploaded scripts go on.
MAVPROXY_GRACE_S = 15.0
MAVPROXY_FORCED_S = 2.0

# At its prompt MAVProxy notes a SIGTERM but then waits for a line; there is nothing to wait for.
PROMPT_GRACE_S = 1.0
VEHICLE_GRACE_S = 3.0
STRAY_GRACE_S = 1.0

# Two Ctrl-C at the prompt within this time also end the launcher.
INSIST_S = 3.0

_READY = b" listening on "
_UNLOADING = b"Unloading module "
_API_FAILED = ("Failed to load module: ", "ERROR in command ", "uavapi: cannot listen on ")
_DEBUG_HINT = " Use 'set moddebug"


class Supervisor:
    """One run: a MAVProxy, the simulated vehicles if any, and the watchdog.

    Args:
        options: what to start.
        run_dir: where their logs go.
        vehicles: the simulated ones.
    """

    def __init__(self, options: RunOptions, run_dir: Path, vehicles: Sequence[SimulatedVehicle]) -> None:
        self.options = options
        self.url = command_lines.api_url(options)
        self.run_dir = run_dir
        self.simulated = vehicles
        self.tag = uuid.uuid4().hex
        self.sessions: set[int] = set()
        self.watchdog: Process | None = None
        self.vehicles: dict[Process, SimulatedVehicle] = {}  # the running ones
        self.mavproxy: Process | None = None
        self.came_up = False
        self.interrupted_at = -INSIST_S
        self.stop = asyncio.Event()
        self.hurry = asyncio.Event()

    async def run(self) -> int:
        """Run from start to end.

        Returns:
            The exit status: 0 if a signal to us or the user at the prompt ended the run.

        Raises:
            LaunchError: something did not start, or ended by itself.
        """
        self._watch_signals()
        work = asyncio.create_task(self._work())
        stop = asyncio.create_task(self.stop.wait())
        try:
            await asyncio.wait({work, stop}, return_when=asyncio.FIRST_COMPLETED)
            return work.result() if work.done() else 0
        finally:
            for task in (work, stop):
                task.cancel()
            await asyncio.wait({work, stop})
            await self._end()

    # Signals

    def _watch_signals(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return  # signals are the main thread's
        loop = asyncio.get_running_loop()
        for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            # nohup and shells ignore a signal on purpose; it stays ignored.
            if signal.getsignal(signum) is not signal.SIG_IGN:
                loop.add_signal_handler(signum, self._on_signal, signum)

    def _on_signal(self, signum: signal.Signals) -> None:
        if self.stop.is_set():
            self.hurry.set()
        elif signum == signal.SIGINT and self._mavproxy_has_terminal():
            # The terminal also sent it to MAVProxy, which may be set to stay (`set requireexit`).
            now = asyncio.get_running_loop().time()
            if now - self.interrupted_at < INSIST_S:
                self.stop.set()
            self.interrupted_at = now
        else:
            self.stop.set()

    def _mavproxy_has_terminal(self) -> bool:
        return not self.options.headless and self.mavproxy is not None and self.mavproxy.returncode is None

    # Starting and waiting

    async def _work(self) -> int:
        await self._start_watchdog()
        for vehicle in self.simulated:
            await self._start_vehicle(vehicle)
        if self.options.ardupilot_path is None:
            for process, vehicle in self.vehicles.items():
                await self._vehicle_ready(process, self.log_of(vehicle))
        await self._start_mavproxy()
        assert self.mavproxy is not None
        ends = {asyncio.create_task(self.mavproxy.wait()), asyncio.create_task(self._all_vehicles_ended())}
        announced = asyncio.create_task(self._announce())
        waiting = ends | {announced}
        try:
            while not any(task.done() for task in ends):
                done, waiting = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
                if announced in done:
                    announced.result()
        finally:
            for task in waiting:
                task.cancel()
        return self._verdict()

    async def _start_watchdog(self) -> None:
        self.watchdog = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "mavproxy_uavapi.launcher.watchdog", self.tag),
            stdin=PIPE,
            env=environment.for_python(os.environ),
            start_new_session=True,
        )

    async def _start_vehicle(self, vehicle: SimulatedVehicle) -> None:
        log = self.log_of(vehicle)
        if self.options.ardupilot_path is None:
            command = command_lines.embedded_command(self.options, vehicle, self.simulated)
            self.vehicles[await self._start(command, environment.for_python(os.environ), log.name)] = vehicle
        else:
            env = environment.for_sim_vehicle(os.environ, self.run_dir)
            command = command_lines.sim_vehicle_command(
                self.options, environment.ardupilot_python(), vehicle, self.run_dir / log.stem
            )
            self.vehicles[await self._start(command, env, log.name)] = vehicle

    def log_of(self, vehicle: SimulatedVehicle) -> Path:
        """What the vehicle prints."""
        return self.run_dir / ("vehicle.log" if len(self.simulated) == 1 else f"vehicle-{vehicle.sysid}.log")

    async def _all_vehicles_ended(self) -> None:
        """Wait until no simulated vehicle is left; report each that ends while others go on."""
        if not self.vehicles:
            await asyncio.Event().wait()

        async def ended(process: Process) -> Process:
            await process.wait()
            return process

        for end in asyncio.as_completed([ended(process) for process in self.vehicles]):
            vehicle = self.vehicles.pop(await end)
            if self.vehicles:
                log = self.log_of(vehicle)
                complain(f"vehicle {vehicle.sysid} ended, the others go on: {last_line(log)} (log: {log})")

    async def _vehicle_ready(self, process: Process, log: Path) -> None:
        """Wait for the line that the embedded vehicle prints when its port is open."""
        deadline = asyncio.get_running_loop().time() + VEHICLE_START_S
        while not has_logged(log, _READY):
            if process.returncode is not None:
                raise LaunchError(f"the vehicle did not start: {last_line(log)} (log: {log})")
            if asyncio.get_running_loop().time() > deadline:
                raise LaunchError(f"the vehicle was not ready within {VEHICLE_START_S:.0f} s (log: {log})")
            await asyncio.sleep(0.05)

    async def _start_mavproxy(self) -> None:
        config = None
        text = command_lines.settings_file(self.options)
        if text is not None:
            config = self.run_dir / "uavapi.ini"
            config.write_text(text, encoding="utf-8")
        command = command_lines.mavproxy_command(
            self.options, environment.mavproxy_program(), self.run_dir, self.simulated, config
        )
        # If components log to the console, MAVProxy's output belongs there too.
        to_file = self.options.headless and not self.options.log_console
        self.mavproxy = await self._start(
            command,
            environment.for_mavproxy(os.environ),
            "mavproxy.log" if to_file else None,
            own_terminal=not self.options.headless,
        )

    async def _start(
        self, command: Sequence[str], env: Mapping[str, str], log: str | None, own_terminal: bool = False
    ) -> Process:
        """Start a process of this run; one that owns the terminal stays in our session and process group."""
        output = None if log is None else (self.run_dir / log).open("wb")
        try:
            process = await asyncio.create_subprocess_exec(
                *command,
                stdin=None if own_terminal else DEVNULL,
                stdout=output,
                stderr=None if output is None else STDOUT,
                env={**env, processes.TAG: self.tag},
                start_new_session=not own_terminal,
            )
        finally:
            if output is not None:
                output.close()
        session = os.getsid(0) if own_terminal else process.pid
        self.sessions.add(session)
        assert self.watchdog is not None and self.watchdog.stdin is not None
        self.watchdog.stdin.write(f"{session}\n".encode())
        return process

    async def _announce(self) -> None:
        """Print the API's address when it answers.

        An API that does not answer ends the run of a simulation without a prompt, which nobody would look at. A
        vehicle keeps its MAVProxy: it may fly.

        Raises:
            LaunchError: the API does not answer, as above; or see `_check_api_loaded`.
        """
        deadline = asyncio.get_running_loop().time() + API_START_S
        status = await answers(self.url)
        while status is None or (status == 503 and self.options.simulated):
            self._check_api_loaded()
            if asyncio.get_running_loop().time() > deadline:
                failure = "does not answer" if status is None else "does not see the vehicle"
                problem = f"the API at {self.url} {failure} after {API_START_S:.0f} s (log: {self._where()})"
                if self.options.headless and self.options.simulated:
                    raise LaunchError(problem)
                complain(problem)
                return
            await asyncio.sleep(0.2)
            status = await answers(self.url)
        self.came_up = True
        with_token = bool(os.environ.get("UAVAPI_TOKEN"))
        say_text("\n" + command_lines.greeting(self.options, self.url, with_token, self._elsewhere()))

    def _elsewhere(self) -> list[str]:
        """The URLs by which other machines reach the API; none where it listens on this one only."""
        if is_loopback(self.options.host):
            return []
        tls = self.url.startswith("https")
        return [url for url in urls_of(self.options.host, self.options.port, tls=tls) if url != self.url]

    def _check_api_loaded(self) -> None:
        """Do not wait for the API if MAVProxy could not load its module; MAVProxy reports that and goes on.

        Raises:
            LaunchError: with MAVProxy's own text.
        """
        log = self.run_dir / "mavproxy.log"
        for line in read_lines(log) if log.exists() else []:
            if "uavapi" in line and any(words in line for words in _API_FAILED):
                raise LaunchError(f"{line.partition(_DEBUG_HINT)[0]} (log: {log})")

    def _where(self) -> str:
        log = self.run_dir / "mavproxy.log"
        return str(log) if log.exists() else "above"

    # The exit status

    def _verdict(self) -> int:
        """The exit status after a process has ended by itself.

        MAVProxy always exits with status 1. The shutdown was on purpose if its log says so or, at a prompt, if it had
        come up or was interrupted.

        Raises:
            LaunchError: the vehicle ended, or MAVProxy crashed or never came up.
        """
        assert self.mavproxy is not None
        status = self.mavproxy.returncode
        log = self.run_dir / "mavproxy.log"
        if status is None:
            vehicle_log = self.log_of(self.simulated[-1])
            raise LaunchError(f"the simulated vehicle ended: {last_line(vehicle_log)} (log: {vehicle_log})")
        if status < 0:
            complain(f"MAVProxy died of signal {-status} (log: {self._where()})")
            return 128 - status
        interrupted = self.interrupted_at > 0
        on_purpose = _UNLOADING in log.read_bytes() if log.exists() else self.came_up or interrupted
        if status > 1 or not on_purpose:
            reason = f": {last_line(log)}" if log.exists() else ""
            raise LaunchError(f"MAVProxy ended with status {status}{reason} (log: {self._where()})")
        return 0

    # Ending

    async def _end(self) -> None:
        """End the remaining processes, MAVProxy first: the vehicle must be there while it unloads its modules."""
        self.stop.set()
        if self.mavproxy is not None:
            await self._end_mavproxy(self.mavproxy)
        if self.vehicles:
            pids = {process.pid for process in self.vehicles}
            await asyncio.to_thread(processes.end_members, self.tag, pids, VEHICLE_GRACE_S)
        # MAVProxy's log writer and windows, in case it died before them.
        all_ended = await asyncio.to_thread(processes.end_members, self.tag, self.sessions, STRAY_GRACE_S)
        if not all_ended:
            remaining = ", ".join(map(str, processes.members(self.tag, self.sessions)))
            complain(f"these processes would not end: {remaining}")
        for process in (self.mavproxy, *self.vehicles, self.watchdog):
            if process is not None:
                if process.stdin is not None:
                    process.stdin.close()
                await process.wait()

    async def _end_mavproxy(self, mavproxy: Process) -> None:
        """SIGTERM, which MAVProxy takes as `exit`; a second one, which ends it at once; then SIGKILL."""
        for signum, grace_s in (
            (signal.SIGTERM, MAVPROXY_GRACE_S if self.options.headless else PROMPT_GRACE_S),
            (signal.SIGTERM, MAVPROXY_FORCED_S),
            (signal.SIGKILL, MAVPROXY_FORCED_S),
        ):
            if mavproxy.returncode is not None:
                return
            with suppress(ProcessLookupError):
                mavproxy.send_signal(signum)
            ended = asyncio.create_task(mavproxy.wait())
            hurried = asyncio.create_task(self.hurry.wait())
            await asyncio.wait({ended, hurried}, timeout=grace_s, return_when=asyncio.FIRST_COMPLETED)
            self.hurry.clear()
            for task in (ended, hurried):
                task.cancel()


def complain(problem: str) -> None:
    """Print one line to stderr, below MAVProxy's prompt."""
    say("", f"mavproxy-uavapi: {problem}", file=sys.stderr)


def has_logged(log: Path, words: bytes) -> bool:
    """Whether the log contains the words."""
    return words in log.read_bytes()


def last_line(log: Path) -> str:
    """The last line that is not empty, for an error that fits one line."""
    return next((line for line in reversed(read_lines(log)) if line), "it logged nothing")


def read_lines(log: Path) -> list[str]:
    """The lines of the log so far, without white space at the ends."""
    return [line.strip() for line in log.read_text(encoding="utf-8", errors="replace").splitlines()]
