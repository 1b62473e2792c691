"""`mavproxy-uavapi run`, from its arguments to its exit status."""

from __future__ import annotations

import asyncio
import itertools
import logging
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mavproxy_uavapi.core.errors import UavApiError
from mavproxy_uavapi.core.mission.mission_files import parts_of
from mavproxy_uavapi.core.terminal import say_text
from mavproxy_uavapi.files import rehearsals
from mavproxy_uavapi.launcher.errors import LaunchError
from mavproxy_uavapi.rehearsal.filed_request import request_in
from mavproxy_uavapi.rehearsal.flight import Rehearsal
from mavproxy_uavapi.rehearsal.order import Order, is_script, order_of
from mavproxy_uavapi.rehearsal.page import as_html
from mavproxy_uavapi.rehearsal.report import NOT_FLOWN, Rehearsed, as_json, as_junit, lines, status_of
from mavproxy_uavapi.rehearsal.rules import broken
from mavproxy_uavapi.rehearsal.virtual_time import run_in_virtual_time

SETTINGS = "UAVAPI_"
WRITERS = {".json": as_json, ".html": as_html, ".xml": as_junit}


def run(argv: Sequence[str]) -> int:
    """Fly the file as often as it was ordered, and say what came of it.

    Returns:
        0 if it went well, 1 if the file failed, 2 if a rule was broken, 3 if it could not be flown.
    """
    try:
        order = order_of(argv)
        digests = [_digest_of(file) for file in order.files]
        _forget_settings()
        logging.getLogger("uavapi").addHandler(logging.NullHandler())  # the report says what counts
        outcomes = run_in_virtual_time(_flown(order), order.speedup)
        for report in order.reports:
            report.write_text(WRITERS[report.suffix](outcomes), encoding="utf-8")
        for digest in digests:
            _keep(digest, as_json(outcomes))
    except asyncio.CancelledError:
        say_text("mavproxy-uavapi run: it was interrupted", file=sys.stderr)
        return NOT_FLOWN
    except (LaunchError, OSError) as error:
        say_text(f"mavproxy-uavapi run: {error}", file=sys.stderr)
        return NOT_FLOWN
    return status_of(outcomes)


def _forget_settings() -> None:
    """Settings of the real API in the environment, such as its token, are none of those that a rehearsal starts."""
    for name in [name for name in os.environ if name.startswith(SETTINGS)]:
        del os.environ[name]


def _keep(digest: str, report: str) -> None:
    """Keep the report for the records of flights; a disk that refuses changes nothing of what came of it."""
    try:
        rehearsals.keep(digest, report)
    except OSError as error:
        say_text(f"the report is not kept on this machine: {error.strerror}", file=sys.stderr)


def _digest_of(file: Path) -> str:
    content = file.read_bytes()
    if is_script(file) or request_in(file) is not None:
        return rehearsals.digest_of(content)
    try:
        return rehearsals.digest_of_mission(parts_of(content.decode("utf-8", "replace")).items)
    except UavApiError:  # the vehicle has refused it, too
        return rehearsals.digest_of(content)


async def _flown(order: Order) -> list[Rehearsed]:
    outcomes = []
    for number, faults in itertools.product(range(order.repeats), order.runs):
        seed = order.seed + number
        rehearsal = Rehearsal(replace(order, seed=seed, looks_ahead=order.looks_ahead and not number))
        async with rehearsal.up():
            record = await rehearsal.fly(faults)
        names = tuple(fault.text for fault in faults)
        outcomes.append(Rehearsed(names, record, tuple(broken(record, order.limits)), seed))
        say_text("\n".join(lines(outcomes[-1])))
    return outcomes
