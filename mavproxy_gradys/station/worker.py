"""One worker: a store, the HTTP API, and optionally a consumer of a broker's messages."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import ssl
import time
from collections.abc import AsyncIterator

from aiohttp import web

from mavproxy_gradys.station.app import Station
from mavproxy_gradys.station.consumer import Consumer
from mavproxy_gradys.station.fleet import AlarmLimits
from mavproxy_gradys.station.fleet_watch import FleetWatch
from mavproxy_gradys.station.health import StationHealth
from mavproxy_gradys.station.inbox import Inbox
from mavproxy_gradys.station.intake import Intake
from mavproxy_gradys.station.options import is_postgres, worker_name
from mavproxy_gradys.station.sqlite_store import SqliteStore
from mavproxy_gradys.station.statistics import Statistics
from mavproxy_gradys.station.store import Store
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.terminal import say
from mavproxy_uavapi.core.timeout import wait_with_timeout

INBOX_FACTOR = 2  # times the receive maximum: messages of an earlier connection may wait, too


class ExtraMissing(Exception):
    """An optional library is not installed."""


def make_store(options: argparse.Namespace) -> Store:
    """The store that the options name.

    Raises:
        NotStored: it is a file that cannot be opened.
        ExtraMissing: it is PostgreSQL, and asyncpg is not installed.
    """
    if not is_postgres(options.database):
        return SqliteStore(options.database)
    try:
        from mavproxy_gradys.station.postgres_store import PostgresStore  # noqa: PLC0415  an extra
    except ModuleNotFoundError as missing:
        raise extra_missing("PostgreSQL", missing) from missing
    return PostgresStore(options.database, worker_name(options))


def extra_missing(what: str, missing: ModuleNotFoundError) -> ExtraMissing:
    """The error that names the library and how to install it."""
    return ExtraMissing(f"{what} needs {missing.name}: pip install 'mavproxy-uavapi[fleet]'")


@contextlib.asynccontextmanager
async def worker(options: argparse.Namespace) -> AsyncIterator[web.Application]:
    """The application; the other parts of the worker run within the context.

    Raises:
        NotStored, ExtraMissing: as `make_store`; MQTT needs an optional library, too.
        SettingError: the broker's address is malformed.
    """
    tasks, store = HeldTasks(), make_store(options)
    try:
        intake = Intake(store, Statistics())
        watch = FleetWatch(store, AlarmLimits(options.silent, options.battery))
        health = start_consumer(options, intake, watch, tasks) if options.broker else StationHealth(watch, intake)
        tasks.start(watch.run(), "the reading of the fleet's state")
        access = {"token": options.token, "public_name": options.public_name}
        yield Station(intake, watch, health, watched=options.watched, **access).app()
    finally:
        await tasks.end()
        await store.close()


def start_consumer(options: argparse.Namespace, intake: Intake, watch: FleetWatch, tasks: HeldTasks) -> StationHealth:
    """Begin to consume messages.

    Raises:
        ExtraMissing, SettingError: as `worker`.
    """
    try:
        from mavproxy_gradys.station.broker_connection import (  # noqa: PLC0415  an extra
            BrokerAddress,
            BrokerConnection,
        )
    except ModuleNotFoundError as missing:
        raise extra_missing("MQTT", missing) from missing
    receive_maximum = 2 * options.batch  # one batch is stored while the next one comes
    inbox = Inbox(INBOX_FACTOR * receive_maximum, time.monotonic)
    address = BrokerAddress(
        options.broker,
        options.topic,
        options.group,
        worker_name(options),
        options.session,
        receive_maximum,
        options.ca_file,
    )
    broker = BrokerConnection(address, inbox)
    consumer = Consumer(inbox, intake, broker, size=options.batch, seconds=options.batch_seconds)
    tasks.start(broker.run(), "the connection to the broker")
    tasks.start(consumer.run(), "the storing of messages")
    return StationHealth(watch, intake, inbox, broker)


async def serve(options: argparse.Namespace, stop: asyncio.Event) -> None:
    """Serve until `stop` is set.

    Raises:
        OSError: the port is taken, there is no such address, or the certificate cannot be read.
        NotStored, ExtraMissing, SettingError: as `worker`.
    """
    context = None
    if options.certificate is not None:
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        context.load_cert_chain(options.certificate)
    async with worker(options) as app:
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        try:
            await web.TCPSite(runner, options.host, options.port, ssl_context=context, reuse_address=True).start()
            scheme = "http" if context is None else "https"
            say(f"station: listening on {scheme}://{options.host}:{options.port}")
            await stop.wait()
        finally:
            with contextlib.suppress(asyncio.TimeoutError):
                await wait_with_timeout(5.0, runner.cleanup())
