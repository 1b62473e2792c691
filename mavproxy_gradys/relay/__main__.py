"""`python -m mavproxy_gradys.relay`: a fleet's vehicles on GrADyS ground stations."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import os
import sys

from mavproxy_gradys.errors import NotDelivered
from mavproxy_gradys.net.addresses import split_url, stations
from mavproxy_gradys.net.http_client import Client, tls_context
from mavproxy_gradys.relay.relay import Pushes, Relay
from mavproxy_gradys.station.options import positive, topic_filter
from mavproxy_uavapi.core.errors import SettingError
from mavproxy_uavapi.core.held_tasks import HeldTasks
from mavproxy_uavapi.core.platform import on_stop
from mavproxy_uavapi.core.terminal import say
from mavproxy_uavapi.core.timeout import wait_with_timeout

REPORT_EVERY = 60.0  # s
log = logging.getLogger("relay")


def parser() -> argparse.ArgumentParser:
    """The options; the broker's address may have a password, so the environment can give it instead."""
    made = argparse.ArgumentParser(
        prog="python -m mavproxy_gradys.relay",
        description="Shows the vehicles of an MQTT broker on GrADyS ground stations.",
        epilog="The variables RELAY_BROKER and RELAY_TOKEN set the options, too.",
    )
    broker = os.environ.get("RELAY_BROKER", "mqtt://127.0.0.1")
    made.add_argument("gs", help="ground stations, HOST:PORT or http(s)://HOST:PORT, separated by commas")
    made.add_argument("--broker", default=broker, help="mqtt(s)://[USER:PASSWORD@]HOST[:PORT]")
    made.add_argument(
        "--topic", type=topic_filter, default="fleet/#", help="topic filter of the readings (%(default)s)"
    )
    made.add_argument("--period", type=positive, default=1.0, help="s between the updates (%(default)g)")
    made.add_argument("--timeout", type=positive, default=5.0, help="s for an answer (%(default)g)")
    made.add_argument("--token", default=os.environ.get("RELAY_TOKEN", ""), help="bearer token for the stations")
    made.add_argument("--ca-file", default="", help="certificates to check TLS with, PEM")
    return made


async def run(options: argparse.Namespace) -> None:
    """Relay, until a signal arrives.

    Raises:
        SettingError, NotDelivered: an address is malformed, or the CA file cannot be read.
    """
    tls_context(options.ca_file)
    addresses = stations(options.gs)
    broker = split_url(options.broker, ("mqtt", "mqtts"))
    pushes = [Pushes(one, Client(options.timeout, options.token, options.ca_file)) for one in addresses]
    relay, stop = Relay(broker, options.topic, options.timeout, options.ca_file), asyncio.Event()
    on_stop(stop.set)
    tasks = HeldTasks()
    tasks.start(relay.listen(), "the subscription")
    tasks.start(relay.push(pushes, options.period), "the updates")
    while not stop.is_set():
        with contextlib.suppress(asyncio.TimeoutError):
            await wait_with_timeout(REPORT_EVERY, stop.wait())
        for address, one in zip(addresses, pushes, strict=True):
            log.info("%s: %d updates, %d failed", address.url, one.sent, one.failed)
    await tasks.end()


def main(arguments: list[str] | None = None) -> int:
    """Relay until SIGINT or SIGTERM; returns the exit status."""
    options = parser().parse_args(arguments)
    logging.basicConfig(format="relay: %(message)s", level=logging.INFO)
    try:
        asyncio.run(run(options))
    except (SettingError, NotDelivered) as error:
        say(f"relay: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
