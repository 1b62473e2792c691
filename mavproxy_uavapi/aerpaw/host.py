"""Runs one script: connects its vehicle, waits for the script's end, and applies `--on-exit` to the vehicle."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from mavproxy_uavapi.aerpaw import geometry, on_exit
from mavproxy_uavapi.aerpaw.constants import DEFAULT_SAFETY_CHECKER_PORT
from mavproxy_uavapi.aerpaw.drone import Drone
from mavproxy_uavapi.aerpaw.dummy_vehicle import DummyVehicle
from mavproxy_uavapi.aerpaw.event_log import StructuredEventLogger
from mavproxy_uavapi.aerpaw.exceptions import AerpawlibError, HeartbeatLostError, RunnerError, UnexpectedDisarmError
from mavproxy_uavapi.aerpaw.platform import AERPAW_Platform
from mavproxy_uavapi.aerpaw.rover import Rover
from mavproxy_uavapi.aerpaw.runner import Runner
from mavproxy_uavapi.aerpaw.v2 import runner as runners_v2
from mavproxy_uavapi.aerpaw.v2 import vehicle as vehicles_v2
from mavproxy_uavapi.aerpaw.v2.safety import SafetyCheckerClient
from mavproxy_uavapi.aerpaw.vehicle import Vehicle
from mavproxy_uavapi.aerpaw.zmq_runner import ZmqStateMachine
from mavproxy_uavapi.client.drone import connect
from mavproxy_uavapi.core.errors import UavApiError

log = logging.getLogger("aerpawlib")

# The classes of the options' vehicles, of v1 and v2.
CLASSES: dict[str, tuple[type[Vehicle], type[Vehicle]]] = {
    "drone": (Drone, vehicles_v2.Drone),
    "rover": (Rover, vehicles_v2.Rover),
    "generic": (Vehicle, vehicles_v2.Vehicle),
    "none": (DummyVehicle, vehicles_v2.DummyVehicle),
}
BY_TYPE = {"copter": "drone", "rover": "rover"}
CHECK_PERIOD = 0.2  # s between checks of the heartbeat
TELEMETRY_PERIOD = 5.0  # s between telemetry events in the structured log
STOPPED = 130  # exit status after Ctrl-C


class Stopped(Exception):
    """A signal has ended the script."""


class ScriptHost:
    """One script's run.

    Args:
        options: the options of the command line.
        runner: the script's runner.
    """

    def __init__(self, options: argparse.Namespace, runner: Runner) -> None:
        self._options, self._runner = options, runner
        self._policy = "nothing" if options.skip_rtl else options.on_exit
        self._policy_applied = True  # whether `--on-exit` succeeded

    def run(self) -> int:
        """Run it; returns the exit status."""
        try:
            vehicle = self._connect()
        except (AerpawlibError, UavApiError) as error:
            log.error("could not connect: %s", error)
            return 1
        try:
            return self._fly(vehicle) or int(not self._policy_applied)
        finally:
            Vehicle.close(vehicle)

    def _connect(self) -> Vehicle:
        kind = self._options.vehicle or asyncio.run(self._kind())
        log.info("connecting to %s", self._options.conn)
        vehicle_class = CLASSES[kind][isinstance(self._runner, runners_v2.Runner)]
        return vehicle_class(self._options.conn, timeout=self._options.conn_timeout)

    async def _kind(self) -> str:
        async with connect(self._options.conn, timeout=self._options.conn_timeout) as drone:
            return BY_TYPE.get((await drone.status()).kind, "generic")

    def _fly(self, vehicle: Vehicle) -> int:
        with contextlib.ExitStack() as stack:
            if self._options.structured_log:
                file = stack.enter_context(Path(self._options.structured_log).open("w", encoding="utf-8"))
                for one in (vehicle, self._runner):
                    one.set_event_log(StructuredEventLogger(file))
                stack.callback(vehicle.set_event_log, None)
            try:
                asyncio.run(self._run(vehicle))
            except (KeyboardInterrupt, Stopped):
                log.warning("the script was stopped")
                return STOPPED
            except Exception as error:
                log.exception("the script failed: %s", error)
                return 1
        return 0

    async def _run(self, vehicle: Vehicle) -> None:
        """Run the script and apply `--on-exit`, before tasks that the script left behind end with this loop."""
        checker = None
        try:
            if isinstance(vehicle, vehicles_v2.Vehicle):
                vehicle.safety = checker = await self._safety_checker()
            await self._script(vehicle)
        finally:
            if checker is not None:
                checker.close()
            self._policy_applied = await on_exit.apply_policy(vehicle, self._policy)

    async def _script(self, vehicle: Vehicle) -> None:
        if not self._options.skip_init:
            await asyncio.to_thread(Vehicle.initialize, vehicle, True)
        if (
            isinstance(self._runner, ZmqStateMachine)
            and self._options.zmq_identifier
            and self._options.zmq_proxy_server
        ):
            self._runner._initialize_zmq_bindings(self._options.zmq_identifier, self._options.zmq_proxy_server)
        running = asyncio.ensure_future(self._runner.run(vehicle))
        stopped = asyncio.get_running_loop().create_future()
        beside = [asyncio.ensure_future(self._watch(vehicle)), stopped]
        with _stopping(stopped):
            try:
                await asyncio.wait({running, *beside}, return_when=asyncio.FIRST_COMPLETED)
            finally:
                ended = running.done()
                running.cancel()
                await asyncio.gather(running, return_exceptions=True)
                for one in beside:
                    if not one.done():
                        one.cancel()
        if ended:
            running.result()
        else:
            for one in beside:
                if one.done() and not one.cancelled():
                    one.result()

    async def _safety_checker(self) -> SafetyCheckerClient | None:
        """The safety checker that the options name.

        Raises:
            TimeoutError, RunnerError: it does not answer, or does not work.
        """
        ip, port = self._options.safety_checker_ip, self._options.safety_checker_port
        if ip is None and port is None:
            return None
        client = SafetyCheckerClient(ip or "127.0.0.1", port or DEFAULT_SAFETY_CHECKER_PORT)
        with contextlib.ExitStack() as unless_it_works:
            unless_it_works.callback(client.close)
            works, why_not = await client.check_server_status()
            if not works:
                raise RunnerError(f"the safety checker does not work: {why_not}")
            unless_it_works.pop_all()
        return client

    async def _watch(self, vehicle: Vehicle) -> None:
        """Watch the heartbeat while the script runs, and log telemetry.

        Raises:
            HeartbeatLostError: no heartbeat arrives any more.
            UnexpectedDisarmError: the vehicle of a script for v2 has disarmed in flight.
        """
        logged_at = 0.0
        while True:
            await asyncio.sleep(CHECK_PERIOD)
            if vehicle.heartbeat_age > self._options.heartbeat_timeout:
                raise HeartbeatLostError(vehicle.heartbeat_age)
            if isinstance(vehicle, vehicles_v2.Vehicle) and vehicle.has_disarmed_unexpectedly():
                raise UnexpectedDisarmError
            if time.monotonic() - logged_at > TELEMETRY_PERIOD:
                logged_at = time.monotonic()
                vehicle.log_telemetry()


@contextlib.contextmanager
def _stopping(stopped: asyncio.Future[None]) -> Iterator[None]:
    """Within the context SIGINT or SIGTERM ends the script at its next await; a second signal ends it at once."""
    loop = asyncio.get_running_loop()

    def stop(*_: Any) -> None:
        if stopped.done():
            raise KeyboardInterrupt
        stopped.set_exception(Stopped())
        loop.call_soon_threadsafe(lambda: None)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def set_up_logging(options: argparse.Namespace) -> None:
    """Log to stderr, and to a file if the options name one."""
    level = logging.DEBUG if options.verbose else logging.WARNING if options.quiet else logging.INFO
    handlers: list[logging.Handler] = []
    if not options.no_aerpawlib_stdout:
        handlers.append(logging.StreamHandler(sys.stderr))
        handlers[0].setLevel(level)
        handlers[0].setFormatter(logging.Formatter("[%(name)s] %(message)s"))
    if options.log_file:
        handlers.append(logging.FileHandler(options.log_file, encoding="utf-8"))
        handlers[-1].setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    root = logging.getLogger("aerpawlib")
    root.handlers = handlers or [logging.NullHandler()]
    root.setLevel(logging.DEBUG)
    root.propagate = False


def run(options: argparse.Namespace, rest: Sequence[str], load: Callable[[str], type[Runner]]) -> int:
    """Load the script, pass its arguments, and run it; returns the exit status."""
    set_up_logging(options)
    if options.no_aerpaw_environment:
        AERPAW_Platform._connected = False
    try:
        kind = load(options.script)
        version = "v2" if issubclass(kind, runners_v2.Runner) else "v1"
        if options.api_version not in {None, version}:
            raise RunnerError(f"its runner is of aerpawlib.{version}, not of {options.api_version}")
        if version == "v2":
            geometry.pickle_as_of("aerpawlib.v2.types")
        runner = kind()
        runner.initialize_args(list(rest))
    except Exception as error:
        log.exception("%s: %s", options.script, error)
        return 1
    if isinstance(runner, ZmqStateMachine) and not (options.zmq_identifier and options.zmq_proxy_server):
        log.error("ZMQ runners need --zmq-identifier NAME --zmq-proxy-server ADDRESS")
        return 1
    return ScriptHost(options, runner).run()
