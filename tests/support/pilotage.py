"""Verbs as jobs."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from mavproxy_uavapi.core.control.jobs import Job, JobBook
from mavproxy_uavapi.core.vehicle.vehicle import Vehicle
from tests.support.virtual_time import FastLoop


class Pilotage:
    """Begins verbs of a vehicle, and awaits them.

    Attributes:
        book: the jobs.
    """

    def __init__(self, loop: FastLoop, book: JobBook, vehicle: Vehicle) -> None:
        self.book = book
        self._loop, self._vehicle = loop, vehicle
        self._numbers = itertools.count()

    def start(self, verb: Callable[..., Any], *args: Any, **kwargs: Any) -> Job:
        """Begin a verb."""

        async def body(job: Job) -> str:
            await verb(job, *args, **kwargs)
            return "done"

        async def begin() -> Job:
            return self.book.begin(self._vehicle, f"{verb.__name__}{next(self._numbers)}", {}, body)

        job: Job = self._loop.run(begin())
        self._loop.settle()
        return job

    def result(self, job: Job) -> str:
        """What it returns, or the error that it ends with."""
        return str(self._loop.run(job.outcome()))

    def do(self, verb: Callable[..., Any], *args: Any, **kwargs: Any) -> str:
        """Begin a verb, and await it."""
        return self.result(self.start(verb, *args, **kwargs))
