"""A plugin of pytest: scripts and clients are tested on embedded vehicles. See docs/testing.md.

def test_square_comes_home(uav):
    uav.run("square.py")
    assert landed_within(uav, 2.0)
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import threading
from collections.abc import Coroutine, Iterator, Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import pytest

if TYPE_CHECKING:  # a session of pytest without vehicles loads nothing else
    from mavproxy_uavapi.rehearsal.flight import Rehearsal
    from mavproxy_uavapi.rehearsal.order import Order
    from mavproxy_uavapi.rehearsal.record import Sample
    from mavproxy_uavapi.rehearsal.report import Rehearsed

T = TypeVar("T")

SETTINGS = "UAVAPI_"  # begins the variables of a real API
PRINTED = 2000  # characters of a script's output below a failure
METRES_PER_DEGREE = 111_319.5  # of latitude
MARKERS = (
    "uav(**options): the vehicles of `uav` and `fleet`: options of `mavproxy-uavapi run`, such as wind='5,90'",
    "faults(*texts): what goes wrong in the test, such as 'gps_loss@leg2' (`mavproxy-uavapi run --help`)",
)


class CallRefused(AssertionError):
    """The API has refused a call; its text is the path and the API's sentence."""


class UavFleet(Sequence["Uav"]):
    """Vehicles with an API of their own. `uav` is the only one, or the first one.

    Args:
        order: what they are.
        folder: what paths of files are relative to.
        faults: what goes wrong in the first flight.
    """

    def __init__(self, order: Order, folder: Path, faults: Sequence[str] = ()) -> None:
        self._order, self._folder, self._faults = order, folder, faults
        from mavproxy_uavapi.rehearsal.virtual_time import VirtualLoop  # noqa: PLC0415

        self._loop = VirtualLoop(order.speedup)
        self._loop.is_paced = True  # for clients of the test's own
        self._thread = threading.Thread(target=self._loop.run_forever, name="uavapi-testing", daemon=True)
        self._thread.start()
        try:
            self._start()
        except BaseException:
            self._end_loop()
            raise

    def __len__(self) -> int:
        return self._order.count

    def __getitem__(self, number: Any) -> Any:
        uavs = [Uav(self, system) for system in range(1, len(self) + 1)]
        return uavs[number]

    @property
    def url(self) -> str:
        """The address of the API: that of its first vehicle; the others are at /vehicles/2 and so on."""
        return self._rehearsal.url

    def plan(self, fault: str) -> None:
        """Have something go wrong at its moment, in the flight under way or in the next one.

        Raises:
            NoSuchFault: it does not exist, or its moment cannot be read.
        """
        from mavproxy_uavapi.rehearsal.faults import fault_of  # noqa: PLC0415

        self._rehearsal.waiting.append(fault_of(fault))

    def run(
        self, *files: Path | str, args: Sequence[str] = (), faults: Sequence[str] = (), check: bool = True
    ) -> Rehearsed:
        """Fly a script, a mission or a track, or one for each vehicle, until all has come to rest.

        A script finds the API in UAVAPI_URL, and its clock runs as fast as the vehicles'.

        Args:
            files: their paths; relative ones begin at the rootdir of pytest.
            args: the scripts' command-line arguments.
            faults: what goes wrong, besides what is planned.
            check: whether a file that fails, or a rule that is broken, fails the test.

        Raises:
            AssertionError: it does.
            NoSuchFault, LaunchError: a fault does not exist, or cannot begin.
        """
        __tracebackhide__ = True
        if len(files) > len(self):
            raise ValueError(f"{len(files)} files for {len(self)}: mark the test by uav(vehicles={len(files)})")
        for fault in faults:
            self.plan(fault)
        planned = tuple(self._rehearsal.waiting)
        paths = tuple(self._folder / file for file in files)
        self._rehearsal.order = replace(self._order, files=paths, args=tuple(args))
        self._do(self._rehearsal.fly(planned))
        return self._judged([fault.text for fault in planned], check)

    def settle(self, *, check: bool = True) -> Rehearsed:
        """Wait until all vehicles have come to rest; what was flown since the test began is judged as by `run`."""
        __tracebackhide__ = True
        self._do(self._rehearsal.watched(self._rehearsal.settled()))
        return self._judged((), check)

    def call(self, path: str, **values: Any) -> dict[str, Any]:
        """POST to the API; returns its answer.

        Raises:
            CallRefused: it is no success.
        """
        __tracebackhide__ = True
        status, answer = self._do(self._rehearsal.ask("POST", path, json=values))
        if status >= 400:
            raise CallRefused(f"{path}: {answer.get('detail', status)}")
        return answer

    def samples(self, system: int) -> list[Sample]:
        """Where a vehicle was, since the flight under way began, or that before."""
        return self._rehearsal.record.samples[system]

    def _judged(self, faults: Sequence[str], check: bool) -> Rehearsed:
        from mavproxy_uavapi.rehearsal.report import WELL, Rehearsed, lines  # noqa: PLC0415
        from mavproxy_uavapi.rehearsal.rules import broken  # noqa: PLC0415

        __tracebackhide__ = True
        record = self._rehearsal.record
        outcome = Rehearsed(tuple(faults), record, tuple(broken(record, self._order.limits)))
        if check and outcome.status != WELL:
            raise AssertionError("\n".join([*lines(outcome), record.output[-PRINTED:]]).strip())
        return outcome

    # -- life ---------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        from mavproxy_uavapi.rehearsal.flight import Rehearsal  # noqa: PLC0415

        self._rehearsal: Rehearsal = Rehearsal(self._order)
        self._up: AbstractAsyncContextManager[None] = self._rehearsal.up()
        self._do(self._up.__aenter__())
        for fault in self._faults:
            self.plan(fault)

    def _stop(self) -> None:
        self._do(self._up.__aexit__(None, None, None))

    def close(self) -> None:
        """End the vehicles."""
        try:
            self._stop()
        finally:
            self._end_loop()

    def _end_loop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.end()

    def _do(self, work: Coroutine[Any, Any, T]) -> T:
        future = asyncio.run_coroutine_threadsafe(self._at_once(work), self._loop)
        try:
            return future.result()
        except BaseException:
            future.cancel()
            raise

    async def _at_once(self, work: Coroutine[Any, Any, T]) -> T:
        """What it comes to, as fast as that can be computed."""
        self._loop.is_paced = self._order.ardupilot is not None
        try:
            return await work
        finally:
            self._loop.is_paced = True


class Uav:
    """One vehicle.

    Args:
        fleet: that it is of.
        system: its system id.

    Attributes:
        system: its system id.
    """

    def __init__(self, fleet: UavFleet, system: int) -> None:
        self._fleet, self.system = fleet, system
        self.run, self.settle = fleet.run, fleet.settle

    def __repr__(self) -> str:
        now = self.now
        state = "armed" if now.armed else "disarmed"
        where = f"{self.from_home:.1f} m from home, {now.height:.1f} m up"
        return f"<vehicle {self.system}: {where}, {state}, {now.mode}>"

    @property
    def url(self) -> str:
        """The address of its API."""
        return f"{self._fleet.url}/vehicles/{self.system}" if len(self._fleet) > 1 else self._fleet.url

    @property
    def now(self) -> Sample:
        """The truth about it: place, height, speed, mode."""
        return self.way[-1]

    @property
    def way(self) -> list[Sample]:
        """The truth about it since the flight under way began, or that before."""
        return self._fleet.samples(self.system)

    @property
    def from_home(self) -> float:
        """m over the ground from where it stood at the beginning."""
        return _metres(self.way[0].lat, self.way[0].lon, self.now)

    def call(self, path: str, **values: Any) -> dict[str, Any]:
        """POST to its API, such as `uav.call("/command/takeoff", alt=10)`; returns its answer.

        Raises:
            CallRefused: it is no success.
        """
        return self._fleet.call(f"/vehicles/{self.system}{path}", **values)


def landed_within(uav: Uav, metres: float, lat: float | None = None, lon: float | None = None) -> bool:
    """Whether it stands on the ground, disarmed, within so many m of a place (degrees); without one, of its home."""
    now = uav.now
    near = uav.from_home if lat is None or lon is None else _metres(lat, lon, now)
    return now.landed and not now.armed and near <= metres


def _metres(lat: float, lon: float, there: Sample) -> float:
    east = (there.lon - lon) * math.cos(math.radians(lat))
    return math.hypot(there.lat - lat, east) * METRES_PER_DEGREE


# -- fixtures ---------------------------------------------------------------------------------------------------


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers."""
    for line in MARKERS:
        config.addinivalue_line("markers", line)


@pytest.fixture
def fleet(request: pytest.FixtureRequest) -> Iterator[UavFleet]:
    """Vehicles on the ground, ready to arm; as many as the marker `uav` says (`vehicles`), else two."""
    least = 2 if "uav" not in request.fixturenames else 1
    with _without_settings():
        marked = [text for marker in request.node.iter_markers("faults") for text in marker.args]
        fleet = UavFleet(_order(request, least), request.config.rootpath, marked)
        try:
            yield fleet
        finally:
            fleet.close()


@pytest.fixture
def uav(fleet: UavFleet) -> Uav:
    """A vehicle on the ground, ready to arm."""
    return fleet[0]  # type: ignore[no-any-return]


@pytest.fixture
def faults(fleet: UavFleet) -> Any:
    """`faults("link_loss@20s:10s")`: something goes wrong at its moment."""
    return fleet.plan


def _order(request: pytest.FixtureRequest, vehicles: int) -> Order:
    """The order of the markers `uav` of a test, its class and its module; the nearest wins."""
    from mavproxy_uavapi.rehearsal.order import order_of  # noqa: PLC0415

    options: dict[str, Any] = {"vehicles": vehicles}
    for marker in reversed(list(request.node.iter_markers("uav"))):
        if marker.args:
            raise pytest.UsageError("the marker uav takes keywords, such as uav(wind='5,90')")
        options |= marker.kwargs
    words = [f"--{name.replace('_', '-')}={_located(name, value, request)}" for name, value in options.items()]
    return replace(order_of([str(request.path), *words]), looks_ahead=False)


def _located(name: str, value: Any, request: pytest.FixtureRequest) -> Any:
    return request.config.rootpath / value if name in ("envelope", "parameters") else value


@contextlib.contextmanager
def _without_settings() -> Iterator[None]:
    """Settings of a real API in the environment are none of those that a test starts."""
    kept = {name: os.environ.pop(name) for name in list(os.environ) if name.startswith(SETTINGS)}
    try:
        yield
    finally:
        os.environ.update(kept)
