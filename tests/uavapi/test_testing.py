"""The plugin of pytest, with vehicles that only tell where they are; tests/end_to_end/test_testing.py flies."""

from __future__ import annotations

import contextlib
import os
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mavproxy_uavapi import testing
from mavproxy_uavapi.rehearsal import flight
from mavproxy_uavapi.rehearsal.faults import Fault
from mavproxy_uavapi.rehearsal.order import Order
from mavproxy_uavapi.testing import CallRefused, UavFleet, landed_within
from tests.support.rehearsed import HOME, record, sample

FIELD = (Path(__file__).parents[2] / "examples" / "tested" / "field.geojson").read_text()
HOVERS = (sample(0.0), sample(1.0, 3.0, 10.0))
LANDED = (*HOVERS, sample(2.0, 3.0, 0.5), sample(3.0, 3.0))


class Rehearsal:
    """In place of the real one: its flights are as they are given, one after the other."""

    flights: list[Any] = []

    def __init__(self, order: Order) -> None:
        self.order, self.waiting, self.url = order, [], "http://127.0.0.1:5769"
        self.record = record(sample(0.0))

    @contextlib.asynccontextmanager
    async def up(self) -> AsyncIterator[None]:
        yield

    async def fly(self, faults: Sequence[Fault]) -> Any:
        self.flown = self.order.files, self.order.args, [fault.text for fault in faults]
        self.record = self.flights.pop(0)

    async def ask(self, *_: Any, **more: Any) -> Any:
        return (200, {"info": 1}) if more["json"] else (409, {"detail": "it is not armed"})


@pytest.fixture
def fly(monkeypatch: pytest.MonkeyPatch) -> Callable[..., UavFleet]:
    """`fly(records...)`: a fleet whose flights will be those."""
    monkeypatch.setattr(flight, "Rehearsal", Rehearsal)
    made: list[UavFleet] = []

    def fly(*flights: Any, **more: Any) -> UavFleet:
        Rehearsal.flights = list(flights)
        made.append(UavFleet(Order((Path("t.py"),), **more), Path("/project"), ["link_loss@20s"]))
        return made[-1]

    yield fly  # type: ignore[misc]
    for fleet in made:
        fleet.close()


def test_file_is_flown_with_its_arguments_and_all_that_was_planned(fly: Callable[..., UavFleet]) -> None:
    fleet = fly(record(*LANDED))
    fleet.plan("gps_loss@leg1")
    flown = fleet[0].run("square.py", args=["10"], faults=["reboot@5m"])
    assert flown.status == 0 and flown.broken_rules == []
    planned = ["link_loss@20s", "gps_loss@leg1", "reboot@5m"]
    assert fleet._rehearsal.flown == ((Path("/project/square.py"),), ("10",), planned)  # type: ignore[attr-defined]


def test_broken_rule_fails_the_test_with_the_scripts_output_unless_seen(
    fly: Callable[..., UavFleet],
) -> None:
    (uav,) = fly(record(*HOVERS, output="Traceback"), record(*HOVERS))
    with pytest.raises(AssertionError, match="(?s)it is still in the air at the end.*Traceback"):
        uav.run("square.py")
    assert uav.run("square.py", check=False).broken_rules == ["ended"]


def test_vehicle_has_landed_within_so_many_metres_of_home_or_of_a_place(fly: Callable[..., UavFleet]) -> None:
    (uav,) = fly(record(*LANDED), record(*HOVERS))
    uav.run("square.py")
    assert landed_within(uav, 3.1) and not landed_within(uav, 2.9)
    assert not landed_within(uav, 2.9, *HOME) and landed_within(uav, 0.1, uav.now.lat, uav.now.lon)
    assert "3.0 m from home" in repr(uav)
    uav.run("square.py", check=False)
    assert not landed_within(uav, 100.0)


def test_call_that_is_refused_fails_the_test(fly: Callable[..., UavFleet]) -> None:
    (uav,) = fly()
    assert uav.call("/command/takeoff", alt=10) == {"info": 1}
    with pytest.raises(CallRefused, match="/command/land: it is not armed"):
        uav.call("/command/land")


def test_more_files_than_vehicles_are_refused(fly: Callable[..., UavFleet]) -> None:
    with pytest.raises(ValueError, match="vehicles=2"):
        fly().run("a.py", "b.py")


def test_nearest_marker_wins_and_files_begin_at_the_rootdir(tmp_path: Path) -> None:
    (tmp_path / "test_a.py").touch()
    (tmp_path / "field.geojson").write_text(FIELD)

    def marker(*args: Any, **kwargs: Any) -> Any:
        return SimpleNamespace(args=args, kwargs=kwargs)

    markers = [marker(wind="5,90"), marker(wind="1,2", envelope="field.geojson")]
    request: Any = SimpleNamespace(
        path=tmp_path / "test_a.py",
        config=SimpleNamespace(rootpath=tmp_path),
        node=SimpleNamespace(iter_markers=lambda _: markers),
    )
    order = testing._order(request, 2)
    assert (order.wind, order.count, order.envelope) == ("5,90", 2, tmp_path / "field.geojson")
    markers.append(marker("copter"))
    with pytest.raises(pytest.UsageError, match="keywords"):
        testing._order(request, 1)


def test_settings_of_a_real_api_are_not_those_of_the_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UAVAPI_TOKEN", "secret")
    with testing._without_settings():
        assert "UAVAPI_TOKEN" not in os.environ
    assert os.environ["UAVAPI_TOKEN"] == "secret"
